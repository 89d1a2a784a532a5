use std::sync::RwLock;

use energy_dsl::{Level, Vector3};

use crate::linear::domains::{
    Couplings, InverseFactor, Precision, Triangle, Wide, add_products, minus_products, scaled, subtract_transposed,
    sum_of_three, unscaled,
};
use crate::matrix::pattern::Pattern;

/// A domain: its part of the scaled matrix and of the vectors of conjugate gradients.
#[derive(Clone, Debug)]
pub(super) struct Domain<T> {
    pub(super) triangle: Triangle<T>,
    /// Ẽ, the couplings with other domains.
    pub(super) couplings: Couplings<T>,
    residual: Vec<Wide<T>>,
    direction: Vec<Wide<T>>,
    /// t = (I + L̃ᵀ)⁻¹ p.
    backward_solution: Vec<Wide<T>>,
    /// w = (I + L̃)⁻¹ (p + (ω − 2) t + Ẽ t).
    forward_solution: Vec<Wide<T>>,
    solution: Vec<Wide<T>>,
}

impl<T: Precision> Domain<T> {
    /// Creates the domain of the triangle's rows.
    pub(super) fn new(triangle: Triangle<T>, couplings: Couplings<T>) -> Self {
        let zeros = vec![[T::from_f64(0.0); 4]; triangle.rows.len()];
        Self {
            triangle,
            couplings,
            residual: zeros.clone(),
            direction: zeros.clone(),
            backward_solution: zeros.clone(),
            forward_solution: zeros.clone(),
            solution: zeros,
        }
    }

    /// r ← (I + L̃)⁻¹ C⁻¹ b/s, p ← 0, x ← 0. Returns r · r.
    #[inline(always)]
    pub(super) fn start<L: Level>(
        &mut self,
        pattern: &Pattern,
        inverses: &[InverseFactor<T>],
        b: &[Vector3<f64>],
        scale: f64,
    ) -> f64 {
        let zero = [T::from_f64(0.0); 4];
        self.solution.fill(zero);
        self.direction.fill(zero);
        let per_scale = 1.0 / scale;
        for row in 0..self.forward_solution.len() {
            let [u, v, w] = scaled(&inverses[row], &b[row]);
            self.forward_solution[row] = [u, v, w, 0.0].map(|component| T::from_f64(component * per_scale));
        }
        self.forward::<L>(pattern);
        std::mem::swap(&mut self.residual, &mut self.forward_solution);
        let mut squares = [0.0; 4];
        for vector in &self.residual {
            add_products(&mut squares, vector, vector);
        }
        sum_of_three(squares)
    }

    /// p ← r + β p, t ← (I + L̃ᵀ)⁻¹ p, w ← p + (ω − 2) t. Publishes t on the border and returns p · t.
    #[inline(always)]
    pub(super) fn backward<L: Level>(
        &mut self,
        pattern: &Pattern,
        relaxation: f64,
        conjugate: f64,
        border: &RwLock<Vec<Wide<T>>>,
    ) -> f64 {
        let (conjugate, rest) = (T::from_f64(conjugate), T::from_f64(relaxation - 2.0));
        let rows = self.triangle.by_rows(pattern);
        let (r, p, t, w) = (
            &self.residual[..],
            &mut self.direction[..],
            &mut self.backward_solution[..],
            &mut self.forward_solution[..],
        );
        let mut along = [0.0; 4];
        for row in (0..p.len()).rev() {
            let (residual, mut direction) = (r[row], p[row]);
            for lane in 0..4 {
                direction[lane] = direction[lane].mul_add::<L>(conjugate, residual[lane]);
            }
            p[row] = direction;
            let back = minus_products::<T, L>(rows.blocks(row), direction, t);
            let mut start = direction;
            for lane in 0..4 {
                start[lane] = back[lane].mul_add::<L>(rest, direction[lane]);
            }
            add_products(&mut along, &direction, &back);
            (t[row], w[row]) = (back, start);
        }
        self.couplings.publish(&self.backward_solution, border);
        sum_of_three(along)
    }

    /// w ← w + Ẽ t.
    #[inline(always)]
    pub(super) fn couple<L: Level>(&mut self, borders: &[RwLock<Vec<Wide<T>>>]) {
        self.couplings.add_product::<L>(T::from_f64(1.0), borders, &mut self.forward_solution);
    }

    /// w ← (I + L̃)⁻¹ w. Returns p · w.
    #[inline(always)]
    pub(super) fn forward<L: Level>(&mut self, pattern: &Pattern) -> f64 {
        let rows = self.triangle.by_rows(pattern);
        let (p, w) = (&self.direction[..], &mut self.forward_solution[..]);
        let mut along = [0.0; 4];
        for row in 0..w.len() {
            let here = w[row];
            add_products(&mut along, &p[row], &here);
            for (block, column) in rows.blocks(row) {
                subtract_transposed::<T, L>(&mut w[column], block, &here);
            }
        }
        sum_of_three(along)
    }

    /// x ← x + α t, r ← r − α (t + w). Returns r · r.
    #[inline(always)]
    pub(super) fn advance<L: Level>(&mut self, step: f64) -> f64 {
        let step = T::from_f64(step);
        let (t, w, x, r) =
            (&self.backward_solution[..], &self.forward_solution[..], &mut self.solution[..], &mut self.residual[..]);
        let mut squares = [0.0; 4];
        for row in 0..r.len() {
            let (t, w, mut solution, mut rest) = (t[row], w[row], x[row], r[row]);
            for lane in 0..4 {
                solution[lane] = t[lane].mul_add::<L>(step, solution[lane]);
            }
            for lane in 0..4 {
                rest[lane] = (t[lane] + w[lane]).mul_add::<L>(-step, rest[lane]);
            }
            add_products(&mut squares, &rest, &rest);
            (x[row], r[row]) = (solution, rest);
        }
        sum_of_three(squares)
    }

    /// Writes C⁻ᵀ x s.
    #[inline(always)]
    pub(super) fn finish(&self, inverses: &[InverseFactor<T>], scale: f64, x: &mut [Vector3<f64>]) {
        for row in 0..x.len() {
            let [u, v, w, _] = self.solution[row].map(|component| Into::<f64>::into(component) * scale);
            x[row] = unscaled(&inverses[row], &[u, v, w]);
        }
    }
}
