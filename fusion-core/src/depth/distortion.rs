//! Lens distortion: the Brown–Conrady model with a rational radial factor.

use nalgebra::{Matrix2, Vector2};
use serde::{Deserialize, Serialize};

/// Coefficients of a lens in OpenCV's order and sign: radial k1, k2, k3 in the numerator and k4, k5, k6 in the
/// denominator, tangential p1 and p2. Azure Kinect reports the same eight.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DistortionCoefficients {
    /// Factor of r².
    pub k1: f64,
    /// Factor of r⁴.
    pub k2: f64,
    /// Tangential coefficient of 2xy in x.
    pub p1: f64,
    /// Tangential coefficient of 2xy in y.
    pub p2: f64,
    /// Factor of r⁶.
    pub k3: f64,
    /// Factor of r² in the denominator.
    pub k4: f64,
    /// Factor of r⁴ in the denominator.
    pub k5: f64,
    /// Factor of r⁶ in the denominator.
    pub k6: f64,
}

/// A lens that maps the ray (x, y, 1) to (x′, y′, 1):
///
/// x′ = x q + 2 p1 x y + p2 (r² + 2 x²), y′ = y q + p1 (r² + 2 y²) + 2 p2 x y,
/// q = (1 + k1 r² + k2 r⁴ + k3 r⁶) / (1 + k4 r² + k5 r⁴ + k6 r⁶), r² = x² + y².
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(from = "DistortionCoefficients", into = "DistortionCoefficients")]
pub struct Distortion {
    coefficients: DistortionCoefficients,
    /// Largest radius r up to which r q grows. Further out, the polynomial folds distant rays back into the image.
    radius: f64,
}

impl From<DistortionCoefficients> for Distortion {
    fn from(coefficients: DistortionCoefficients) -> Self {
        let mut lens = Self { coefficients, radius: 0.0 };
        let grows = |step: &usize| lens.radial_slope(*step as f64 * RADIUS_STEP) > LEAST_SLOPE;
        let last = (0..=RADIUS_STEPS).take_while(grows).last().unwrap_or(0);
        lens.radius = last as f64 * RADIUS_STEP;
        lens
    }
}

impl From<Distortion> for DistortionCoefficients {
    fn from(lens: Distortion) -> Self {
        lens.coefficients
    }
}

/// Step of the search for the largest radius.
const RADIUS_STEP: f64 = 0.005;
/// Steps of the search: up to r = 4, 76° off the axis.
const RADIUS_STEPS: usize = 800;
/// Least slope d(r q)/dr: beyond, a pixel sees a range of rays.
const LEAST_SLOPE: f64 = 0.05;
/// Newton steps per ray; five are usual.
const MOST_STEPS: usize = 50;
/// Largest residual of an inverted ray, relative to the focal length.
const TOLERANCE: f64 = 1e-10;

impl Distortion {
    /// Returns the coefficients.
    #[must_use]
    pub fn coefficients(&self) -> DistortionCoefficients {
        self.coefficients
    }

