//! Banded factorisation of symmetric matrices over unknowns of different sizes.

use std::collections::VecDeque;
use std::sync::Arc;

use energy_dsl::{Kernel, Level, Number, dispatch};

use crate::linear::solve::SingularPivot;
use crate::matrix::kinds::{BlockVisitor, KindMatrix, KindPattern};

/// Entries that are processed together. With 4, the rows of a rod are 12 long.
const TOGETHER: usize = 4;

/// The order in which unknowns are eliminated.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub enum BandOrder {
    /// The order of the unknowns, or reverse Cuthill–McKee if that has a narrower band.
    #[default]
    Narrowest,
    /// The order of the unknowns. For a rod, points and twists by turns.
    AsGiven,
    /// Reverse Cuthill–McKee (George and Liu 1981, §4.3): breadth-first from the end of a long path, reversed.
    ReverseCuthillMckee,
}

/// Factorisation A = L D Lᵀ of a banded symmetric matrix, for chains: rods, hairs, trusses.
///
/// With n rows and a half bandwidth w, a factorisation takes n w (w + 3)/2 multiplications and a solve 2 n w, so that
/// time grows linearly with the length of a chain. Rows are not exchanged: D tells how many eigenvalues are negative
/// (Sylvester's law of inertia), and a positive definite matrix needs no pivoting. For indefinite ones, refine the
/// solution.
///
/// ```
/// use energy_solve::{BandFactor, BandOrder, KindMatrix, KindPattern};
///
/// // Two angles coupled by a torsion spring of 1 N m/rad, of which the first is also held by 2 N m/rad.
/// let pattern = KindPattern::from_stencils(&[1, 1], [&[0, 1][..]]).into();
/// let mut matrix = KindMatrix::zeros(std::sync::Arc::clone(&pattern));
/// matrix.add(0, 0, |_, _| 3.0);
/// matrix.add(0, 1, |_, _| -1.0);
/// matrix.add(1, 1, |_, _| 1.0);
/// let mut factor = BandFactor::new(&pattern, &BandOrder::Narrowest);
/// assert_eq!(factor.half_bandwidth(), 1);
/// assert_eq!(factor.factor(&matrix)?, 0); // no negative eigenvalue
/// let mut x = [0.0, 1.0]; // a torque of 1 N m on the second
/// factor.solve(&mut x);
/// assert!((x[0] - 0.5).abs() < 1e-14 && (x[1] - 1.5).abs() < 1e-14);
/// # Ok::<(), energy_solve::SingularPivot>(())
/// ```
#[derive(Clone, Debug)]
pub struct BandFactor {
    pattern: Arc<KindPattern>,
    /// Position of each unknown's first increment in the order of elimination.
    positions: Vec<usize>,
    half_bandwidth: usize,
    /// Numbers per stored row: the diagonal and `half_bandwidth` entries right of it, padded with zeros.
    stride: usize,
    /// The upper triangle by rows. After factorisation: 1/D and Lᵀ.
    rows: Vec<f64>,
    /// Scratch: a vector in the order of elimination, and zeros.
    ordered: Vec<f64>,
}

impl BandFactor {
    /// Analyses a pattern.
    #[must_use]
    pub fn new(pattern: &Arc<KindPattern>, order: &BandOrder) -> Self {
        let positions = match order {
            BandOrder::AsGiven => positions(pattern, &as_given(pattern)),
            BandOrder::ReverseCuthillMckee => positions(pattern, &reverse_cuthill_mckee(pattern)),
            BandOrder::Narrowest => narrowest(pattern),
        };
        Self::with_positions(pattern, positions)
    }

    fn with_positions(pattern: &Arc<KindPattern>, positions: Vec<usize>) -> Self {
        let half_bandwidth = half_bandwidth(pattern, &positions);
        let stride = (half_bandwidth + 1).next_multiple_of(TOGETHER);
        // The update of a row reads and writes whole registers, past the last row too.
        let rows = vec![0.0; (pattern.increments() + half_bandwidth + 1) * stride + TOGETHER];
        let ordered = vec![0.0; pattern.increments() + stride];
        Self { pattern: Arc::clone(pattern), positions, half_bandwidth, stride, rows, ordered }
    }

