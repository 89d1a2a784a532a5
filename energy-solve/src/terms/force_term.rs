use std::fmt::{self, Debug};
use std::sync::Arc;

use energy_dsl::{Array, Block, Declaration, ForceLaw, Kernel, Level, Potential, Value, Vector3, dispatch};

use crate::matrix::dof_map::DofMap;
use crate::matrix::pattern::{Pattern, index};
use crate::matrix::precision::Blocks;
use crate::matrix::vector::block_times;
use crate::terms::active::{Active, points_of};
use crate::terms::counts::Tally;
use crate::terms::element_list::ElementList;
use crate::terms::linearisation::Linearisation;
use crate::terms::restriction::Restriction;
use crate::terms::scatter_map::ScatterMap;
use crate::terms::state::State;
use crate::terms::stencils::Stencils;
use crate::terms::term::{Character, MadeFromTerm, PlacedTerm, Quantity, Term, TermDescription};

/// A method that evaluates an element's energy.
type ValueOf<E> = fn(&E, &<E as ForceLaw<f64>>::Points) -> Value<f64>;

/// A term with a force law f(x, v).
#[derive(Clone)]
pub struct ForceTerm<E: ForceLaw<f64>> {
    list: ElementList<E>,
    energy: Option<ValueOf<E>>,
}

impl<E: ForceLaw<f64>> ForceTerm<E> {
    /// Creates the sum of the forces of a list. The declaration determines its [`Character`].
    #[must_use]
    pub fn new(list: ElementList<E>) -> Self {
        Self { list, energy: None }
    }

    /// Reports the potential of the elements as the term's energy, for elements that have both (damped springs).
    #[must_use]
    pub fn with_energy(mut self) -> Self
    where
        E: Potential<f64, Points = <E as ForceLaw<f64>>::Points>,
    {
        self.energy = Some(<E as Potential<f64>>::value);
        self
    }
}

impl<E: ForceLaw<f64> + Debug> Debug for ForceTerm<E> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("ForceTerm").field("list", &self.list).finish_non_exhaustive()
    }
}

impl<E: ForceLaw<f64> + Debug + Send> TermDescription for ForceTerm<E> {
    fn name(&self) -> &str {
        self.list.name()
    }

    fn declaration(&self) -> &Declaration {
        E::DECLARATION
    }

    fn character(&self) -> Character {
        let Declaration { symmetric, velocity_dependent, quadratic, curved, .. } = *E::DECLARATION;
        Character { symmetric, velocity_dependent, quadratic, curved: curved || velocity_dependent }
    }

    fn stencils(&self) -> Stencils<'_> {
        self.list.stencils()
    }
}

impl<E: ForceLaw<f64> + Debug + Send + Sync + 'static> Term for ForceTerm<E> {
    fn place(self: Box<Self>, dofs: &DofMap, pattern: &Pattern) -> Box<dyn PlacedTerm> {
        let n = self.list.arity();
        let active = Active::new(self.list.stencils(), dofs);
        let (mut pairs, mut maps) = (Vec::new(), ScatterMap::default());
        if self.character().curved {
            pairs = (0..n).flat_map(|i| (0..n).map(move |j| (i, j))).collect();
            maps = ScatterMap::new(&active, self.list.stencils(), &pairs, dofs, pattern);
        }
        Box::new(PlacedForceTerm { term: self.into(), active, maps, pairs })
    }
}

/// A [`ForceTerm`] within a system.
#[derive(Debug)]
struct PlacedForceTerm<E: ForceLaw<f64>> {
    term: Arc<ForceTerm<E>>,
    active: Active,
    maps: ScatterMap,
    /// The pairs of points whose blocks are stored.
    pairs: Vec<(usize, usize)>,
}

impl<E: ForceLaw<f64>> PlacedForceTerm<E> {
    fn elements(&self) -> &[E] {
        self.term.list.elements()
    }

    fn stencil(&self, element: usize) -> &[u32] {
        self.term.list.stencil(element)
    }

    fn tally(&self, flagged: u64) -> Tally {
        let evaluated = self.active.len() as u64;
        Tally { evaluated, skipped: self.elements().len() as u64 - evaluated, flagged, projected: 0 }
    }

    fn value(&self, element: usize, x: &[Vector3<f64>]) -> Option<Value<f64>> {
        let value = self.term.energy?;
        Some(value(&self.elements()[element], &points_of(self.stencil(element), x)))
    }

    /// Adds an element's blocks to the matrix. If the pattern stores a pair of blocks as one, adds only the block that
    /// is not transposed.
    fn add_blocks(&self, number: usize, weight: f64, blocks: &[Block<f64>], matrix: &mut Blocks<'_>) {
        let slots = self.maps.of(number..number + 1);
        for (pair, block) in blocks.iter().enumerate() {
            if self.maps.transposed(number, pair) & 1 == 0 {
                matrix.add(slots[pair] as usize, weight, block);
            }
        }
    }
}

impl<E: ForceLaw<f64> + Debug + Send + Sync> MadeFromTerm for PlacedForceTerm<E> {
    fn term(&self) -> &dyn TermDescription {
        &*self.term
    }
}

