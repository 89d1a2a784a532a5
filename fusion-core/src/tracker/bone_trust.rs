//! The errors of reported bones, estimated from the track.

/// Estimates how far reported bones are from tracked ones, and weighs the reports of the next frames.
///
/// A prior that knows its noise has the weight 1/σ². λ_prior is that weight for the errors [`Self::REFERENCE`].
#[derive(Clone, Copy, Debug)]
pub(super) struct BoneTrust {
    /// Running mean of the square distance, in m².
    square: f64,
}

impl Default for BoneTrust {
    fn default() -> Self {
        Self { square: Self::REFERENCE * Self::REFERENCE }
    }
}

impl BoneTrust {
    /// Root mean square distance in m for which λ_prior was chosen: 40 mm between tracked and reported bones, at 0.4 m
    /// from their joints, if these have errors of 5° and of 20 mm along each axis.
    const REFERENCE: f64 = 0.04;
    /// Part of a difference that one frame corrects.
    const GAIN: f64 = 0.2;
    /// Least factor: bones that the camera does not see depend on the reports.
    const LEAST: f64 = 0.1;

    /// Returns the running mean of the square distance, in m².
    pub(super) fn square(self) -> f64 {
        self.square
    }

    /// Continues with this mean.
    pub(super) fn restore(&mut self, square: f64) {
        self.square = square;
    }

    /// Takes the mean square distance of reported from tracked bones in a frame, in m².
    pub(super) fn update(&mut self, square: f64) {
        self.square += Self::GAIN * (square - self.square);
    }

    /// Returns the factor of λ_prior, at most 1: small differences do not prove that the reports are exact.
    pub(super) fn factor(&self) -> f64 {
        (Self::REFERENCE * Self::REFERENCE / self.square).clamp(Self::LEAST, 1.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reports_with_twice_the_error_weigh_a_quarter() {
        let mut trust = BoneTrust::default();
        assert_eq!(trust.factor(), 1.0);
        (0..40).for_each(|_| trust.update(0.08 * 0.08));
        assert!((trust.factor() - 0.25).abs() < 1e-3, "{}", trust.factor());
        (0..40).for_each(|_| trust.update(1.0));
        assert_eq!(trust.factor(), BoneTrust::LEAST);
        (0..80).for_each(|_| trust.update(0.0));
        assert_eq!(trust.factor(), 1.0);
    }
}
