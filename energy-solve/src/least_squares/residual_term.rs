use std::fmt::Debug;
use std::sync::Arc;

use energy_dsl::{Array, BLOCK, Declaration, Kernel, Lane, Level, Mask, Number, PackedResidual, Residual, dispatch};

use crate::least_squares::loss::Loss;
use crate::least_squares::normal_matrix::{Couplings, NormalMatrix, WIDTH, WideBlock};

/// The energy of a term.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TermSum {
    /// λ Σ w ρ(‖r‖²); infinite if the residual of an element has no value.
    pub energy: f64,
    /// Number of elements that met a singularity. Their Jacobians are left out.
    pub degenerate: usize,
}

/// JᵀJ and Jᵀr of all terms, with rows multiplied by the square roots of their weights. Jᵀr is half the gradient of the
/// energy.
#[derive(Clone, Debug)]
pub struct NormalEquations<const D: usize> {
    /// JᵀJ.
    pub matrix: NormalMatrix<D>,
    /// Jᵀr.
    pub right: Vec<[f64; D]>,
}

impl<const D: usize> NormalEquations<D> {
    /// Sets JᵀJ and Jᵀr to zero.
    pub fn clear(&mut self) {
        self.matrix.clear();
        self.right.fill([0.0; D]);
    }

    /// Adds equations of the same pattern.
    pub(crate) fn add(&mut self, other: &Self) {
        self.matrix.add(&other.matrix);
        let other = other.right.as_flattened();
        self.right.as_flattened_mut().iter_mut().zip(other).for_each(|(sum, part)| *sum += part);
    }
}

/// A sum of squared residuals over blocks of D unknowns.
pub trait LeastSquaresTerm<const D: usize>: Debug + Sync {
    /// The term's name, for people.
    fn name(&self) -> &str;
    /// The declaration of the term's elements.
    fn declaration(&self) -> &Declaration;
    /// The number of elements.
    fn len(&self) -> usize;
    /// Whether the term has zero elements.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }
    /// Returns the energy at x.
    fn energy(&self, x: &[[f64; D]]) -> TermSum;
    /// Returns the energy at x and adds JᵀJ and Jᵀr.
    fn linearise(&self, x: &[[f64; D]], equations: &mut NormalEquations<D>) -> TermSum;
    /// Returns the index of the first element with a non-finite energy.
    fn find_non_finite(&self, x: &[[f64; D]]) -> Option<usize>;
}

/// An element on one of the stencils of a term's [`Couplings`].
#[derive(Clone, Copy, Debug)]
pub struct Placed<E> {
    /// The residual and its own numbers.
    pub element: E,
    /// Index of the stencil.
    pub stencil: u32,
    /// Weight w ≥ 0 of the squared residual.
    pub weight: f64,
}

/// Residuals of one type, packed into SIMD lanes: E = λ Σ w ρ(‖r‖²).
#[derive(Clone, Debug)]
pub struct ResidualTerm<E, const D: usize> {
    name: String,
    couplings: Arc<Couplings>,
    /// λ.
    pub lambda: f64,
    /// ρ.
    pub loss: Loss,
    /// Numbers of the elements, by pack, then number, then element.
    numbers: Vec<f64>,
    stencils: Vec<u32>,
    weights: Vec<f64>,
    /// A function type: the term stores numbers only, so threads can share it whatever E is.
    element_type: std::marker::PhantomData<fn() -> E>,
}

impl<E: PackedResidual<f64> + Debug, const D: usize> ResidualTerm<E, D> {
    /// Creates a term without elements.
    ///
    /// # Panics
    /// If the number of unknowns of a stencil differs from that of the residual.
    #[must_use]
    pub fn new(name: impl Into<String>, couplings: Arc<Couplings>, lambda: f64) -> Self {
        let (unknowns, blocks) = (<E as Residual<f64>>::Unknowns::LEN, couplings.arity());
        assert_eq!(
            unknowns,
            blocks * D,
            "{} has {unknowns} unknowns, but its stencils have {blocks} blocks of {D}",
            E::DECLARATION.name
        );
        Self {
            name: name.into(),
            couplings,
            lambda,
            loss: Loss::Squares,
            numbers: Vec::new(),
            stencils: Vec::new(),
            weights: Vec::new(),
            element_type: std::marker::PhantomData,
        }
    }