impl<E: ForceLaw<f64> + Debug + Send + Sync + 'static> PlacedTerm for PlacedForceTerm<E> {
    fn restricted(&self, restriction: &Restriction<'_>) -> Option<Box<dyn PlacedTerm>> {
        let numbers = restriction.remaining(self.active.iter(), self.stencils());
        let active = Active::some(numbers.iter().map(|&number| index(self.active.element(number))).collect());
        let maps = self.maps.restricted(&numbers, restriction);
        Some(Box::new(Self { term: Arc::clone(&self.term), active, maps, pairs: self.pairs.clone() }))
    }

    fn dissipation(&self, state: State<'_>) -> Option<(f64, Tally)> {
        let evaluated = E::DECLARATION.velocity_dependent.then(|| dispatch(Dissipation { term: self, state }));
        evaluated.map(|(sum, flagged)| (sum, self.tally(flagged)))
    }

    fn has_energy(&self) -> bool {
        self.term.energy.is_some()
    }

    fn energy(&self, x: &[Vector3<f64>]) -> Option<(f64, Tally)> {
        let (mut sum, mut flagged) = (0.0, 0);
        for element in self.active.iter() {
            let result = self.value(element, x)?;
            sum += result.value;
            flagged += u64::from(result.flags.any());
        }
        self.has_energy().then(|| (sum, self.tally(flagged)))
    }

    fn element_energies(&self, x: &[Vector3<f64>]) -> Option<Vec<(usize, f64)>> {
        self.active.iter().map(|element| Some((element, self.value(element, x)?.value))).collect()
    }

    fn add_force(&self, state: State<'_>, force: &mut [Vector3<f64>]) -> Tally {
        self.tally(dispatch(Forces { term: self, state, force }))
    }

    fn add_linearisation(&self, State { x, v }: State<'_>, sum: &mut Linearisation<'_>) -> Tally {
        let mut flagged = 0;
        for (number, element) in self.active.iter().enumerate() {
            let stencil = self.stencil(element);
            let result = self.elements()[element].jacobians(&points_of(stencil, x), &points_of(stencil, v));
            add_vectors(stencil, result.force.as_ref(), sum.force);
            let by_position = result.by_position.as_ref();
            if E::DECLARATION.curved {
                self.add_blocks(number, sum.weights.position, by_position, &mut sum.matrix);
            }
            if E::DECLARATION.velocity_dependent {
                self.add_blocks(number, sum.weights.velocity, result.by_velocity.as_ref(), &mut sum.matrix);
            }
            if let Some(product) = &mut sum.stiffness_times_velocity {
                for (&(i, j), block) in self.pairs.iter().zip(by_position) {
                    add_vectors(&stencil[i..=i], &[block_times(block, &v[stencil[j] as usize])], product);
                }
            }
            flagged += u64::from(result.flags.any());
        }
        self.tally(flagged)
    }

    fn find_non_finite(&self, quantity: Quantity, State { x, v }: State<'_>) -> Option<usize> {
        let is_finite = |element: usize| match quantity {
            Quantity::Energy => self.value(element, x).is_none_or(|result| result.value.is_finite()),
            Quantity::Force => {
                let stencil = self.stencil(element);
                let result = self.elements()[element].force(&points_of(stencil, x), &points_of(stencil, v));
                result.force.as_ref().as_flattened().iter().all(|number| number.is_finite())
            }
        };
        self.active.iter().find(|&element| !is_finite(element))
    }
}

/// Computes Σ ½ (f(x, 0) − f(x, v)) · v and the number of flagged elements, in one loop per SIMD level.
struct Dissipation<'a, E: ForceLaw<f64>> {
    term: &'a PlacedForceTerm<E>,
    state: State<'a>,
}

impl<E: ForceLaw<f64>> Kernel for Dissipation<'_, E> {
    type Output = (f64, u64);

    #[inline(always)]
    fn run<L: Level>(self) -> (f64, u64) {
        let Self { term, state: State { x, v } } = self;
        let still = <E::Points as Array<Vector3<f64>>>::repeat([0.0; 3]);
        let (mut sum, mut flagged) = (0.0, 0);
        for element in term.active.iter() {
            let (law, stencil) = (&term.elements()[element], term.stencil(element));
            let (points, rates): (E::Points, E::Points) = (points_of(stencil, x), points_of(stencil, v));
            let (moving, at_rest) = (law.force_at::<L>(&points, &rates), law.force_at::<L>(&points, &still));
            let mut power = 0.0;
            for (point, rate) in rates.as_ref().iter().enumerate() {
                for axis in 0..3 {
                    power += (at_rest.force.as_ref()[point][axis] - moving.force.as_ref()[point][axis]) * rate[axis];
                }
            }
            sum += 0.5 * power;
            flagged += u64::from(moving.flags.any());
        }
        (sum, flagged)
    }
}

/// Adds forces and returns the number of flagged elements.
struct Forces<'a, 'b, E: ForceLaw<f64>> {
    term: &'a PlacedForceTerm<E>,
    state: State<'a>,
    force: &'b mut [Vector3<f64>],
}

impl<E: ForceLaw<f64>> Kernel for Forces<'_, '_, E> {
    type Output = u64;

    #[inline(always)]
    fn run<L: Level>(self) -> u64 {
        let Self { term, state: State { x, v }, force } = self;
        let mut flagged = 0;
        for element in term.active.iter() {
            let (law, stencil) = (&term.elements()[element], term.stencil(element));
            let result = law.force_at::<L>(&points_of(stencil, x), &points_of(stencil, v));
            add_vectors(stencil, result.force.as_ref(), force);
            flagged += u64::from(result.flags.any());
        }
        flagged
    }
}

#[inline(always)]
fn add_vectors(stencil: &[u32], vectors: &[Vector3<f64>], all: &mut [Vector3<f64>]) {
    for (&vertex, vector) in stencil.iter().zip(vectors) {
        for axis in 0..3 {
            all[vertex as usize][axis] += vector[axis];
        }
    }
}
