use std::fmt::Debug;
use std::sync::Arc;

use energy_dsl::{Array, BLOCK, Declaration, Kernel, Lane, Level, Mask, Number, PackedResidual, Residual, dispatch};

use crate::loss::Loss;
use crate::normal_matrix::{Couplings, NormalMatrix, WIDTH, WideBlock};

/// What a term adds up to.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TermSum {
    /// λ Σ w ρ(‖r‖²).
    pub energy: f64,
    /// Elements that met a singularity. They are left out of every sum.
    pub degenerate: usize,
}

/// JᵀJ and Jᵀr of all terms, rows multiplied by the roots of their weights. Half the gradient of the energy is Jᵀr.
#[derive(Clone, Debug)]
pub struct NormalEquations<const D: usize> {
    /// JᵀJ.
    pub matrix: NormalMatrix<D>,
    /// Jᵀr.
    pub right: Vec<[f64; D]>,
}

impl<const D: usize> NormalEquations<D> {
    /// Sets both to zero.
    pub fn clear(&mut self) {
        self.matrix.clear();
        self.right.fill([0.0; D]);
    }
}

/// A sum of squared residuals over blocks of D unknowns.
pub trait LeastSquaresTerm<const D: usize>: Debug {
    /// What it stands for.
    fn name(&self) -> &str;
    /// The declaration of its elements.
    fn declaration(&self) -> &'static Declaration;
    /// How many elements it has.
    fn len(&self) -> usize;
    /// Whether it has none.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }
    /// Its energy.
    fn energy(&self, x: &[[f64; D]]) -> TermSum;
    /// Its energy; adds JᵀJ and Jᵀr.
    fn linearise(&self, x: &[[f64; D]], equations: &mut NormalEquations<D>) -> TermSum;
    /// The first element whose energy is not finite.
    fn find_non_finite(&self, x: &[[f64; D]]) -> Option<usize>;
}

/// An element on one of the stencils of a term's [`Couplings`].
#[derive(Clone, Copy, Debug)]
pub struct Placed<E> {
    /// The element.
    pub element: E,
    /// Which stencil.
    pub stencil: u32,
    /// w ≥ 0, which multiplies its squared residual.
    pub weight: f64,
}

/// Residuals of one type, E = λ Σ w ρ(‖r‖²): packed into lanes, on stencils that were looked up once.
#[derive(Clone, Debug)]
pub struct ResidualTerm<E, const D: usize> {
    name: String,
    couplings: Arc<Couplings>,
    /// λ.
    pub lambda: f64,
    /// ρ.
    pub loss: Loss,
    /// By block of elements, number, element.
    numbers: Vec<f64>,
    stencils: Vec<u32>,
    weights: Vec<f64>,
    of: std::marker::PhantomData<E>,
}

impl<E: PackedResidual<f64> + Debug, const D: usize> ResidualTerm<E, D> {
    /// A term without elements.
    ///
    /// # Panics
    /// When the stencils' blocks have not as many unknowns as the residual (a bug in the caller).
    #[must_use]
    pub fn new(name: impl Into<String>, couplings: Arc<Couplings>, lambda: f64) -> Self {
        let (unknowns, blocks) = (<E as Residual<f64>>::Unknowns::LEN, couplings.arity());
        assert_eq!(unknowns, blocks * D, "{} has {unknowns} unknowns, {blocks} blocks of {D}", E::DECLARATION.name);
        Self {
            name: name.into(),
            couplings,
            lambda,
            loss: Loss::Squares,
            numbers: Vec::new(),
            stencils: Vec::new(),
            weights: Vec::new(),
            of: std::marker::PhantomData,
        }
    }

    /// Replaces all elements, keeping the memory.
    ///
    /// # Panics
    /// When an element's stencil is not among the couplings.
    pub fn set_elements(&mut self, elements: impl IntoIterator<Item = Placed<E>>) {
        self.numbers.clear();
        self.stencils.clear();
        self.weights.clear();
        let mut last = None;
        for (place, Placed { element, stencil, weight }) in elements.into_iter().enumerate() {
            assert!((stencil as usize) < self.couplings.len(), "stencil {stencil} of {}", self.couplings.len());
            if place % BLOCK == 0 {
                self.numbers.resize(self.numbers.len() + Self::BLOCK_NUMBERS, 0.0);
            }
            self.write(place, &element);
            self.stencils.push(stencil);
            self.weights.push(weight);
            last = Some(element);
        }
        if let Some(element) = last {
            // Lanes left over repeat the last element.
            let places = self.stencils.len();
            (places..places.next_multiple_of(BLOCK)).for_each(|place| self.write(place, &element));
        }
    }

    /// Numbers of a block of elements; elements without any take up room nevertheless, so that they have places.
    const BLOCK_NUMBERS: usize = BLOCK * if E::NUMBERS == 0 { 1 } else { E::NUMBERS };