    /// Analyses a pattern whose half bandwidth is at most `widest` in the narrowest order. Returns `None` for others,
    /// before it allocates the band.
    pub(super) fn narrow(pattern: &Arc<KindPattern>, widest: usize) -> Option<Self> {
        let positions = narrowest(pattern);
        (half_bandwidth(pattern, &positions) <= widest).then(|| Self::with_positions(pattern, positions))
    }

    /// Returns the largest distance of a stored entry from the diagonal.
    #[must_use]
    pub fn half_bandwidth(&self) -> usize {
        self.half_bandwidth
    }

    /// Factors a matrix of the pattern. Returns the number of its negative eigenvalues: 0 if it is positive definite.
    ///
    /// # Errors
    /// If a pivot is zero or not finite.
    ///
    /// # Panics
    /// If the matrix has another pattern.
    pub fn factor(&mut self, matrix: &KindMatrix) -> Result<usize, SingularPivot> {
        assert!(Arc::ptr_eq(&self.pattern, matrix.pattern()), "the matrix has another pattern");
        self.fill(matrix);
        let count = self.pattern.increments();
        let elimination = Elimination { rows: &mut self.rows, count, width: self.half_bandwidth, stride: self.stride };
        dispatch(elimination).map_err(|at| SingularPivot { unknown: self.unknown_at(at.position) })
    }

    /// x ← A⁻¹ x for the last factored matrix.
    ///
    /// # Panics
    /// If x does not have one number per increment.
    pub fn solve(&mut self, x: &mut [f64]) {
        let Self { pattern, positions, stride, rows, ordered, .. } = self;
        let count = pattern.increments();
        assert_eq!(x.len(), count, "a vector has a number per increment");
        for unknown in 0..pattern.unknowns() {
            let (first, size) = (pattern.first(unknown), pattern.size(unknown));
            ordered[positions[unknown]..][..size].copy_from_slice(&x[first..][..size]);
        }
        dispatch(Substitution { rows, count, stride: *stride, x: ordered });
        for unknown in 0..pattern.unknowns() {
            let (first, size) = (pattern.first(unknown), pattern.size(unknown));
            x[first..][..size].copy_from_slice(&ordered[positions[unknown]..][..size]);
        }
    }

    /// Copies the matrix to the band.
    fn fill(&mut self, matrix: &KindMatrix) {
        let Self { positions, stride, rows, .. } = self;
        rows.fill(0.0);
        matrix.visit(&mut Fill { positions, stride: *stride, rows });
    }

    /// Returns the unknown that has a position.
    fn unknown_at(&self, position: usize) -> usize {
        let has = |&unknown: &usize| (self.positions[unknown]..self.positions[unknown] + 3).contains(&position);
        let of_size = |&unknown: &usize| position - self.positions[unknown] < self.pattern.size(unknown);
        (0..self.pattern.unknowns()).filter(has).find(of_size).expect("each position belongs to an unknown")
    }
}

/// Copies blocks to the upper triangle of a band.
struct Fill<'a> {
    positions: &'a [usize],
    stride: usize,
    rows: &'a mut [f64],
}

impl BlockVisitor for Fill<'_> {
    #[inline(always)]
    fn block<const R: usize, const C: usize>(&mut self, row: usize, column: usize, block: &[[f64; C]; R]) {
        let (from, to) = (self.positions[row], self.positions[column]);
        let first = from.min(to) * self.stride + from.abs_diff(to);
        // One row down and one column left in the band is the next row of the matrix.
        let next_row = self.stride - 1;
        if row == column {
            for i in 0..R {
                self.rows[first + i * self.stride..][..R - i].copy_from_slice(&block[i][i..]);
            }
        } else if from < to {
            for i in 0..R {
                self.rows[first + i * next_row..][..C].copy_from_slice(&block[i]);
            }
        } else {
            for j in 0..C {
                let band = &mut self.rows[first + j * next_row..][..R];
                (0..R).for_each(|i| band[i] = block[i][j]);
            }
        }
    }
}