    /// Replaces all elements and reuses the memory.
    ///
    /// # Panics
    /// If the index of a stencil is out of range.
    pub fn set_elements(&mut self, elements: impl IntoIterator<Item = Placed<E>>) {
        self.numbers.clear();
        self.stencils.clear();
        self.weights.clear();
        let mut last = None;
        for (number, Placed { element, stencil, weight }) in elements.into_iter().enumerate() {
            assert!(
                (stencil as usize) < self.couplings.len(),
                "stencil {stencil} is out of range: there are {}",
                self.couplings.len()
            );
            if number % BLOCK == 0 {
                self.numbers.resize(self.numbers.len() + Self::BLOCK_NUMBERS, 0.0);
            }
            self.write(number, &element);
            self.stencils.push(stencil);
            self.weights.push(weight);
            last = Some(element);
        }
        if let Some(element) = last {
            // Unused lanes repeat the last element.
            let count = self.stencils.len();
            (count..count.next_multiple_of(BLOCK)).for_each(|number| self.write(number, &element));
        }
    }

    /// Numbers per pack of elements. Elements without numbers take one, so that each has a position.
    const BLOCK_NUMBERS: usize = BLOCK * if E::NUMBERS == 0 { 1 } else { E::NUMBERS };

    fn write(&mut self, number: usize, element: &E) {
        element.store(&mut self.numbers[number / BLOCK * Self::BLOCK_NUMBERS + number % BLOCK..], BLOCK);
    }

    /// Returns all residuals without weights, element by element.
    #[must_use]
    pub fn residuals(&self, x: &[[f64; D]]) -> Vec<f64> {
        let mut all = Vec::with_capacity(self.stencils.len() * Self::rows());
        let mut chunk = Chunk::default();
        for first in (0..self.stencils.len()).step_by(CHUNK) {
            let count = self.evaluate_chunk(first, x, &mut chunk);
            all.extend_from_slice(&chunk.residuals[..count * Self::rows()]);
        }
        all
    }

    /// Returns the weight λ w of an element, without that of the loss.
    #[must_use]
    pub fn weight(&self, element: usize) -> f64 {
        self.lambda * self.weights[element]
    }

    /// Returns the blocks of unknowns of an element.
    #[must_use]
    pub fn stencil(&self, element: usize) -> &[u32] {
        self.couplings.stencil(self.stencils[element] as usize)
    }

    /// Computes all Jacobians and discards them, to measure the cost of derivatives alone. Returns the sum of some
    /// entries.
    #[must_use]
    pub fn evaluate_jacobians(&self, x: &[[f64; D]]) -> f64 {
        let (mut sum, mut chunk) = (0.0, Chunk::default());
        for first in (0..self.stencils.len()).step_by(CHUNK) {
            self.linearise_chunk(first, x, &mut chunk);
            sum += std::hint::black_box(&chunk.jacobians)[0];
        }
        sum
    }

    fn rows() -> usize {
        <E as Residual<f64>>::Rows::LEN
    }

    #[inline(always)]
    fn load<L: Level>(&self, first: usize) -> E::Wide<L::F64> {
        E::load::<L::F64>(&self.numbers[first / BLOCK * Self::BLOCK_NUMBERS + first % BLOCK..], BLOCK)
    }