    fn write(&mut self, place: usize, element: &E) {
        element.store(&mut self.numbers[place / BLOCK * Self::BLOCK_NUMBERS + place % BLOCK..], BLOCK);
    }

    /// Calls `take` with each element's number, r and J (row by row, without weights): for tests, and those who want J itself.
    pub fn for_each_jacobian(&self, x: &[[f64; D]], mut take: impl FnMut(usize, &[f64], &[f64])) {
        let (rows, unknowns) = (Self::rows(), self.couplings.arity() * D);
        dispatch(Jacobians {
            term: self,
            x,
            work: |element: usize, residual: &[f64], jacobian: &[f64]| {
                take(element, residual, &jacobian[..rows * unknowns]);
            },
        });
    }

    /// Computes all Jacobians, keeps none, and returns the sum of the residuals: what derivatives alone cost.
    #[must_use]
    pub fn evaluate_jacobians(&self, x: &[[f64; D]]) -> f64 {
        let mut sum = 0.0;
        dispatch(Jacobians {
            term: self,
            x,
            work: |_: usize, residual: &[f64], jacobian: &[f64]| {
                sum += residual[0] + std::hint::black_box(jacobian)[0];
            },
        });
        sum
    }

    /// All residuals without weights, element by element.
    #[must_use]
    pub fn residuals(&self, x: &[[f64; D]]) -> Vec<f64> {
        dispatch(Residuals { term: self, x })
    }

    /// The weight of an element, λ w, without that of the loss.
    #[must_use]
    pub fn weight(&self, element: usize) -> f64 {
        self.lambda * self.weights[element]
    }

    /// The blocks of unknowns that an element acts on.
    #[must_use]
    pub fn stencil(&self, element: usize) -> &[u32] {
        self.couplings.stencil(self.stencils[element] as usize)
    }

    fn rows() -> usize {
        <E as Residual<f64>>::Rows::LEN
    }

    #[inline(always)]
    fn load<L: Level>(&self, first: usize) -> E::Wide<L::F64> {
        E::load::<L::F64>(&self.numbers[first / BLOCK * Self::BLOCK_NUMBERS + first % BLOCK..], BLOCK)
    }

    /// The unknowns of as many elements as there are lanes.
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

impl<E: PackedResidual<f64> + Debug, const D: usize> LeastSquaresTerm<D> for ResidualTerm<E, D> {
    fn name(&self) -> &str {
        &self.name
    }

    fn declaration(&self) -> &'static Declaration {
        E::DECLARATION
    }

    fn len(&self) -> usize {
        self.stencils.len()
    }

    fn energy(&self, x: &[[f64; D]]) -> TermSum {
        dispatch(Energies { term: self, x, each: |_: usize, _: f64| {} })
    }

    fn linearise(&self, x: &[[f64; D]], equations: &mut NormalEquations<D>) -> TermSum {
        dispatch(Assembly { term: self, x, equations })
    }

    fn find_non_finite(&self, x: &[[f64; D]]) -> Option<usize> {
        let mut found = None;
        dispatch(Energies {
            term: self,
            x,
            each: |element: usize, energy: f64| {
                if !energy.is_finite() && found.is_none() {
                    found = Some(element);
                }
            },
        });
        found
    }
}

/// Values only.
struct Energies<'a, E, F, const D: usize> {
    term: &'a ResidualTerm<E, D>,
    x: &'a [[f64; D]],
    each: F,
}

impl<E: PackedResidual<f64> + Debug, F: FnMut(usize, f64), const D: usize> Kernel for Energies<'_, E, F, D> {
    type Output = TermSum;

    #[inline(always)]
    fn run<L: Level>(mut self) -> TermSum {
        let (term, lanes, mut first) = (self.term, L::F64::LANES, 0);
        let (mut energy, mut degenerate) = (0.0, 0);
        while first < term.stencils.len() {
            let result = term.load::<L>(first).residual_at::<L>(&term.gather::<L>(first, self.x));
            let mut square = L::F64::splat(0.0);
            for &row in result.value.as_ref() {
                square = square + row * row;
            }
            for lane in 0..lanes.min(term.stencils.len() - first) {
                if result.flags.degenerate.lane(lane) {
                    degenerate += 1;
                    continue;
                }
                let one = term.weights[first + lane] * term.loss.of(square.extract(lane)).0;
                (self.each)(first + lane, one);
                energy += one;
            }
            first += lanes;
        }
        TermSum { energy: term.lambda * energy, degenerate }
    }
}

/// Residuals only.
struct Residuals<'a, E, const D: usize> {
    term: &'a ResidualTerm<E, D>,
    x: &'a [[f64; D]],
}

