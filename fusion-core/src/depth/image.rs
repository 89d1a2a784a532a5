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
}
