use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use super::distortion::Distortion;

/// The largest number of pixels of an image: a little more than 4K has.
pub const MOST_PIXELS: usize = 1 << 23;

/// A camera: x to the right, y down, z into the scene. Pixel centres have integer coordinates.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Camera {
    /// Horizontal focal length, in pixels.
    pub fx: f64,
    /// Vertical focal length, in pixels.
    pub fy: f64,
    /// Horizontal principal point, in pixels.
    pub cx: f64,
    /// Vertical principal point, in pixels.
    pub cy: f64,
    /// Width of the image, in pixels.
    pub width: usize,
    /// Height of the image, in pixels.
    pub height: usize,
    /// Distortion of the lens; `None` for a pinhole.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub distortion: Option<Distortion>,
}

impl Camera {
    /// The usual structured-light camera: 640 × 480 pixels, focal length 525 pixels.
    pub const VGA: Self =
        Self { fx: 525.0, fy: 525.0, cx: 319.5, cy: 239.5, width: 640, height: 480, distortion: None };

    /// Returns the projection of a point, in pixels; `None` behind the camera, or where the lens model does not reach.
    #[must_use]
    pub fn project(&self, p: &Vector3<f64>) -> Option<[f64; 2]> {
        if p.z <= 1e-6 {
            return None;
        }
        let Some(lens) = &self.distortion else {
            return Some([self.fx * p.x / p.z + self.cx, self.fy * p.y / p.z + self.cy]);
        };
        let [x, y] = lens.distort([p.x / p.z, p.y / p.z])?;
        Some([self.fx * x + self.cx, self.fy * y + self.cy])
    }

    /// Returns the pixel of a point; `None` outside the image.
    #[must_use]
    pub fn pixel(&self, p: &Vector3<f64>) -> Option<[usize; 2]> {
        let [u, v] = self.project(p)?.map(|x| (x + 0.5).floor());
        let inside = u >= 0.0 && v >= 0.0 && u < self.width as f64 && v < self.height as f64;
        inside.then_some([u as usize, v as usize])
    }

    /// Returns x and y at depth 1 of the ray that a pixel of a pinhole sees.
    pub(super) fn straight_ray(&self, [u, v]: [usize; 2]) -> [f64; 2] {
        [(u as f64 - self.cx) / self.fx, (v as f64 - self.cy) / self.fy]
    }

    /// Returns the camera with one pixel in place of `factor` × `factor`.
    #[must_use]
    pub fn reduced(&self, factor: usize) -> Self {
        let by = factor.max(1) as f64;
        // Pixel centres have integer coordinates, so the image begins at -1/2.
        let centre = |c: f64| (c + 0.5) / by - 0.5;
        Self {
            fx: self.fx / by,
            fy: self.fy / by,
            cx: centre(self.cx),
            cy: centre(self.cy),
            width: self.width.div_ceil(factor.max(1)),
            height: self.height.div_ceil(factor.max(1)),
            distortion: self.distortion,
        }
    }

    /// Returns a description of an invalid parameter; `None` if all are valid.
    #[must_use]
    pub fn fault(&self) -> Option<&'static str> {
        // Outside of these limits, products of coordinates may overflow.
        let fits = |focal_length: f64| (1e-3..=1e9).contains(&focal_length);
        if !(fits(self.fx) && fits(self.fy)) {
            return Some("expected focal lengths greater than 0: from 0.001 to 1e9 pixels");
        }
        if !(self.cx.abs() <= 1e9 && self.cy.abs() <= 1e9) {
            return Some("expected a finite principal point, up to 1e9 pixels");
        }
        if self.distortion.is_some_and(|lens| !lens.is_finite()) {
            return Some("expected finite coefficients of the distortion");
        }
        if self.width.saturating_mul(self.height) > MOST_PIXELS {
            return Some("expected an image of at most 8388608 pixels");
        }
        (self.width == 0 || self.height == 0).then_some("expected an image with at least one pixel")
    }
}
