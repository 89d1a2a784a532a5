//! Conjugate gradients over unknowns of different sizes, with a border.

use crate::linear::block_jacobi::{inverse, is_positive_definite};
use crate::linear::bordered::{BorderedError, concave};
use crate::linear::conjugate_gradients::{Steps, conjugate_gradients};
use crate::linear::dense_factor::DenseFactor;
use crate::linear::solve::{SingularPivot, SolveOptions};
use crate::matrix::bordered::{BorderedMatrix, add_scaled, dot};

/// Conjugate gradients with the inverse diagonal blocks as preconditioner.
#[derive(Debug)]
pub(super) struct KindGradients {
    options: SolveOptions,
}

/// The inverse of an unknown's diagonal block, padded.
type Inverse = [[f64; 3]; 3];

impl KindGradients {
    pub(super) fn new(options: SolveOptions) -> Self {
        Self { options }
    }

    /// See [`super::BorderedSolver::solve`].
    pub(super) fn solve(&self, matrix: &BorderedMatrix, b: &[f64], x: &mut [f64]) -> Result<usize, BorderedError> {
        let reduced = Reduced::new(matrix)?;
        let mut steps = Iteration::new(&reduced, reduced.right_hand_side(b))?;
        let report = conjugate_gradients(&mut steps, &self.options);
        if report.stopped == crate::linear::solve::StopReason::IndefiniteCurvature {
            return Err(BorderedError::Indefinite);
        }
        if !report.converged() {
            return Err(BorderedError::NotConverged { iterations: report.iterations, stopped: report.stopped });
        }
        reduced.with_maximised(&steps.x, b, x);
        Ok(report.iterations)
    }
}

/// The matrix that is left once the maximised unknowns are eliminated. Its vectors have A's increments, then the
/// minimised ones.
struct Reduced<'a> {
    matrix: &'a BorderedMatrix,
    /// Increments of A.
    n: usize,
    minimised: Vec<usize>,
    maximised: Vec<usize>,
    /// The block of the maximised unknowns.
    concave: DenseFactor,
}

impl<'a> Reduced<'a> {
    fn new(matrix: &'a BorderedMatrix) -> Result<Self, BorderedError> {
        if matrix.multipliers.contains(&true) {
            return Err(BorderedError::Multiplier);
        }
        let (concave, _) = concave(matrix)?;
        let chosen = |of: bool| (0..matrix.shared()).filter(|&shared| matrix.maximised[shared] == of).collect();
        let n = matrix.kinds.pattern().increments();
        Ok(Self { matrix, n, minimised: chosen(false), maximised: chosen(true), concave })
    }

    fn corner(&self, row: usize, column: usize) -> f64 {
        self.matrix.corner[row * self.matrix.shared() + column]
    }

    /// Returns Σ of the couplings of a maximised unknown with x.
    fn coupled(&self, maximised: usize, x: &[f64]) -> f64 {
        let (own, shared) = x.split_at(self.n);
        let with_minimised = self.minimised.iter().zip(shared).map(|(&of, x)| self.corner(maximised, of) * x);
        dot(self.matrix.border(maximised), own) + with_minimised.sum::<f64>()
    }

    /// y ← y − (couplings of the maximised unknowns) · values.
    fn subtract_coupled(&self, values: &[f64], y: &mut [f64]) {
        let (own, shared) = y.split_at_mut(self.n);
        for (&maximised, value) in self.maximised.iter().zip(values) {
            add_scaled(own, -value, self.matrix.border(maximised));
            self.minimised.iter().zip(&mut *shared).for_each(|(&of, y)| *y -= self.corner(of, maximised) * value);
        }
    }

    /// Returns the right-hand side that is left.
    fn right_hand_side(&self, b: &[f64]) -> Vec<f64> {
        let mut left = b[..self.n].to_vec();
        left.extend(self.minimised.iter().map(|&shared| b[self.n + shared]));
        let mut values: Vec<f64> = self.maximised.iter().map(|&shared| b[self.n + shared]).collect();
        self.concave.solve(&mut values);
        self.subtract_coupled(&values, &mut left);
        left
    }

    /// Returns the whole solution.
    fn with_maximised(&self, solved: &[f64], b: &[f64], x: &mut [f64]) {
        let mut values: Vec<f64> =
            self.maximised.iter().map(|&shared| b[self.n + shared] - self.coupled(shared, solved)).collect();
        self.concave.solve(&mut values);
        x[..self.n].copy_from_slice(&solved[..self.n]);
        self.minimised.iter().zip(&solved[self.n..]).for_each(|(&shared, value)| x[self.n + shared] = *value);
        self.maximised.iter().zip(values).for_each(|(&shared, value)| x[self.n + shared] = value);
    }

