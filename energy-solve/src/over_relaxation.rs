use std::sync::Arc;

use energy_dsl::{Block, Kernel, Level, Number, Real, Vector3, dispatch};

use crate::matrix::BlockMatrix;
use crate::pattern::{Pattern, Storage};
use crate::preconditioner::SingularBlock;
use crate::solve::{SolveOptions, SolveReport, StopReason};

/// What numbers are stored and computed in: `f32` or `f64`.
pub trait Precision: Real + Into<f64> {}

impl Precision for f32 {}
impl Precision for f64 {}

/// ω. From 1.4 to 1.8 the iterations on sheets of cloth, soft and stiff, fine and coarse, differ by a fifth.
const RELAXATION: f64 = 1.6;

/// Conjugate gradients with the preconditioner of symmetric successive over-relaxation, at the price of conjugate gradients without:
/// Eisenstat's method (SIAM J. Sci. Stat. Comput. 2, 1981).
///
/// With A = D + L + Lᵀ, D its diagonal blocks and C Cᵀ = D/ω, the matrix is scaled to C⁻¹ A C⁻ᵀ = ω I + L̃ + L̃ᵀ. What conjugate
/// gradients then multiply by,
///
/// (I + L̃)⁻¹ (ω I + L̃ + L̃ᵀ) (I + L̃ᵀ)⁻¹ p = t + (I + L̃)⁻¹ (p + (ω − 2) t),  t = (I + L̃ᵀ)⁻¹ p,
///
/// takes two triangular solutions and no product with A. There is nothing to factor but the diagonal blocks, and the blocks above
/// the diagonal are all that is read.
///
/// Numbers are stored, and computed with, in `T`: `f32` halves what is read from memory, which is what the time goes into, and serves
/// where a solution is wanted to a part in a hundred, as by Newton's method; products of vectors are summed up in doubles.
///
/// Made for matrices that change and patterns that do not: [`OverRelaxation::scale`] reuses everything.
#[derive(Clone, Debug)]
pub struct OverRelaxation<T> {
    pattern: Arc<Pattern>,
    /// C⁻¹ of each row, lower triangular.
    inverses: Vec<Block<f64>>,
    /// The blocks of L̃ᵀ by rows, each column by column, and row by row.
    columns: Vec<T>,
    rows: Vec<T>,
    vectors: Vectors<T>,
}

/// A vector of three in a register of four, with a last component that means nothing.
type Wide<T> = [T; 4];

/// What conjugate gradients need for each row.
#[derive(Clone, Debug, Default)]
struct Vectors<T> {
    residual: Vec<Wide<T>>,
    direction: Vec<Wide<T>>,
    /// (I + L̃ᵀ)⁻¹ p.
    back: Vec<Wide<T>>,
    /// (I + L̃)⁻¹ (p + (ω − 2) t).
    forth: Vec<Wide<T>>,
    solution: Vec<Wide<T>>,
}

/// Numbers after the last block, so that four can be read where its last column begins.
const SLACK: usize = 1;

impl<T: Precision> OverRelaxation<T> {
    /// Prepares for matrices of a pattern.
    ///
    /// # Panics
    /// When it is not the upper triangle of a symmetric one.
    #[must_use]
    pub fn new(pattern: &Arc<Pattern>) -> Self {
        assert_eq!(pattern.storage(), Storage::Upper, "only symmetric matrices are solved by conjugate gradients");
        let rows = pattern.rows();
        let numbers = vec![T::from_f64(0.0); 9 * (pattern.blocks() - rows) + SLACK];
        let zeros = vec![[T::from_f64(0.0); 4]; rows];
        let vectors = Vectors {
            residual: zeros.clone(),
            direction: zeros.clone(),
            back: zeros.clone(),
            forth: zeros.clone(),
            solution: zeros,
        };
        let inverses = vec![[[0.0; 3]; 3]; rows];
        Self { pattern: Arc::clone(pattern), inverses, columns: numbers.clone(), rows: numbers, vectors }
    }