    /// Gathers the unknowns of one element per lane.
    #[inline(always)]
    fn gather<L: Level>(&self, first: usize, x: &[[f64; D]]) -> <E::Wide<L::F64> as Residual<L::F64>>::Unknowns {
        let mut unknowns =
            <<E::Wide<L::F64> as Residual<L::F64>>::Unknowns as Array<L::F64>>::repeat(L::F64::splat(0.0));
        let last = self.stencils.len() - 1;
        for (k, block) in unknowns.as_mut().chunks_exact_mut(D).enumerate() {
            let mut numbers = [[0.0; WIDTH]; D];
            for lane in 0..L::F64::LANES {
                let stencil = self.couplings.stencil(self.stencils[(first + lane).min(last)] as usize);
                let values = &x[stencil[k] as usize];
                for i in 0..D {
                    numbers[i][lane] = values[i];
                }
            }
            for (unknown, numbers) in block.iter_mut().zip(&numbers) {
                *unknown = L::F64::load(numbers);
            }
        }
        unknowns
    }
}

/// Elements that are evaluated before their results are used. Large enough that the consumer can be compiled
/// separately, small enough that the results stay in the cache.
const CHUNK: usize = 64;

/// Results of a run of elements.
#[derive(Debug, Default)]
struct Chunk {
    residuals: Vec<f64>,
    jacobians: Vec<f64>,
    /// Elements that met a singularity, counted from the chunk's first.
    degenerate: Vec<usize>,
    /// Those of them whose residual has no value.
    undefined: Vec<usize>,
}

impl<E: PackedResidual<f64> + Debug, const D: usize> ResidualTerm<E, D> {
    /// Evaluates the residuals of the elements from `first` on. Returns the number of elements.
    fn evaluate_chunk(&self, first: usize, x: &[[f64; D]], chunk: &mut Chunk) -> usize {
        let count = CHUNK.min(self.stencils.len() - first);
        chunk.degenerate.clear();
        chunk.residuals.resize(CHUNK * Self::rows(), 0.0);
        dispatch(Residuals { term: self, x, first, count, chunk });
        chunk.undefined.clone_from(&chunk.degenerate);
        count
    }

    /// Evaluates the residuals and Jacobians of the elements from `first` on. Returns the number of elements.
    fn linearise_chunk(&self, first: usize, x: &[[f64; D]], chunk: &mut Chunk) -> usize {
        let count = CHUNK.min(self.stencils.len() - first);
        chunk.degenerate.clear();
        chunk.residuals.resize(CHUNK * Self::rows(), 0.0);
        // Rows are read as whole registers, which reaches past the end of the last block.
        chunk.jacobians.resize(CHUNK * Self::rows() * self.couplings.arity() * D + WIDTH, 0.0);
        dispatch(Jacobians { term: self, x, first, count, chunk });
        chunk.undefined.clear();
        if !chunk.degenerate.is_empty() {
            let mut values = Chunk::default();
            self.evaluate_chunk(first, x, &mut values);
            chunk.undefined = values.undefined;
        }
        count
    }

    /// Calls `each` with an element's index, its energy, and the square root of its weight. A residual without a value
    /// has an infinite energy, so that no line search accepts it. At a singularity of derivatives, the weight is 0.
    fn weigh(&self, first: usize, count: usize, chunk: &Chunk, mut each: impl FnMut(usize, f64, f64)) {
        let rows = Self::rows();
        for at in 0..count {
            let square: f64 = chunk.residuals[at * rows..][..rows].iter().map(|r| r * r).sum();
            let weight = self.lambda * self.weights[first + at];
            if weight > 0.0 && chunk.undefined.contains(&at) {
                each(at, f64::INFINITY, 0.0);
                continue;
            }
            let (loss, slope) = self.loss.of(square);
            let is_regular = !square.is_finite() || !chunk.degenerate.contains(&at);
            each(at, weight * loss, if is_regular { (weight * slope).sqrt() } else { 0.0 });
        }
    }
}

impl<E: PackedResidual<f64> + Debug, const D: usize> LeastSquaresTerm<D> for ResidualTerm<E, D> {
    fn name(&self) -> &str {
        &self.name
    }

