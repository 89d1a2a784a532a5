use std::sync::RwLock;

use energy_dsl::{Kernel, Level, Vector3, dispatch};

use super::coarse::Coarse;
use super::smoother::Smoother;
use crate::linear::conjugate_gradients::Steps;
use crate::linear::domains::{
    InverseFactor, PerDomain, Precision, RightHandScale, Wide, add_products, scaled, sum_of_three, unscaled,
};
use crate::matrix::pattern::Pattern;
use crate::matrix::vector::widened;
use crate::threads::SpinBarrier;

/// A domain's part of the vectors of conjugate gradients.
#[derive(Clone, Debug)]
pub(super) struct Vectors<T> {
    /// r and s = (I + L̃)⁻¹ r.
    residual: Vec<Wide<T>>,
    smoothed: Vec<Wide<T>>,
    /// p, q = A p and u = (I + L̃)⁻¹ q.
    direction: Vec<Wide<T>>,
    product: Vec<Wide<T>>,
    forward_product: Vec<Wide<T>>,
    solution: Vec<Wide<T>>,
    /// The coarse correction e; then c − e.
    change: Vec<Wide<T>>,
    /// The residual after s; then c, with z = M⁻¹ r = s + c.
    back: Vec<Wide<T>>,
}

impl<T: Precision> Vectors<T> {
    pub(super) fn new(rows: usize) -> Self {
        let zeros = vec![[T::from_f64(0.0); 4]; rows];
        Self {
            residual: zeros.clone(),
            smoothed: zeros.clone(),
            direction: zeros.clone(),
            product: zeros.clone(),
            forward_product: zeros.clone(),
            solution: zeros.clone(),
            change: zeros.clone(),
            back: zeros,
        }
    }
}

/// Data shared by all threads that solve a system.
pub(super) struct Common<'a, T> {
    pub(super) pattern: &'a Pattern,
    pub(super) smoothers: &'a [Smoother<T>],
    pub(super) coarse: Option<RwLock<&'a mut Coarse<T>>>,
    /// The border rows of s, then of e, for each domain.
    borders: Vec<RwLock<Vec<Wide<T>>>>,
    /// The border rows of c − e for each domain, which are published while e is still read.
    changes: Vec<RwLock<Vec<Wide<T>>>>,
    /// For each domain, its first aggregate and its part of Pᵀ r.
    restricted: Vec<(usize, RwLock<Vec<Wide<T>>>)>,
    right_hand_scale: RightHandScale,
    /// s · s, r · z and p · q. All threads read each number before any of them reaches its next update.
    square: PerDomain,
    along: PerDomain,
    curvature: PerDomain,
}

impl<'a, T: Precision> Common<'a, T> {
    pub(super) fn new(pattern: &'a Pattern, smoothers: &'a [Smoother<T>], coarse: Option<&'a mut Coarse<T>>) -> Self {
        let zeros = |length: usize| RwLock::new(vec![[T::from_f64(0.0); 4]; length]);
        let span = |smoother: &Smoother<T>| match &coarse {
            Some(coarse) => coarse.interpolation.span(smoother.triangle.rows.clone()),
            None => 0..0,
        };
        let spans = smoothers.iter().map(span);
        let borders = || smoothers.iter().map(|smoother| zeros(smoother.couplings.border().len())).collect();
        let sum = || PerDomain::new(smoothers.len());
        Self {
            pattern,
            smoothers,
            borders: borders(),
            changes: borders(),
            restricted: spans.map(|span| (span.start, zeros(span.len()))).collect(),
            coarse: coarse.map(RwLock::new),
            right_hand_scale: RightHandScale::new(smoothers.len()),
            square: sum(),
            along: sum(),
            curvature: sum(),
        }
    }

    /// Sums the parts of Pᵀ r in the order of the domains, solves on the coarse level, and publishes the correction on
    /// all borders.
    fn correct(&self) {
        let Some(coarse) = &self.coarse else { return };
        let mut coarse = coarse.write().expect("no other thread panicked");
        coarse.restricted.fill([T::from_f64(0.0); 4]);
        for (first, part) in &self.restricted {
            for (sum, part) in
                coarse.restricted[*first..].iter_mut().zip(&*part.read().expect("no other thread panicked"))
            {
                (0..4).for_each(|lane| sum[lane] = sum[lane] + part[lane]);
            }
        }
        coarse.correct();
        for (smoother, border) in self.smoothers.iter().zip(&self.borders) {
            dispatch(PublishCorrection {
                smoother,
                coarse: &coarse,
                border: &mut border.write().expect("no other thread panicked"),
            });
        }
    }
}

/// A domain and its rows of b and x.
pub(super) struct Part<'a, T> {
    pub(super) number: usize,
    pub(super) vectors: &'a mut Vectors<T>,
    pub(super) inverses: &'a [InverseFactor<T>],
    pub(super) b: &'a [Vector3<f64>],
    pub(super) x: &'a mut [Vector3<f64>],
}

