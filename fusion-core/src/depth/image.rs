use nalgebra::Vector3;

use super::camera::Camera;

/// Depths along the camera's axis, in m, row by row; 0 without a measurement.
#[derive(Clone, Debug, PartialEq)]
pub struct DepthImage {
    /// Width, in pixels.
    pub width: usize,
    /// Height, in pixels.
    pub height: usize,
    /// Depths in m.
    pub depth: Vec<f32>,
}

impl DepthImage {
    /// Creates an image without measurements.
    #[must_use]
    pub fn empty(width: usize, height: usize) -> Self {
        Self { width, height, depth: vec![0.0; width * height] }
    }

    /// Returns the depth at a pixel; `None` if it is not positive and finite.
    #[must_use]
    pub fn at(&self, [u, v]: [usize; 2]) -> Option<f64> {
        let depth = *self.depth.get(v * self.width + u)?;
        (depth > 0.0 && depth.is_finite()).then_some(f64::from(depth))
    }

    /// Returns the number of pixels with a depth.
    #[must_use]
    pub fn valid(&self) -> usize {
        self.depth.iter().filter(|&&depth| depth > 0.0 && depth.is_finite()).count()
    }

    /// Clears the depths where a mask is 0.
    pub fn mask(&mut self, mask: &[u8]) {
        for (depth, &keep) in self.depth.iter_mut().zip(mask) {
            if keep == 0 {
                *depth = 0.0;
            }
        }
    }

    /// Returns the unit normal of the surface at a pixel, towards the camera, from depths `reach` pixels on each side.
    /// `None` if a depth is missing or at an edge: depths on both sides must be within 5 cm of each other, and within 2
    /// cm of a line.
    #[must_use]
    pub fn normal(&self, camera: &Camera, [u, v]: [usize; 2], reach: usize) -> Option<Vector3<f64>> {
        if u < reach || v < reach || u + reach >= self.width || v + reach >= self.height {
            return None;
        }
        let here = self.at([u, v])?;
        let across = |a: [usize; 2], b: [usize; 2]| -> Option<Vector3<f64>> {
            let (near, far) = (self.at(a)?, self.at(b)?);
            let edge = (near - far).abs() > 0.05 || (near + far - 2.0 * here).abs() > 0.02;
            (!edge).then(|| camera.unproject(b, far) - camera.unproject(a, near))
        };
        let right = across([u - reach, v], [u + reach, v])?;
        let down = across([u, v - reach], [u, v + reach])?;
        // x points right and y down, so their cross product points into the scene.
        down.cross(&right).try_normalize(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normals_of_a_slanted_plane_point_to_the_camera() {
        let camera = Camera { fx: 100.0, fy: 100.0, cx: 10.0, cy: 10.0, width: 21, height: 21 };
        let mut image = DepthImage::empty(21, 21);
        // The plane n·p = n·(0, 0, 2).
        let n = Vector3::new(0.3, -0.2, -1.0).normalize();
        for v in 0..21 {
            for u in 0..21 {
                let ray = camera.unproject([u, v], 1.0);
                image.depth[v * 21 + u] = (2.0 * n.z / n.dot(&ray)) as f32;
            }
        }
        let found = image.normal(&camera, [7, 12], 2).unwrap();
        assert!((found - n).norm() < 1e-4, "{found}");
        assert_eq!(image.normal(&camera, [1, 12], 2), None, "at the border");
        image.depth[12 * 21 + 9] = f32::NAN;
        assert_eq!(image.normal(&camera, [7, 12], 2), None, "beside a hole");
        image.depth[12 * 21 + 9] = 3.0;
        assert_eq!(image.normal(&camera, [7, 12], 2), None, "at an edge");
    }
}
