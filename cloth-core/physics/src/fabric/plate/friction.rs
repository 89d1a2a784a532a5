//! Plates that yield: friction between yarns.

use super::patch::{IDENTITY, Matrix, transposed_times};
use crate::geometry::dot;

/// The energy of a triangle as a function of its r: U = ½ rᵀ E r + ½ ‖P r − p‖² with a plastic p, and E = 1 − PᵀP.
#[derive(Clone, Copy, Debug)]
pub(super) struct Friction {
    elastic: Matrix,
    yielding: Matrix,
    pub plastic: [f64; 3],
    /// The largest ‖P r − p‖, in √J.
    limit: f64,
}

impl Friction {
    /// All of r yields.
    pub fn of_all(limit: f64) -> Self {
        Self { elastic: [[0.0; 3]; 3], yielding: IDENTITY, plastic: [0.0; 3], limit }
    }

    /// P r yields.
    pub fn of_part([elastic, yielding]: [Matrix; 2], limit: f64) -> Self {
        Self { elastic, yielding, plastic: [0.0; 3], limit }
    }

    /// Returns P r − p.
    #[inline(always)]
    fn rest(&self, r: [f64; 3]) -> [f64; 3] {
        std::array::from_fn(|k| dot(self.yielding[k], r) - self.plastic[k])
    }

    /// Returns U and ∂U/∂r.
    #[inline(always)]
    pub fn response(&self, r: [f64; 3]) -> (f64, [f64; 3]) {
        let (elastic, rest) = (self.elastic.map(|row| dot(row, r)), self.rest(r));
        let of_rest = transposed_times(&self.yielding, &rest);
        (0.5 * (dot(elastic, r) + dot(rest, rest)), std::array::from_fn(|k| elastic[k] + of_rest[k]))
    }

    /// Moves the plastic part until ‖P r − p‖ is at most its limit.
    pub fn flow(&mut self, r: [f64; 3]) {
        let rest = self.rest(r);
        let size = dot(rest, rest).sqrt();
        if size > self.limit {
            (0..3).for_each(|k| self.plastic[k] += (1.0 - self.limit / size) * rest[k]);
        }
    }
}