    fn declaration(&self) -> &Declaration {
        E::DECLARATION
    }

    fn len(&self) -> usize {
        self.stencils.len()
    }

    fn energy(&self, x: &[[f64; D]]) -> TermSum {
        let (mut sum, mut chunk) = (TermSum::default(), Chunk::default());
        for first in (0..self.stencils.len()).step_by(CHUNK) {
            let count = self.evaluate_chunk(first, x, &mut chunk);
            self.weigh(first, count, &chunk, |_, energy, _| sum.energy += energy);
            sum.degenerate += chunk.degenerate.len();
        }
        sum
    }

    fn linearise(&self, x: &[[f64; D]], equations: &mut NormalEquations<D>) -> TermSum {
        let (mut sum, mut chunk, mut roots) = (TermSum::default(), Chunk::default(), [0.0; CHUNK]);
        for first in (0..self.stencils.len()).step_by(CHUNK) {
            let count = self.linearise_chunk(first, x, &mut chunk);
            self.weigh(first, count, &chunk, |at, energy, root| {
                sum.energy += energy;
                roots[at] = root;
            });
            sum.degenerate += chunk.degenerate.len();
            dispatch(Products {
                couplings: &self.couplings,
                stencils: &self.stencils[first..first + count],
                roots: &roots[..count],
                rows: Self::rows(),
                chunk: &mut chunk,
                equations,
            });
        }
        sum
    }

    fn find_non_finite(&self, x: &[[f64; D]]) -> Option<usize> {
        let mut chunk = Chunk::default();
        for first in (0..self.stencils.len()).step_by(CHUNK) {
            let count = self.evaluate_chunk(first, x, &mut chunk);
            let mut found = None;
            self.weigh(first, count, &chunk, |at, energy, _| {
                if !energy.is_finite() && found.is_none() {
                    found = Some(first + at);
                }
            });
            if found.is_some() {
                return found;
            }
        }
        None
    }
}

/// Evaluates r of a chunk.
struct Residuals<'a, E, const D: usize> {
    term: &'a ResidualTerm<E, D>,
    x: &'a [[f64; D]],
    first: usize,
    count: usize,
    chunk: &'a mut Chunk,
}

impl<E: PackedResidual<f64> + Debug, const D: usize> Kernel for Residuals<'_, E, D> {
    type Output = ();

    #[inline(always)]
    fn run<L: Level>(self) {
        let Self { term, x, first, count, chunk } = self;
        let rows = ResidualTerm::<E, D>::rows();
        for at in (0..count).step_by(L::F64::LANES) {
            let lanes = L::F64::LANES.min(count - at);
            let result = term.load::<L>(first + at).residual_at::<L>(&term.gather::<L>(first + at, x));
            L::F64::store_transposed(result.value.as_ref(), lanes, &mut chunk.residuals[rows * at..], rows);
            if result.flags.degenerate.any() {
                note(&mut chunk.degenerate, at, lanes, result.flags.degenerate);
            }
        }
    }
}

/// Evaluates r and J of a chunk.
struct Jacobians<'a, E, const D: usize> {
    term: &'a ResidualTerm<E, D>,
    x: &'a [[f64; D]],
    first: usize,
    count: usize,
    chunk: &'a mut Chunk,
}

impl<E: PackedResidual<f64> + Debug, const D: usize> Kernel for Jacobians<'_, E, D> {
    type Output = ();

    #[inline(always)]
    fn run<L: Level>(self) {
        let Self { term, x, first, count, chunk } = self;
        let rows = ResidualTerm::<E, D>::rows();
        let entries = rows * term.couplings.arity() * D;
        for at in (0..count).step_by(L::F64::LANES) {
            let lanes = L::F64::LANES.min(count - at);
            let result = term.load::<L>(first + at).jacobian_at::<L>(&term.gather::<L>(first + at, x));
            L::F64::store_transposed(result.value.as_ref(), lanes, &mut chunk.residuals[rows * at..], rows);
            L::F64::store_transposed(result.jacobian.as_ref(), lanes, &mut chunk.jacobians[entries * at..], entries);
            if result.flags.degenerate.any() {
                note(&mut chunk.degenerate, at, lanes, result.flags.degenerate);
            }
        }
    }
}