impl<E: PackedResidual<f64> + Debug, const D: usize> Kernel for Residuals<'_, E, D> {
    type Output = Vec<f64>;

    #[inline(always)]
    fn run<L: Level>(self) -> Vec<f64> {
        let (term, rows) = (self.term, ResidualTerm::<E, D>::rows());
        let mut all = vec![0.0; rows * term.stencils.len()];
        for first in (0..term.stencils.len()).step_by(L::F64::LANES) {
            let count = L::F64::LANES.min(term.stencils.len() - first);
            let result = term.load::<L>(first).residual_at::<L>(&term.gather::<L>(first, self.x));
            L::F64::store_transposed(result.value.as_ref(), count, &mut all[rows * first..], rows);
        }
        all
    }
}

/// J of one element after the other.
struct Jacobians<'a, E, F, const D: usize> {
    term: &'a ResidualTerm<E, D>,
    x: &'a [[f64; D]],
    work: F,
}

impl<E: PackedResidual<f64> + Debug, F: FnMut(usize, &[f64], &[f64]), const D: usize> Kernel
    for Jacobians<'_, E, F, D>
{
    type Output = ();

    #[inline(always)]
    fn run<L: Level>(mut self) {
        let term = self.term;
        let (rows, unknowns) = (ResidualTerm::<E, D>::rows(), term.couplings.arity() * D);
        let (lanes, mut first) = (L::F64::LANES, 0);
        let mut residuals = vec![0.0; lanes * rows];
        let mut jacobians = vec![0.0; lanes * rows * unknowns + WIDTH];
        while first < term.stencils.len() {
            let count = lanes.min(term.stencils.len() - first);
            let result = term.load::<L>(first).jacobian_at::<L>(&term.gather::<L>(first, self.x));
            L::F64::store_transposed(result.value.as_ref(), count, &mut residuals, rows);
            L::F64::store_transposed(result.jacobian.as_ref(), count, &mut jacobians, rows * unknowns);
            for lane in 0..count {
                let jacobian = &jacobians[lane * rows * unknowns..];
                (self.work)(first + lane, &residuals[lane * rows..][..rows], jacobian);
            }
            first += lanes;
        }
    }
}

/// JᵀJ and Jᵀr.
struct Assembly<'a, E, const D: usize> {
    term: &'a ResidualTerm<E, D>,
    x: &'a [[f64; D]],
    equations: &'a mut NormalEquations<D>,
}

impl<E: PackedResidual<f64> + Debug, const D: usize> Kernel for Assembly<'_, E, D> {
    type Output = TermSum;

    #[inline(always)]
    fn run<L: Level>(self) -> TermSum {
        let (term, equations) = (self.term, self.equations);
        let (rows, unknowns) = (ResidualTerm::<E, D>::rows(), term.couplings.arity() * D);
        let (lanes, mut first) = (L::F64::LANES, 0);
        let mut residuals = vec![0.0; lanes * rows];
        // A block's row is read as a whole register, which reaches past the end of the last block.
        let mut jacobians = vec![0.0; lanes * rows * unknowns + WIDTH];
        let (mut energy, mut degenerate) = (0.0, 0);
        while first < term.stencils.len() {
            let count = lanes.min(term.stencils.len() - first);
            let result = term.load::<L>(first).jacobian_at::<L>(&term.gather::<L>(first, self.x));
            L::F64::store_transposed(result.value.as_ref(), count, &mut residuals, rows);
            L::F64::store_transposed(result.jacobian.as_ref(), count, &mut jacobians, rows * unknowns);
            for lane in 0..count {
                if result.flags.degenerate.lane(lane) {
                    degenerate += 1;
                    continue;
                }
                let element = first + lane;
                let residual = &mut residuals[lane * rows..][..rows];
                let jacobian = &mut jacobians[lane * rows * unknowns..][..rows * unknowns + WIDTH];
                let square: f64 = residual.iter().map(|r| r * r).sum();
                let (loss, slope) = term.loss.of(square);
                energy += term.weights[element] * loss;
                let weight = term.lambda * term.weights[element] * slope;
                if weight == 0.0 {
                    continue;
                }
                let root = weight.sqrt();
                residual.iter_mut().for_each(|r| *r *= root);
                jacobian[..rows * unknowns].iter_mut().for_each(|entry| *entry *= root);
                let at = term.stencils[element] as usize;
                add_right::<D>(&mut equations.right, term.couplings.stencil(at), residual, jacobian, unknowns);
                add_products::<L, D>(
                    &mut equations.matrix.values,
                    term.couplings.slots(at),
                    term.couplings.arity(),
                    (rows, unknowns),
                    jacobian,
                );
            }
            first += lanes;
        }
        TermSum { energy: term.lambda * energy, degenerate }
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

/// Adds JᵀJ of one element, pair of blocks by pair of blocks.
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
            let &slot = slots.next().expect("a place for each pair");
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
