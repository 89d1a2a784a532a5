/// A robust loss ρ(s) of a residual's squared length s = ‖r‖², whose derivative dρ/ds is its weight in a least-squares
/// step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Loss {
    /// ρ = s, least squares.
    #[default]
    Squares,
    /// ρ = s for ‖r‖ ≤ δ, otherwise 2 δ ‖r‖ − δ²: twice Huber's loss. The weight is min(1, δ/‖r‖).
    Huber(f64),
    /// ρ = c²/3 (1 − (1 − s/c²)³) for ‖r‖ ≤ c, otherwise c²/3: twice Tukey's loss. The weight is (1 − s/c²)², and 0
    /// beyond c.
    Tukey(f64),
}

impl Loss {
    /// Returns ρ(s) and dρ/ds.
    #[inline]
    #[must_use]
    pub fn of(self, s: f64) -> (f64, f64) {
        match self {
            Self::Squares => (s, 1.0),
            Self::Huber(delta) if s <= delta * delta => (s, 1.0),
            Self::Huber(delta) => {
                let length = s.sqrt();
                (delta * (2.0 * length - delta), delta / length)
            }
            Self::Tukey(c) => {
                let left = (1.0 - s / (c * c)).max(0.0);
                (c * c / 3.0 * (1.0 - left * left * left), left * left)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_are_slopes() {
        for loss in [Loss::Squares, Loss::Huber(0.3), Loss::Tukey(0.7)] {
            for s in [1e-6, 0.01, 0.08, 0.1, 0.3, 0.6] {
                let h = 1e-4 * s;
                let slope = (loss.of(s + h).0 - loss.of(s - h).0) / (2.0 * h);
                assert!((slope - loss.of(s).1).abs() < 1e-6, "{loss:?} at {s}: {slope}, {}", loss.of(s).1);
            }
            assert_eq!(loss.of(0.0), (0.0, 1.0));
        }
    }
}
