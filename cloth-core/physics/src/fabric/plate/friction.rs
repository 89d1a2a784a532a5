//! Plates that yield: friction between yarns.

use super::patch::{IDENTITY, Matrix};
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
        let ([a, b, c], [x, y, z]) = (self.yielding, self.plastic);
        [dot(a, r) - x, dot(b, r) - y, dot(c, r) - z]
    }

    /// Returns U and ∂U/∂r.
    #[inline(always)]
    pub fn response(&self, r: [f64; 3]) -> (f64, [f64; 3]) {
        let [a, b, c] = self.elastic;
        let (mut stress, rest) = ([dot(a, r), dot(b, r), dot(c, r)], self.rest(r));
        let energy = 0.5 * (dot(stress, r) + dot(rest, rest));
        for k in 0..3 {
            for i in 0..3 {
                stress[k] += self.yielding[i][k] * rest[i];
            }
        }
        (energy, stress)
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
