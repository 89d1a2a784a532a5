use nalgebra::Vector3;

use super::camera::Camera;

/// A camera whose pixels have no rays.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum LensError {
    /// A parameter is invalid.
    #[error("{0}")]
    Camera(&'static str),
    /// The distortion maps no ray to a pixel.
    #[error(
        "the lens distortion cannot be inverted at pixel ({u}, {v}); expected a model that covers the image: \
         check the order and signs of k1 … k6, p1 and p2, and that they belong to this focal length"
    )]
    NotInvertible {
        /// Column of the pixel.
        u: usize,
        /// Row of the pixel.
        v: usize,
    },
}

/// The rays that the pixels of a camera see. Those of a distorted lens are computed once.
#[derive(Clone, Debug, PartialEq)]
pub struct PixelRays {
    camera: Camera,
    /// x and y at depth 1, row by row; empty for a pinhole camera, whose rays are cheaper to compute than to load.
    table: Vec<[f64; 2]>,
}

impl PixelRays {
    /// Computes the rays of every pixel.
    ///
    /// # Errors
    /// If a parameter of the camera is invalid, or its distortion cannot be inverted at some pixel.
    pub fn new(camera: Camera) -> Result<Self, LensError> {
        if let Some(fault) = camera.fault() {
            return Err(LensError::Camera(fault));
        }
        let mut table = Vec::new();
        if let Some(lens) = camera.distortion {
            table.reserve_exact(camera.width * camera.height);
            for v in 0..camera.height {
                for u in 0..camera.width {
                    let ray = lens.undistort(camera.straight_ray([u, v]));
                    table.push(ray.ok_or(LensError::NotInvertible { u, v })?);
                }
            }
        }
        Ok(Self { camera, table })
    }

    /// Returns the camera.
    #[must_use]
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// Whether rays are those of a pinhole.
    #[must_use]
    pub fn is_pinhole(&self) -> bool {
        self.table.is_empty()
    }

    /// Returns x and y of a pixel's ray at depth 1.
    ///
    /// # Panics
    /// If the pixel is outside the image and the lens is distorted.
    #[must_use]
    pub fn ray(&self, [u, v]: [usize; 2]) -> [f64; 2] {
        if self.table.is_empty() { self.camera.straight_ray([u, v]) } else { self.table[v * self.camera.width + u] }
    }

    /// Returns the point that a pixel sees at a depth.
    ///
    /// # Panics
    /// Like [`Self::ray`].
    #[must_use]
    pub fn point(&self, pixel: [usize; 2], depth: f64) -> Vector3<f64> {
        let [x, y] = self.ray(pixel);
        Vector3::new(x, y, 1.0) * depth
    }
}

#[cfg(test)]
mod tests {
    use super::super::distortion::DistortionCoefficients;
    use super::*;

    #[test]
    fn points_project_to_the_pixel_that_sees_them() {
        let coefficients = DistortionCoefficients { k1: 0.1, k2: -0.2, p1: 0.002, ..DistortionCoefficients::default() };
        let camera = Camera { distortion: Some(coefficients.into()), ..Camera::VGA };
        for camera in [Camera::VGA, camera] {
            let rays = PixelRays::new(camera).unwrap();
            for pixel in [[0, 0], [320, 240], [639, 479], [17, 400]] {
                let point = rays.point(pixel, 2.5);
                let seen = camera.project(&point).unwrap();
                assert!((0..2).all(|i| (seen[i] - pixel[i] as f64).abs() < 1e-6), "{pixel:?}: {seen:?}");
                assert_eq!(point.z, 2.5);
            }
        }
    }

    #[test]
    fn a_lens_that_folds_within_the_image_is_refused() {
        let coefficients = DistortionCoefficients { k1: -1.0, ..DistortionCoefficients::default() };
        let camera = Camera { distortion: Some(coefficients.into()), ..Camera::VGA };
        let error = PixelRays::new(camera).unwrap_err();
        assert_eq!(error, LensError::NotInvertible { u: 0, v: 0 });
        assert!(error.to_string().contains("pixel (0, 0)"), "{error}");
    }
}