    /// Whether every coefficient is finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        let DistortionCoefficients { k1, k2, p1, p2, k3, k4, k5, k6 } = self.coefficients;
        [k1, k2, p1, p2, k3, k4, k5, k6].iter().all(|k| k.is_finite())
    }

    /// Returns where the lens sends a ray; `None` beyond the radius up to which the model can be inverted.
    #[must_use]
    pub fn distort(&self, ray: [f64; 2]) -> Option<[f64; 2]> {
        let ray = Vector2::from(ray);
        (ray.norm() <= self.radius).then(|| self.map(&ray).into())
    }

    /// Returns the ray that the lens sends to a place: Newton's method from that place. `None` if it does not converge
    /// to a residual of 1e-10, or leaves the radius up to which the model can be inverted.
    #[must_use]
    pub fn undistort(&self, place: [f64; 2]) -> Option<[f64; 2]> {
        let place = Vector2::from(place);
        let mut ray = place.cap_magnitude(self.radius);
        for _ in 0..MOST_STEPS {
            let residual = self.map(&ray) - place;
            if residual.norm() <= TOLERANCE {
                return (ray.norm() <= self.radius).then(|| ray.into());
            }
            let step = self.slope(&ray).try_inverse()? * residual;
            ray = (ray - step).cap_magnitude(1.05 * self.radius);
        }
        None
    }

    /// Returns q and dq/d(r²).
    fn factor(&self, square: f64) -> (f64, f64) {
        let DistortionCoefficients { k1, k2, k3, k4, k5, k6, .. } = self.coefficients;
        let polynomial = |a: f64, b: f64, c: f64| {
            let value = 1.0 + square * (a + square * (b + square * c));
            (value, a + square * (2.0 * b + square * 3.0 * c))
        };
        let ((top, top_slope), (bottom, bottom_slope)) = (polynomial(k1, k2, k3), polynomial(k4, k5, k6));
        (top / bottom, (top_slope * bottom - top * bottom_slope) / (bottom * bottom))
    }

    /// Returns d(r q)/dr.
    fn radial_slope(&self, r: f64) -> f64 {
        let (q, slope) = self.factor(r * r);
        q + 2.0 * r * r * slope
    }

    fn map(&self, ray: &Vector2<f64>) -> Vector2<f64> {
        let DistortionCoefficients { p1, p2, .. } = self.coefficients;
        let (x, y, square) = (ray.x, ray.y, ray.norm_squared());
        let (q, _) = self.factor(square);
        Vector2::new(
            x * q + 2.0 * p1 * x * y + p2 * (square + 2.0 * x * x),
            y * q + p1 * (square + 2.0 * y * y) + 2.0 * p2 * x * y,
        )
    }

    /// Returns the derivative of [`Self::map`].
    fn slope(&self, ray: &Vector2<f64>) -> Matrix2<f64> {
        let DistortionCoefficients { p1, p2, .. } = self.coefficients;
        let (x, y) = (ray.x, ray.y);
        let (q, dq) = self.factor(ray.norm_squared());
        let across = 2.0 * (x * y * dq + p1 * x + p2 * y);
        Matrix2::new(
            q + 2.0 * x * x * dq + 2.0 * p1 * y + 6.0 * p2 * x,
            across,
            across,
            q + 2.0 * y * y * dq + 6.0 * p1 * y + 2.0 * p2 * x,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The colour camera of the TUM's `freiburg1`.
    fn freiburg1() -> Distortion {
        DistortionCoefficients {
            k1: 0.2624,
            k2: -0.9531,
            p1: -0.0054,
            p2: 0.0026,
            k3: 1.1633,
            ..DistortionCoefficients::default()
        }
        .into()
    }

    /// A wide lens of the size that Azure Kinect reports: the factor falls to 0.6 at r = 1.
    fn wide() -> Distortion {
        DistortionCoefficients { k1: 4.4, k2: 2.6, p1: 1e-4, p2: -1e-5, k3: 0.13, k4: 4.7, k5: 3.9, k6: 0.67 }.into()
    }

    #[test]
    fn places_and_rays_convert_both_ways() {
        for (lens, far) in [(freiburg1(), 0.8), (wide(), 1.2)] {
            for at in 0..100 {
                let angle = f64::from(at);
                let r = far * f64::from(at) / 99.0;
                let ray = [r * angle.cos(), r * angle.sin()];
                let back = lens.undistort(lens.distort(ray).unwrap()).unwrap();
                assert!((0..2).all(|i| (back[i] - ray[i]).abs() < 1e-8), "{lens:?}: {ray:?} {back:?}");
            }
        }
    }

    #[test]
    fn the_slope_is_the_derivative() {
        let (lens, at, step) = (freiburg1(), Vector2::new(0.4, -0.3), 1e-6);
        for axis in 0..2 {
            let mut shift = Vector2::zeros();
            shift[axis] = step;
            let difference = (lens.map(&(at + shift)) - lens.map(&(at - shift))) / (2.0 * step);
            assert!((difference - lens.slope(&at).column(axis)).norm() < 1e-9, "{axis}: {difference}");
        }
    }

    #[test]
    fn rays_beyond_the_fold_are_refused() {
        // r (1 - r²/3) grows up to r = 1 and returns to 0 at r = 1.7.
        let lens = Distortion::from(DistortionCoefficients { k1: -1.0 / 3.0, ..DistortionCoefficients::default() });
        assert!((lens.radius - 0.97).abs() < 0.01, "{}", lens.radius);
        assert!(lens.distort([0.9, 0.0]).is_some() && lens.distort([1.6, 0.0]).is_none());
        assert!(lens.undistort([0.6, 0.0]).is_some() && lens.undistort([0.7, 0.0]).is_none());
    }
}