/// The steps of conjugate gradients in one of the threads. [`super::Multigrid`] documents the formulas.
pub(super) struct Gradients<'a, 'c, T> {
    pub(super) parts: Vec<Part<'a, T>>,
    pub(super) common: &'a Common<'c, T>,
    pub(super) barrier: &'a SpinBarrier,
}

impl<T: Precision> Steps for Gradients<'_, '_, T> {
    fn start(&mut self) -> (f64, f64) {
        let Self { parts, common, barrier } = self;
        let Common { right_hand_scale, square, .. } = common;
        for Part { number, inverses, b, .. } in &*parts {
            right_hand_scale.note(*number, inverses, b);
        }
        barrier.wait();
        let scale = right_hand_scale.combined();
        for part in parts {
            square.put(part.number, dispatch(Start { part, common, scale }));
        }
        barrier.wait();
        (scale, square.sum())
    }

    fn precondition(&mut self, _: f64) -> f64 {
        let Self { parts, common, barrier } = self;
        for part in &mut *parts {
            dispatch(Restriction { part, common });
        }
        barrier.wait();
        if parts.iter().any(|part| part.number == 0) {
            common.correct();
        }
        barrier.wait();
        for part in parts {
            common.along.put(part.number, dispatch(Correction { part, common }));
        }
        barrier.wait();
        common.along.sum()
    }

    fn conjugate(&mut self, ratio: f64) -> f64 {
        let Self { parts, common, barrier } = self;
        for part in parts {
            common.curvature.put(part.number, dispatch(Conjugation { part, common, ratio }));
        }
        barrier.wait();
        common.curvature.sum()
    }

    fn advance(&mut self, step: f64) -> f64 {
        let Self { parts, common, barrier } = self;
        for part in parts {
            common.square.put(part.number, dispatch(Advance { part, common, step }));
        }
        barrier.wait();
        common.square.sum()
    }

    fn finish(&mut self, unit: f64) {
        for Part { vectors, inverses, x, .. } in &mut self.parts {
            for row in 0..x.len() {
                let [u, v, w, _] = vectors.solution[row].map(|component| Into::<f64>::into(component) * unit);
                x[row] = unscaled(&inverses[row], &[u, v, w]);
            }
        }
    }
}

/// r ← C⁻¹ b/s, s ← (I + L̃)⁻¹ r, other vectors ← 0. Returns s · s.
struct Start<'a, 'b, 'c, T> {
    part: &'a mut Part<'b, T>,
    common: &'a Common<'c, T>,
    scale: f64,
}

impl<T: Precision> Kernel for Start<'_, '_, '_, T> {
    type Output = f64;

    #[inline(always)]
    fn run<L: Level>(self) -> f64 {
        let Part { number, vectors, inverses, b, .. } = self.part;
        let smoother = &self.common.smoothers[*number];
        let Vectors { residual, smoothed, direction, product, forward_product, solution, .. } = &mut **vectors;
        for zeros in [direction, product, forward_product, solution] {
            zeros.fill([T::from_f64(0.0); 4]);
        }
        for row in 0..residual.len() {
            let [u, v, w] = scaled(&inverses[row], &b[row]);
            residual[row] = widened([u / self.scale, v / self.scale, w / self.scale]);
        }
        smoothed.copy_from_slice(residual);
        smoother.forward::<L>(self.common.pattern, smoothed);
        smoother.couplings.publish(smoothed, &self.common.borders[*number]);
        let mut squares = [0.0; 4];
        for vector in &*smoothed {
            add_products(&mut squares, vector, vector);
        }
        sum_of_three(squares)
    }
}

/// Computes the residual −(L̃ᵀ + Ẽ) s and the domain's part of Pᵀ times it.
struct Restriction<'a, 'b, 'c, T> {
    part: &'a mut Part<'b, T>,
    common: &'a Common<'c, T>,
}

impl<T: Precision> Kernel for Restriction<'_, '_, '_, T> {
    type Output = ();

    #[inline(always)]
    fn run<L: Level>(self) {
        let Common { pattern, smoothers, borders, coarse, restricted, .. } = self.common;
        let Part { number, vectors, .. } = self.part;
        let smoother = &smoothers[*number];
        let Vectors { smoothed, back, .. } = &mut **vectors;
        smoother.minus_upper::<L>(pattern, smoothed, back);
        smoother.add_coupled::<L>(-1.0, borders, smoothed, back);
        let Some(coarse) = coarse else { return };
        let coarse = coarse.read().expect("no other thread panicked");
        let (first, sums) = &restricted[*number];
        let mut sums = sums.write().expect("no other thread panicked");
        sums.fill([T::from_f64(0.0); 4]);
        let before = smoother.triangle.rows.start;
        for row in 0..back.len() {
            let unscaled = smoother.unscaled(row, &back[row]);
            coarse.interpolation.add_restricted::<L>(before + row, &unscaled, *first, &mut sums);
        }
    }
}

/// Publishes the coarse correction on the border of a domain.
struct PublishCorrection<'a, T> {
    smoother: &'a Smoother<T>,
    coarse: &'a Coarse<T>,
    border: &'a mut [Wide<T>],
}