    /// Takes over a matrix of the pattern, scaled.
    ///
    /// # Errors
    /// When a diagonal block is not positive definite: then the matrix is not.
    ///
    /// # Panics
    /// When the matrix has another pattern.
    pub fn scale(&mut self, matrix: &BlockMatrix) -> Result<(), SingularBlock> {
        assert!(Arc::ptr_eq(&self.pattern, matrix.pattern()), "the matrix has another pattern");
        dispatch(Scaling { of: self, matrix }).map_err(|row| SingularBlock { row })
    }

    /// Solves A x = b from x = 0. Residuals are measured as √(rᵀ M⁻¹ r), M = (D/ω + L) (D/ω)⁻¹ (D/ω + Lᵀ).
    pub fn solve(&mut self, b: &[Vector3<f64>], x: &mut [Vector3<f64>], options: &SolveOptions) -> SolveReport {
        dispatch(Gradients { of: self, b, x, options })
    }
}

/// The scaling of a matrix. Fails with the row whose diagonal block is not positive definite.
struct Scaling<'a, T> {
    of: &'a mut OverRelaxation<T>,
    matrix: &'a BlockMatrix,
}

impl<T: Precision> Kernel for Scaling<'_, T> {
    type Output = Result<(), usize>;

    #[inline(always)]
    fn run<L: Level>(self) -> Self::Output {
        let OverRelaxation { pattern, inverses, columns, rows, .. } = self.of;
        for row in 0..pattern.rows() {
            inverses[row] = inverse_factor(self.matrix.diagonal(row)).ok_or(row)?;
        }
        let values = self.matrix.values();
        for row in 0..pattern.rows() {
            for place in pattern.above(row) {
                let other = &inverses[pattern.columns()[place] as usize];
                let scaled = scaled_block::<L>(&inverses[row], &values[place], other);
                // Before it there are as many blocks on the diagonal as rows, and its own.
                let first = 9 * (place - row - 1);
                for i in 0..3 {
                    for j in 0..3 {
                        let entry = T::from_f64(scaled[i][j]);
                        rows[first + 3 * i + j] = entry;
                        columns[first + 3 * j + i] = entry;
                    }
                }
            }
        }
        Ok(())
    }
}

/// C⁻¹ with C Cᵀ = D/ω, C lower triangular; `None` where D is not positive definite.
#[inline(always)]
fn inverse_factor(diagonal: &Block<f64>) -> Option<Block<f64>> {
    let [[a, ..], [b, d, _], [c, e, f]] = diagonal.map(|row| row.map(|entry| entry / RELAXATION));
    let first = a.sqrt();
    let (second_first, third_first) = (b / first, c / first);
    let second = (d - second_first * second_first).sqrt();
    let third_second = (e - third_first * second_first) / second;
    let third = (f - third_first * third_first - third_second * third_second).sqrt();
    // A negative pivot has no root, a vanishing one no reciprocal.
    let [x, y, z] = [1.0 / first, 1.0 / second, 1.0 / third];
    let yx = -second_first * x * y;
    let zy = -third_second * y * z;
    let zx = -(third_first * x + third_second * yx) * z;
    let finite = x.is_finite() && y.is_finite() && z.is_finite() && zx.is_finite();
    (finite && x > 0.0 && y > 0.0 && z > 0.0).then_some([[x, 0.0, 0.0], [yx, y, 0.0], [zx, zy, z]])
}

/// P B Qᵀ for lower triangular P and Q.
#[inline(always)]
fn scaled_block<L: Level>(p: &Block<f64>, b: &Block<f64>, q: &Block<f64>) -> Block<f64> {
    let mut left = [[0.0; 3]; 3];
    let mut scaled = [[0.0; 3]; 3];
    for i in 0..3 {
        for k in 0..=i {
            for j in 0..3 {
                left[i][j] = Number::mul_add::<L>(p[i][k], b[k][j], left[i][j]);
            }
        }
    }
    for j in 0..3 {
        for k in 0..=j {
            for i in 0..3 {
                scaled[i][j] = Number::mul_add::<L>(left[i][k], q[j][k], scaled[i][j]);
            }
        }
    }
    scaled
}

