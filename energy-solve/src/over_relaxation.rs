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
        let (by_columns, by_rows) = (columns.as_chunks_mut::<9>().0, rows.as_chunks_mut::<9>().0);
        for row in 0..pattern.rows() {
            let own = inverses[row];
            for place in pattern.above(row) {
                let other = &inverses[pattern.columns()[place] as usize];
                let block = scaled_block::<L>(&own, &values[place], other);
                // Before it there are as many blocks on the diagonal as rows, and its own.
                let (by_columns, by_rows) = (&mut by_columns[place - row - 1], &mut by_rows[place - row - 1]);
                for i in 0..3 {
                    for j in 0..3 {
                        let entry = T::from_f64(block[i][j]);
                        by_rows[3 * i + j] = entry;
                        by_columns[3 * j + i] = entry;
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
        let scale = start(inverses, self.b, residual);
        solution.fill([T::from_f64(0.0); 4]);
        direction.fill([T::from_f64(0.0); 4]);
        sweeps.forward::<L>(residual, direction);
        let mut rho = square(residual);
        let initial = rho;
        let target = self.options.relative_tolerance.powi(2) * initial;
        let mut conjugate = 0.0;
        let mut iterations = 0;
        let stopped = loop {
            if !rho.is_finite() || !scale.is_finite() {
                break StopReason::NonFinite;
            }
            if rho <= target {
                break StopReason::Converged;
            }
            if iterations == self.options.iteration_limit {
                break StopReason::IterationLimit;
            }
            let curvature = sweeps.backward::<L>(residual, conjugate, direction, back, forth)
                + sweeps.forward::<L>(forth, direction);
            if curvature <= 0.0 {
                break StopReason::IndefiniteCurvature;
            }
            let previous = rho;
            rho = advance::<T, L>(rho / curvature, back, forth, solution, residual);
            conjugate = rho / previous;
            iterations += 1;
        };
        for row in 0..self.x.len() {
            let [u, v, w, _] = solution[row].map(|component| Into::<f64>::into(component) * scale);
            let [[a, ..], [b, c, _], [d, e, f]] = inverses[row];
            self.x[row] = [a * u + b * v + d * w, c * v + e * w, f * w];
        }
        let [initial_residual, final_residual] = [initial, rho].map(|square| square.sqrt() * scale);
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
            let (residual, mut direction) = (r[row], p[row]);
            for lane in 0..4 {
                direction[lane] = direction[lane].mul_add::<L>(conjugate, residual[lane]);
            }
            p[row] = direction;
            let mut sums = [direction, [T::from_f64(0.0); 4], [T::from_f64(0.0); 4]];
            // The nearest row, computed just before, comes last: the others do not have to wait for it.
            for place in self.pattern.above(row).rev() {
                let block = &self.columns[9 * (place - row - 1)..][..9 + SLACK];
                subtract_product::<T, L>(&mut sums, block, &t[self.pattern.columns()[place] as usize]);
            }
            let back = total(&sums);
            let mut start = direction;
            for lane in 0..4 {
                start[lane] = back[lane].mul_add::<L>(rest, direction[lane]);
            }
            add_products(&mut along, &direction, &back);
            (t[row], w[row]) = (back, start);
        }
        of_three(along)
    }

    /// w ← (I + L̃)⁻¹ w. Returns p · w.
    #[inline(always)]
    fn forward<L: Level>(&self, w: &mut [Wide<T>], p: &[Wide<T>]) -> f64 {
        let mut along = [0.0; 4];
        for row in 0..w.len() {
            let here = w[row];
            add_products(&mut along, &p[row], &here);
            for place in self.pattern.above(row) {
                let block = &self.rows[9 * (place - row - 1)..][..9 + SLACK];
                let other = &mut w[self.pattern.columns()[place] as usize];
                let mut sums = [*other, [T::from_f64(0.0); 4], [T::from_f64(0.0); 4]];
                subtract_product::<T, L>(&mut sums, block, &here);
                *other = total(&sums);
            }
        }
        of_three(along)
    }
}

/// The sum of three partial sums, which do not wait for each other.
#[inline(always)]
fn total<T: Precision>(sums: &[Wide<T>; 3]) -> Wide<T> {
    let mut total = sums[0];
    for lane in 0..4 {
        total[lane] = sums[0][lane] + (sums[1][lane] + sums[2][lane]);
    }
    total
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
    let mut squares = [0.0; 4];
    for row in 0..r.len() {
        let (t, s, mut solution, mut rest) = (t[row], s[row], x[row], r[row]);
        for lane in 0..4 {
            solution[lane] = t[lane].mul_add::<L>(step, solution[lane]);
        }
        for lane in 0..4 {
            rest[lane] = (t[lane] + s[lane]).mul_add::<L>(-step, rest[lane]);
        }
        add_products(&mut squares, &rest, &rest);
        (x[row], r[row]) = (solution, rest);
    }
    of_three(squares)
}

/// a · a.
#[inline(always)]
fn square<T: Precision>(a: &[Wide<T>]) -> f64 {
    let mut squares = [0.0; 4];
    for vector in a {
        add_products(&mut squares, vector, vector);
    }
    of_three(squares)
}

/// The sum of the first three of four sums.
#[inline(always)]
fn of_three(sums: [f64; 4]) -> f64 {
    // What is added up for nothing costs nothing, but without it compilers take registers apart.
    let [x, y, z, _] = std::hint::black_box(sums);
    x + y + z
}

/// Adds products of components, in doubles.
#[inline(always)]
fn add_products<T: Precision>(sums: &mut [f64; 4], a: &Wide<T>, b: &Wide<T>) {
    for lane in 0..4 {
        let product: f64 = (a[lane] * b[lane]).into();
        sums[lane] += product;
    }
}
