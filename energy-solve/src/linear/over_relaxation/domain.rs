use std::sync::RwLock;

use energy_dsl::{Level, Vector3};

use super::RELAXATION;
use crate::linear::domains::{
    Couplings, InverseFactor, Precision, Triangle, Wide, add_products, less_products, of_three, scaled,
    subtract_turned, unscaled,
};
use crate::matrix::pattern::Pattern;

/// Consecutive rows: their part of the scaled matrix, and of the vectors of conjugate gradients.
#[derive(Clone, Debug)]
pub(super) struct Domain<T> {
    pub(super) triangle: Triangle<T>,
    /// Ẽ: what couples it with other domains.
    pub(super) couplings: Couplings<T>,
    residual: Vec<Wide<T>>,
    direction: Vec<Wide<T>>,
    /// t = (I + L̃ᵀ)⁻¹ p.
    back: Vec<Wide<T>>,
    /// (I + L̃)⁻¹ (p + (ω − 2) t + Ẽ t).
    forth: Vec<Wide<T>>,
    solution: Vec<Wide<T>>,
}

impl<T: Precision> Domain<T> {
    /// A domain of the rows of the triangle.
    pub(super) fn new(triangle: Triangle<T>, couplings: Couplings<T>) -> Self {
        let zeros = vec![[T::from_f64(0.0); 4]; triangle.rows.len()];
        Self {
            triangle,
            couplings,
            residual: zeros.clone(),
            direction: zeros.clone(),
            back: zeros.clone(),
            forth: zeros.clone(),
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
        for row in 0..self.forth.len() {
            let [u, v, w] = scaled(&inverses[row], &b[row]);
            self.forth[row] = [u, v, w, 0.0].map(|component| T::from_f64(component * per_scale));
        }
        self.forward::<L>(pattern);
        std::mem::swap(&mut self.residual, &mut self.forth);
        let mut squares = [0.0; 4];
        for vector in &self.residual {
            add_products(&mut squares, vector, vector);
        }
        of_three(squares)
    }

    /// p ← r + β p, t ← (I + L̃ᵀ)⁻¹ p, w ← p + (ω − 2) t. Returns p · t, and shows t on the border.
    #[inline(always)]
    pub(super) fn backward<L: Level>(
        &mut self,
        pattern: &Pattern,
        conjugate: f64,
        border: &RwLock<Vec<Wide<T>>>,
    ) -> f64 {
        let (conjugate, rest) = (T::from_f64(conjugate), T::from_f64(RELAXATION - 2.0));
        let rows = self.triangle.by_rows(pattern);
        let (r, p, t, w) = (&self.residual[..], &mut self.direction[..], &mut self.back[..], &mut self.forth[..]);
        let mut along = [0.0; 4];
        for row in (0..p.len()).rev() {
            let (residual, mut direction) = (r[row], p[row]);
            for lane in 0..4 {
                direction[lane] = direction[lane].mul_add::<L>(conjugate, residual[lane]);
            }
            p[row] = direction;
            let back = less_products::<T, L>(rows.blocks(row), direction, t);
            let mut start = direction;
            for lane in 0..4 {
                start[lane] = back[lane].mul_add::<L>(rest, direction[lane]);
            }
            add_products(&mut along, &direction, &back);
            (t[row], w[row]) = (back, start);
        }
        self.couplings.show(&self.back, border);
        of_three(along)
    }

    /// w ← w + Ẽ t.
    #[inline(always)]
    pub(super) fn couple<L: Level>(&mut self, borders: &[RwLock<Vec<Wide<T>>>]) {
        self.couplings.add_product::<L>(T::from_f64(1.0), borders, &mut self.forth);
    }

    /// w ← (I + L̃)⁻¹ w. Returns p · w.
    #[inline(always)]
    pub(super) fn forward<L: Level>(&mut self, pattern: &Pattern) -> f64 {
        let rows = self.triangle.by_rows(pattern);
        let (p, w) = (&self.direction[..], &mut self.forth[..]);
        let mut along = [0.0; 4];
        for row in 0..w.len() {
            let here = w[row];
            add_products(&mut along, &p[row], &here);
            for (block, column) in rows.blocks(row) {
                subtract_turned::<T, L>(&mut w[column], block, &here);
            }
        }
        of_three(along)
    }

    /// x ← x + α t, r ← r − α (t + w). Returns r · r.
    #[inline(always)]
    pub(super) fn advance<L: Level>(&mut self, step: f64) -> f64 {
        let step = T::from_f64(step);
        let (t, w, x, r) = (&self.back[..], &self.forth[..], &mut self.solution[..], &mut self.residual[..]);
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
        of_three(squares)
    }

    /// C⁻ᵀ x s.
    #[inline(always)]
    pub(super) fn finish(&self, inverses: &[InverseFactor<T>], scale: f64, x: &mut [Vector3<f64>]) {
        for row in 0..x.len() {
            let [u, v, w, _] = self.solution[row].map(|component| Into::<f64>::into(component) * scale);
            x[row] = unscaled(&inverses[row], &[u, v, w]);
        }
    }
}