/// The solution of A x = b.
struct Gradients<'a, T> {
    of: &'a mut OverRelaxation<T>,
    b: &'a [Vector3<f64>],
    x: &'a mut [Vector3<f64>],
    options: &'a SolveOptions,
}

impl<T: Precision> Kernel for Gradients<'_, T> {
    type Output = SolveReport;

    #[inline(always)]
    fn run<L: Level>(self) -> SolveReport {
        let OverRelaxation { pattern, inverses, columns, rows, vectors } = self.of;
        let Vectors { residual, direction, back, forth, solution } = vectors;
        let sweeps = Sweeps { pattern, columns, rows };
        // Of the order of one, whatever the unit: single precision has less range than doubles.
        let scaled = start(inverses, self.b, residual);
        solution.fill([T::from_f64(0.0); 4]);
        sweeps.forward::<L>(residual);
        let mut rho = square(residual);
        let initial = rho;
        let target = self.options.relative_tolerance.powi(2) * initial;
        let mut conjugate = 0.0;
        let mut iterations = 0;
        let stopped = loop {
            if !rho.is_finite() || !scaled.is_finite() {
                break StopReason::NonFinite;
            }
            if rho <= target {
                break StopReason::Converged;
            }
            if iterations == self.options.iteration_limit {
                break StopReason::IterationLimit;
            }
            let along = sweeps.backward::<L>(residual, conjugate, direction, back, forth);
            sweeps.forward::<L>(forth);
            let curvature = along + product(direction, forth);
            if curvature <= 0.0 {
                break StopReason::IndefiniteCurvature;
            }
            let previous = rho;
            rho = advance::<T, L>(rho / curvature, back, forth, solution, residual);
            conjugate = rho / previous;
            iterations += 1;
        };
        for row in 0..self.x.len() {
            let [u, v, w, _] = solution[row].map(|component| Into::<f64>::into(component) * scaled);
            let [[a, ..], [b, c, _], [d, e, f]] = inverses[row];
            self.x[row] = [a * u + b * v + d * w, c * v + e * w, f * w];
        }
        let [initial_residual, final_residual] = [initial, rho].map(|square| square.sqrt() * scaled);
        SolveReport { iterations, initial_residual, final_residual, stopped }
    }
}

/// r ← C⁻¹ b over its largest component, which is returned (1 if all are zero).
#[inline(always)]
fn start<T: Precision>(inverses: &[Block<f64>], b: &[Vector3<f64>], r: &mut [Wide<T>]) -> f64 {
    let scaled = |row: usize| {
        let ([[a, ..], [d, e, _], [f, g, h]], [u, v, w]) = (inverses[row], b[row]);
        [a * u, d * u + e * v, f * u + g * v + h * w]
    };
    let mut largest = 0.0_f64;
    let mut sum = 0.0;
    for row in 0..r.len() {
        for component in scaled(row) {
            largest = largest.max(component.abs());
            // A NaN is not the larger of two numbers, but it spoils a sum.
            sum += component;
        }
    }
    let scale = if largest > 0.0 { largest } else { 1.0 } + 0.0 * sum;
    for row in 0..r.len() {
        let [u, v, w] = scaled(row).map(|component| T::from_f64(component / scale));
        r[row] = [u, v, w, T::from_f64(0.0)];
    }
    scale
}

/// Solutions with the triangles of the scaled matrix.
struct Sweeps<'a, T> {
    pattern: &'a Pattern,
    columns: &'a [T],
    rows: &'a [T],
}