    /// y ← A x, with the border.
    fn multiply(&self, x: &[f64], y: &mut [f64]) {
        let (own, shared) = x.split_at(self.n);
        self.matrix.kinds.multiply(own, &mut y[..self.n]);
        for (number, &row) in self.minimised.iter().enumerate() {
            add_scaled(&mut y[..self.n], shared[number], self.matrix.border(row));
            let among = self.minimised.iter().zip(shared).map(|(&column, x)| self.corner(row, column) * x);
            y[self.n + number] = dot(self.matrix.border(row), own) + among.sum::<f64>();
        }
        let mut values: Vec<f64> = self.maximised.iter().map(|&shared| self.coupled(shared, x)).collect();
        self.concave.solve(&mut values);
        self.subtract_coupled(&values, y);
    }

    /// Returns the inverse diagonal blocks: one per unknown, then one per minimised increment. They are positive
    /// definite if the matrix is.
    fn inverse_diagonal(&self) -> Result<Vec<Inverse>, BorderedError> {
        let pattern = self.matrix.kinds.pattern();
        let own = (0..pattern.unknowns()).map(|unknown| {
            let (first, size) = (pattern.first(unknown), pattern.size(unknown));
            (self.matrix.kinds.diagonal(unknown), size, (first..first + size).collect::<Vec<_>>())
        });
        let shared = self.minimised.iter().enumerate().map(|(number, &shared)| {
            let mut block = [[0.0; 3]; 3];
            block[0][0] = self.corner(shared, shared);
            (block, 1, vec![self.n + number])
        });
        let inverted = |(number, (mut block, size, rows)): (usize, (Inverse, usize, Vec<usize>))| {
            self.subtract_eliminated(&mut block, &rows);
            let largest = block.iter().flatten().fold(0.0_f64, |largest, entry| largest.max(entry.abs()));
            (size..3).for_each(|row| block[row][row] = largest);
            if !is_positive_definite(&block) {
                return Err(BorderedError::Indefinite);
            }
            inverse(&block).ok_or(BorderedError::Singular(SingularPivot { unknown: number }))
        };
        own.chain(shared).enumerate().map(inverted).collect()
    }

    /// Adds what eliminating the maximised unknowns adds to the block of these rows.
    fn subtract_eliminated(&self, block: &mut Inverse, rows: &[usize]) {
        let coupling = |row: usize, maximised: usize| match row.checked_sub(self.n) {
            None => self.matrix.border(maximised)[row],
            Some(number) => self.corner(self.minimised[number], maximised),
        };
        for (j, &column) in rows.iter().enumerate() {
            let mut values: Vec<f64> = self.maximised.iter().map(|&shared| coupling(column, shared)).collect();
            self.concave.solve(&mut values);
            for (i, &row) in rows.iter().enumerate() {
                let product = self.maximised.iter().zip(&values).map(|(&shared, value)| coupling(row, shared) * value);
                block[i][j] -= product.sum::<f64>();
            }
        }
    }
}

/// The vectors of conjugate gradients.
struct Iteration<'a> {
    reduced: &'a Reduced<'a>,
    inverses: Vec<Inverse>,
    right: Vec<f64>,
    x: Vec<f64>,
    r: Vec<f64>,
    z: Vec<f64>,
    p: Vec<f64>,
    product: Vec<f64>,
}

impl<'a> Iteration<'a> {
    fn new(reduced: &'a Reduced<'a>, right: Vec<f64>) -> Result<Self, BorderedError> {
        let zeros = || vec![0.0; right.len()];
        let (x, r, z, p, product) = (zeros(), zeros(), zeros(), zeros(), zeros());
        Ok(Self { reduced, inverses: reduced.inverse_diagonal()?, right, x, r, z, p, product })
    }

    /// z ← D⁻¹ r. Returns r · z, the square of the norm of the stopping test.
    fn scale(&mut self) -> f64 {
        let pattern = self.reduced.matrix.kinds.pattern();
        for unknown in 0..pattern.unknowns() {
            let (first, size, inverse) = (pattern.first(unknown), pattern.size(unknown), &self.inverses[unknown]);
            for row in 0..size {
                self.z[first + row] = dot(&inverse[row][..size], &self.r[first..][..size]);
            }
        }
        for (number, inverse) in self.inverses[pattern.unknowns()..].iter().enumerate() {
            self.z[self.reduced.n + number] = inverse[0][0] * self.r[self.reduced.n + number];
        }
        dot(&self.r, &self.z)
    }
}

impl Steps for Iteration<'_> {
    fn start(&mut self) -> (f64, f64) {
        self.x.fill(0.0);
        self.r.copy_from_slice(&self.right);
        (1.0, self.scale())
    }

    fn precondition(&mut self, square: f64) -> f64 {
        square
    }

    fn conjugate(&mut self, ratio: f64) -> f64 {
        self.p.iter_mut().zip(&self.z).for_each(|(p, z)| *p = z + ratio * *p);
        self.reduced.multiply(&self.p, &mut self.product);
        dot(&self.p, &self.product)
    }

    fn advance(&mut self, step: f64) -> f64 {
        add_scaled(&mut self.x, step, &self.p);
        add_scaled(&mut self.r, -step, &self.product);
        self.scale()
    }

    fn finish(&mut self, _: f64) {}
}