/// Out of line: singularities are rare.
#[cold]
#[inline(never)]
fn note<M: Mask>(degenerate: &mut Vec<usize>, at: usize, lanes: usize, mask: M) {
    degenerate.extend((0..lanes).filter(|&lane| mask.lane(lane)).map(|lane| at + lane));
}

/// Adds JᵀJ and Jᵀr of a chunk. Compiled once for all types of elements.
struct Products<'a, const D: usize> {
    couplings: &'a Couplings,
    stencils: &'a [u32],
    roots: &'a [f64],
    rows: usize,
    chunk: &'a mut Chunk,
    equations: &'a mut NormalEquations<D>,
}

impl<const D: usize> Kernel for Products<'_, D> {
    type Output = ();

    #[inline(always)]
    fn run<L: Level>(self) {
        let Self { couplings, stencils, roots, rows, chunk, equations } = self;
        let unknowns = couplings.arity() * D;
        for (at, (&stencil, &root)) in stencils.iter().zip(roots).enumerate() {
            if root == 0.0 {
                continue;
            }
            let stencil = stencil as usize;
            let residual = &mut chunk.residuals[at * rows..][..rows];
            let jacobian = &mut chunk.jacobians[at * rows * unknowns..][..rows * unknowns + WIDTH];
            residual.iter_mut().for_each(|r| *r *= root);
            jacobian[..rows * unknowns].iter_mut().for_each(|entry| *entry *= root);
            add_right::<D>(&mut equations.right, couplings.stencil(stencil), residual, jacobian, unknowns);
            let (slots, arity) = (couplings.slots(stencil), couplings.arity());
            add_products::<L, D>(&mut equations.matrix.values, slots, arity, (rows, unknowns), jacobian);
        }
    }
}

/// Adds Jᵀr of one element.
#[inline(always)]
fn add_right<const D: usize>(
    right: &mut [[f64; D]],
    stencil: &[u32],
    residual: &[f64],
    jacobian: &[f64],
    unknowns: usize,
) {
    for (row, r) in residual.iter().enumerate() {
        for (k, &block) in stencil.iter().enumerate() {
            let derivatives = &jacobian[row * unknowns + k * D..][..D];
            for (sum, derivative) in right[block as usize].iter_mut().zip(derivatives) {
                *sum += r * derivative;
            }
        }
    }
}

/// Adds JᵀJ of one element, one pair of blocks at a time.
#[inline(always)]
fn add_products<L: Level, const D: usize>(
    blocks: &mut [WideBlock<D>],
    slots: &[u32],
    arity: usize,
    (rows, unknowns): (usize, usize),
    jacobian: &[f64],
) {
    let mut slots = slots.iter();
    for i in 0..arity {
        for j in i..arity {
            let &slot = slots.next().expect("one slot per pair");
            let (a, b) = if slot & 1 == 0 { (i, j) } else { (j, i) };
            let block = &mut blocks[(slot >> 1) as usize];
            for row in 0..rows {
                let left = &jacobian[row * unknowns + a * D..][..D];
                let right = &jacobian[row * unknowns + b * D..][..WIDTH];
                for d in 0..D {
                    let factor = L::F64::splat(left[d]);
                    for c in (0..WIDTH).step_by(L::F64::LANES) {
                        let sum = factor.mul_add::<L>(L::F64::load(&right[c..]), L::F64::load(&block[d][c..]));
                        sum.store(&mut block[d][c..]);
                    }
                }
            }
        }
    }
}