impl<T: Precision> Kernel for PublishCorrection<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<L: Level>(self) {
        let Self { smoother, coarse, border } = self;
        for (number, &local) in smoother.couplings.border().iter().enumerate() {
            let row = smoother.triangle.rows.start + local as usize;
            let prolonged = coarse.interpolation.prolonged::<L>(row, &coarse.correction);
            border[number] = smoother.scaled(local as usize, &prolonged);
        }
    }
}

/// c = (I + L̃ᵀ)⁻¹ (back − (L̃ + Ẽ) e) and z = s + c; then e is replaced by c − e. Returns r · z.
struct Correction<'a, 'b, 'c, T> {
    part: &'a mut Part<'b, T>,
    common: &'a Common<'c, T>,
}

impl<T: Precision> Kernel for Correction<'_, '_, '_, T> {
    type Output = f64;

    #[inline(always)]
    fn run<L: Level>(self) -> f64 {
        let Common { pattern, smoothers, borders, coarse, .. } = self.common;
        let Part { number, vectors, .. } = self.part;
        let smoother = &smoothers[*number];
        let Vectors { residual, smoothed, change, back, .. } = &mut **vectors;
        let before = smoother.triangle.rows.start;
        match coarse {
            Some(coarse) => {
                let coarse = coarse.read().expect("no other thread panicked");
                for row in 0..change.len() {
                    let prolonged = coarse.interpolation.prolonged::<L>(before + row, &coarse.correction);
                    change[row] = smoother.scaled(row, &prolonged);
                }
            }
            None => change.fill([T::from_f64(0.0); 4]),
        }
        smoother.subtract_lower::<L>(pattern, change, back);
        smoother.add_coupled::<L>(-1.0, borders, change, back);
        smoother.backward::<L>(pattern, back);
        let mut along = [0.0; 4];
        for row in 0..back.len() {
            let (c, mut z) = (back[row], smoothed[row]);
            for lane in 0..4 {
                z[lane] = z[lane] + c[lane];
                change[row][lane] = c[lane] - change[row][lane];
            }
            add_products(&mut along, &residual[row], &z);
        }
        smoother.couplings.publish(change, &self.common.changes[*number]);
        sum_of_three(along)
    }
}

/// p ← z + β p, q ← A z + β q with A z = r + (L̃ + Ẽ) (c − e), and u ← (I + L̃)⁻¹ q. Returns p · q.
struct Conjugation<'a, 'b, 'c, T> {
    part: &'a mut Part<'b, T>,
    common: &'a Common<'c, T>,
    ratio: f64,
}

impl<T: Precision> Kernel for Conjugation<'_, '_, '_, T> {
    type Output = f64;

    #[inline(always)]
    fn run<L: Level>(self) -> f64 {
        let Common { pattern, smoothers, changes, .. } = self.common;
        let Part { number, vectors, .. } = self.part;
        let smoother = &smoothers[*number];
        let Vectors { residual, smoothed, direction, product, forward_product, change, back, .. } = &mut **vectors;
        let ratio = T::from_f64(self.ratio);
        for row in 0..product.len() {
            let (mut p, mut q) = (direction[row], product[row]);
            for lane in 0..4 {
                p[lane] = p[lane].mul_add::<L>(ratio, smoothed[row][lane] + back[row][lane]);
                q[lane] = q[lane].mul_add::<L>(ratio, residual[row][lane]);
            }
            (direction[row], product[row]) = (p, q);
        }
        smoother.add_coupled::<L>(1.0, changes, change, product);
        smoother.add_lower_and_forward::<L>(pattern, change, product, forward_product);
        let mut curvature = [0.0; 4];
        for row in 0..product.len() {
            add_products(&mut curvature, &direction[row], &product[row]);
        }
        sum_of_three(curvature)
    }
}

/// x ← x + α p, r ← r − α q, s ← s − α u. Returns s · s.
struct Advance<'a, 'b, 'c, T> {
    part: &'a mut Part<'b, T>,
    common: &'a Common<'c, T>,
    step: f64,
}

impl<T: Precision> Kernel for Advance<'_, '_, '_, T> {
    type Output = f64;

    #[inline(always)]
    fn run<L: Level>(self) -> f64 {
        let Part { number, vectors, .. } = self.part;
        let Vectors { residual, smoothed, direction, product, forward_product, solution, .. } = &mut **vectors;
        let step = T::from_f64(self.step);
        let mut squares = [0.0; 4];
        for row in 0..residual.len() {
            let (mut x, mut r, mut s) = (solution[row], residual[row], smoothed[row]);
            for lane in 0..4 {
                x[lane] = direction[row][lane].mul_add::<L>(step, x[lane]);
                r[lane] = product[row][lane].mul_add::<L>(-step, r[lane]);
                s[lane] = forward_product[row][lane].mul_add::<L>(-step, s[lane]);
            }
            (solution[row], residual[row], smoothed[row]) = (x, r, s);
            add_products(&mut squares, &s, &s);
        }
        self.common.smoothers[*number].couplings.publish(smoothed, &self.common.borders[*number]);
        sum_of_three(squares)
    }
}