/// A pivot is zero or not finite.
struct BadPivot {
    position: usize,
}

/// A ← L D Lᵀ, row by row of the upper triangle.
struct Elimination<'a> {
    rows: &'a mut [f64],
    count: usize,
    width: usize,
    stride: usize,
}

impl Kernel for Elimination<'_> {
    type Output = Result<usize, BadPivot>;

    #[inline(always)]
    fn run<L: Level>(self) -> Result<usize, BadPivot> {
        let Self { rows, count, width, stride } = self;
        // The pivot's row and zeros, as updates read past its end.
        let mut pivot_row = vec![0.0; stride + TOGETHER];
        let mut negative = 0;
        for position in 0..count {
            let (row, below) = rows[position * stride..].split_at_mut(stride);
            pivot_row[..stride].copy_from_slice(row);
            let pivot = pivot_row[0];
            let inverse = 1.0 / pivot;
            if !inverse.is_finite() || inverse == 0.0 {
                return Err(BadPivot { position });
            }
            negative += usize::from(pivot < 0.0);
            row[0] = inverse;
            row[1..].iter_mut().for_each(|entry| *entry *= inverse);
            for (distance, target) in (1..=width).zip(below.chunks_exact_mut(stride)) {
                let factor = -row[distance];
                let count = (width + 1 - distance).next_multiple_of(TOGETHER);
                let target = target[..count].as_chunks_mut::<TOGETHER>().0;
                let source = pivot_row[distance..][..count].as_chunks::<TOGETHER>().0;
                target.iter_mut().zip(source).for_each(|(target, source)| add_scaled::<L>(target, factor, source));
            }
        }
        Ok(negative)
    }
}

/// x ← (L D Lᵀ)⁻¹ x, in the order of elimination. Zeros follow x.
struct Substitution<'a> {
    rows: &'a [f64],
    count: usize,
    stride: usize,
    x: &'a mut [f64],
}

impl Kernel for Substitution<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Level>(self) {
        let Self { rows, count, stride, x } = self;
        for position in 0..count {
            let factor = -x[position];
            let row = rows[position * stride..][..stride].as_chunks::<TOGETHER>().0;
            let own = x[position..][..stride].as_chunks_mut::<TOGETHER>().0;
            own.iter_mut().zip(row).for_each(|(x, row)| add_scaled::<L>(x, factor, row));
            // The first entry of a row is 1/D, and not that of L.
            x[position] = -factor;
        }
        for position in (0..count).rev() {
            let row = &rows[position * stride..][..stride];
            let x = &mut x[position..][..stride];
            let scaled = row[0] * std::mem::take(&mut x[0]);
            let mut sums = [0.0; TOGETHER];
            for (entries, x) in row.as_chunks::<TOGETHER>().0.iter().zip(x.as_chunks::<TOGETHER>().0) {
                for entry in 0..TOGETHER {
                    sums[entry] = Number::mul_add::<L>(entries[entry], x[entry], sums[entry]);
                }
            }
            let [a, b, c, d] = sums;
            x[0] = scaled - ((a + b) + (c + d));
        }
    }
}

/// y ← y + s x. Reads all numbers before it writes any, so that they fill a register.
#[inline(always)]
fn add_scaled<L: Level>(y: &mut [f64; TOGETHER], s: f64, x: &[f64; TOGETHER]) {
    let mut sums = *y;
    for entry in 0..TOGETHER {
        sums[entry] = Number::mul_add::<L>(s, x[entry], sums[entry]);
    }
    *y = sums;
}

/// Returns the positions in the order of the unknowns or, if that has a narrower band, in reverse Cuthill–McKee order.
fn narrowest(pattern: &KindPattern) -> Vec<usize> {
    let [given, other] = [as_given(pattern), reverse_cuthill_mckee(pattern)].map(|order| positions(pattern, &order));
    if half_bandwidth(pattern, &other) < half_bandwidth(pattern, &given) { other } else { given }
}