impl<T: Precision> Sweeps<'_, T> {
    /// p ← r + β p, t ← (I + L̃ᵀ)⁻¹ p, w ← p + (ω − 2) t. Returns p · t.
    #[inline(always)]
    fn backward<L: Level>(
        &self,
        r: &[Wide<T>],
        conjugate: f64,
        p: &mut [Wide<T>],
        t: &mut [Wide<T>],
        w: &mut [Wide<T>],
    ) -> f64 {
        let (conjugate, rest) = (T::from_f64(conjugate), T::from_f64(RELAXATION - 2.0));
        let mut along = [0.0; 4];
        for row in (0..p.len()).rev() {
            let mut direction = [T::from_f64(0.0); 4];
            for lane in 0..4 {
                direction[lane] = p[row][lane].mul_add::<L>(conjugate, r[row][lane]);
            }
            p[row] = direction;
            let mut sums = [direction, [T::from_f64(0.0); 4], [T::from_f64(0.0); 4]];
            for place in self.pattern.above(row) {
                let block = &self.columns[9 * (place - row - 1)..][..9 + SLACK];
                subtract_product::<T, L>(&mut sums, block, &t[self.pattern.columns()[place] as usize]);
            }
            let mut back = [T::from_f64(0.0); 4];
            let mut start = [T::from_f64(0.0); 4];
            for lane in 0..4 {
                back[lane] = sums[0][lane] + (sums[1][lane] + sums[2][lane]);
                start[lane] = back[lane].mul_add::<L>(rest, direction[lane]);
                along[lane] += in_doubles(direction[lane], back[lane]);
            }
            (t[row], w[row]) = (back, start);
        }
        along[0] + along[1] + along[2]
    }

    /// w ← (I + L̃)⁻¹ w.
    #[inline(always)]
    fn forward<L: Level>(&self, w: &mut [Wide<T>]) {
        for row in 0..w.len() {
            let here = w[row];
            for place in self.pattern.above(row) {
                let block = &self.rows[9 * (place - row - 1)..][..9 + SLACK];
                let vector = &mut w[self.pattern.columns()[place] as usize];
                let mut sums = [*vector, [T::from_f64(0.0); 4], [T::from_f64(0.0); 4]];
                subtract_product::<T, L>(&mut sums, block, &here);
                for lane in 0..4 {
                    vector[lane] = sums[0][lane] + (sums[1][lane] + sums[2][lane]);
                }
            }
        }
    }
}

/// Subtracts B v from the sum of three, B stored column by column (and followed by one more number).
#[inline(always)]
fn subtract_product<T: Precision, L: Level>(sums: &mut [Wide<T>; 3], block: &[T], v: &Wide<T>) {
    for column in 0..3 {
        let factor = -v[column];
        for lane in 0..4 {
            sums[column][lane] = block[3 * column + lane].mul_add::<L>(factor, sums[column][lane]);
        }
    }
}

/// x ← x + α t, r ← r − α (t + s). Returns r · r.
#[inline(always)]
fn advance<T: Precision, L: Level>(
    step: f64,
    t: &[Wide<T>],
    s: &[Wide<T>],
    x: &mut [Wide<T>],
    r: &mut [Wide<T>],
) -> f64 {
    let step = T::from_f64(step);
    let mut square = [0.0; 4];
    for row in 0..r.len() {
        for lane in 0..4 {
            x[row][lane] = t[row][lane].mul_add::<L>(step, x[row][lane]);
            let rest = (t[row][lane] + s[row][lane]).mul_add::<L>(-step, r[row][lane]);
            r[row][lane] = rest;
            square[lane] += in_doubles(rest, rest);
        }
    }
    square[0] + square[1] + square[2]
}

/// a · b, of the first three lanes.
#[inline(always)]
fn product<T: Precision>(a: &[Wide<T>], b: &[Wide<T>]) -> f64 {
    let mut sums = [0.0; 4];
    for row in 0..a.len() {
        for lane in 0..4 {
            sums[lane] += in_doubles(a[row][lane], b[row][lane]);
        }
    }
    sums[0] + sums[1] + sums[2]
}

#[inline(always)]
fn square<T: Precision>(a: &[Wide<T>]) -> f64 {
    product(a, a)
}

/// A product, in doubles.
#[inline(always)]
fn in_doubles<T: Precision>(a: T, b: T) -> f64 {
    let (a, b): (f64, f64) = (a.into(), b.into());
    a * b
}