fn as_given(pattern: &KindPattern) -> Vec<usize> {
    (0..pattern.unknowns()).collect()
}

/// Returns the position of each unknown's first increment.
fn positions(pattern: &KindPattern, order: &[usize]) -> Vec<usize> {
    let (mut positions, mut next) = (vec![0; order.len()], 0);
    for &unknown in order {
        positions[unknown] = next;
        next += pattern.size(unknown);
    }
    positions
}

/// Returns the largest distance between increments of coupled unknowns.
fn half_bandwidth(pattern: &KindPattern, positions: &[usize]) -> usize {
    let own = (0..pattern.unknowns()).map(|unknown| pattern.size(unknown) - 1).max().unwrap_or(0);
    let reach = |(a, b): (usize, usize)| {
        let (from, to) = if positions[a] < positions[b] { (a, b) } else { (b, a) };
        positions[to] + pattern.size(to) - 1 - positions[from]
    };
    pattern.couplings().map(reach).max().unwrap_or(0).max(own)
}

/// Returns the reverse Cuthill–McKee order of the unknowns.
fn reverse_cuthill_mckee(pattern: &KindPattern) -> Vec<usize> {
    let mut search = BreadthFirst::new(pattern);
    let mut order = Vec::with_capacity(pattern.unknowns());
    let mut is_ordered = vec![false; pattern.unknowns()];
    for unknown in 0..pattern.unknowns() {
        if !is_ordered[unknown] {
            let start = search.far_end(unknown);
            for (unknown, _) in search.from(start) {
                is_ordered[unknown] = true;
                order.push(unknown);
            }
        }
    }
    order.reverse();
    order
}

/// Breadth-first search over coupled unknowns.
struct BreadthFirst {
    /// The unknowns coupled to each, those with the fewest couplings first.
    neighbours: Vec<Vec<usize>>,
    /// The number of the last search that reached each unknown.
    reached: Vec<usize>,
    searches: usize,
}

impl BreadthFirst {
    fn new(pattern: &KindPattern) -> Self {
        let mut neighbours = vec![Vec::new(); pattern.unknowns()];
        for (a, b) in pattern.couplings() {
            neighbours[a].push(b);
            neighbours[b].push(a);
        }
        let degrees: Vec<usize> = neighbours.iter().map(Vec::len).collect();
        neighbours.iter_mut().for_each(|list| list.sort_by_key(|&unknown| (degrees[unknown], unknown)));
        Self { reached: vec![0; neighbours.len()], neighbours, searches: 0 }
    }

    /// Returns the unknowns connected to one, with their distances, nearest first.
    fn from(&mut self, start: usize) -> Vec<(usize, usize)> {
        self.searches += 1;
        self.reached[start] = self.searches;
        let (mut found, mut waiting) = (Vec::new(), VecDeque::from([(start, 0)]));
        while let Some((unknown, level)) = waiting.pop_front() {
            found.push((unknown, level));
            for &next in &self.neighbours[unknown] {
                if self.reached[next] != self.searches {
                    self.reached[next] = self.searches;
                    waiting.push_back((next, level + 1));
                }
            }
        }
        found
    }

    /// Returns an unknown at the end of a long path: George and Liu's pseudo-peripheral node.
    fn far_end(&mut self, connected_to: usize) -> usize {
        let (mut start, mut depth) = (connected_to, None);
        loop {
            let found = self.from(start);
            let deepest = found.last().map_or(0, |(_, level)| *level);
            if depth.is_some_and(|depth| deepest <= depth) {
                return start;
            }
            depth = Some(deepest);
            let last = found.iter().filter(|(_, level)| *level == deepest).map(|(unknown, _)| *unknown);
            start = last.min_by_key(|&unknown| (self.neighbours[unknown].len(), unknown)).unwrap_or(start);
        }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};
    use proptest::prelude::*;

    use super::*;

    /// A matrix over unknowns of several sizes, each of which is coupled to some of the next three.
    #[derive(Debug)]
    struct Chain {
        matrix: KindMatrix,
        dense: DMatrix<f64>,
    }

    impl Chain {
        /// Unknown i has a diagonal that dominates, negative if `negative[i]`.
        fn new(sizes: &[usize], negative: &[bool], seed: u64) -> Self {
            let mut random = fastrand::Rng::with_seed(seed);
            let count = sizes.len();
            let near = |i: usize| (i + 1..(i + 4).min(count)).map(move |j| [i as u32, j as u32]);
            let links: Vec<[u32; 2]> = (0..count).flat_map(near).filter(|_| random.bool()).collect();
            let pattern = Arc::new(KindPattern::from_stencils(sizes, links.iter().map(<[u32; 2]>::as_slice)));
            let mut matrix = KindMatrix::zeros(Arc::clone(&pattern));
            let mut dense = DMatrix::zeros(pattern.increments(), pattern.increments());
            let own = (0..count).map(|i| (i, i));
            for (i, j) in own.chain(links.iter().map(|&[i, j]| (i as usize, j as usize))) {
                let entries: Vec<f64> = (0..9).map(|_| random.f64() - 0.5).collect();
                let dominant = if negative[i] { -20.0 } else { 20.0 };
                let entry = |a: usize, b: usize| match (i == j, a == b) {
                    (true, true) => dominant,
                    (true, false) => entries[a.min(b) + a.max(b)],
                    _ => entries[3 * a + b],
                };
                matrix.add(i, j, entry);
                for a in 0..sizes[i] {
                    for b in 0..sizes[j] {
                        let (row, column) = (pattern.first(i) + a, pattern.first(j) + b);
                        dense[(row, column)] = entry(a, b);
                        dense[(column, row)] = entry(a, b);
                    }
                }
            }
            Self { matrix, dense }
        }
    }

    fn close(found: &[f64], expected: &DVector<f64>) -> bool {
        found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12)
    }

    proptest! {
        #[test]
        fn products_solutions_and_signs_are_those_of_a_dense_matrix(
            sizes in prop::collection::vec(1..=3_usize, 1..30),
            negative in prop::collection::vec(prop::bool::weighted(0.2), 30),
            seed in 0..1000_u64,
        ) {
            let Chain { matrix, dense } = Chain::new(&sizes, &negative, seed);
            let expected = DVector::from_fn(dense.nrows(), |i, _| (i as f64 + 0.5).sin());
            let mut product = vec![f64::NAN; dense.nrows()];
            matrix.multiply(expected.as_slice(), &mut product);
            prop_assert!(close(&product, &(&dense * &expected)));
            let negative_eigenvalues = dense.symmetric_eigenvalues().iter().filter(|value| **value < 0.0).count();
            for order in [BandOrder::AsGiven, BandOrder::ReverseCuthillMckee, BandOrder::Narrowest] {
                let mut factor = BandFactor::new(matrix.pattern(), &order);
                prop_assert_eq!(factor.factor(&matrix), Ok(negative_eigenvalues));
                let mut x = product.clone();
                factor.solve(&mut x);
                prop_assert!(close(&x, &expected), "{:?}: {:?} instead of {}", order, x, expected);
            }
        }
    }

    #[test]
    fn a_pivot_of_zero_names_its_unknown() {
        let pattern = Arc::new(KindPattern::from_stencils(&[3, 1, 2], []));
        let mut matrix = KindMatrix::zeros(Arc::clone(&pattern));
        for (unknown, entry) in [(0, 1.0), (1, 2.0), (2, 0.0)] {
            matrix.add(unknown, unknown, |i, j| if i == j { entry } else { 0.0 });
        }
        let outcome = BandFactor::new(&pattern, &BandOrder::AsGiven).factor(&matrix);
        assert_eq!(outcome, Err(SingularPivot { unknown: 2 }));
    }

    #[test]
    fn matrices_without_unknowns_have_empty_factors() {
        let pattern = Arc::new(KindPattern::from_stencils(&[], []));
        let mut factor = BandFactor::new(&pattern, &BandOrder::Narrowest);
        assert_eq!(factor.factor(&KindMatrix::zeros(Arc::clone(&pattern))), Ok(0));
        factor.solve(&mut []);
    }
}
