use std::fmt::{self, Debug};

use energy_dsl::{Array, Block, Declaration, ForceLaw, Kernel, Level, Potential, Value, Vector3, dispatch};

use crate::matrix::dof_map::DofMap;
use crate::matrix::pattern::Pattern;
use crate::matrix::precision::Blocks;
use crate::matrix::vector::block_times;
use crate::terms::active::{Active, points_of};
use crate::terms::counts::Tally;
use crate::terms::element_list::ElementList;
use crate::terms::places::Places;
use crate::terms::stencils::Stencils;
use crate::terms::term::{Character, Linearisation, Quantity, State, Term};

/// A method that evaluates an element's energy.
type ValueOf<E> = fn(&E, &<E as ForceLaw<f64>>::Points) -> Value<f64>;

/// A term with a force law f(x, v).
#[derive(Clone)]
pub struct ForceTerm<E: ForceLaw<f64>> {
    list: ElementList<E>,
    energy: Option<ValueOf<E>>,
    active: Active,
    places: Places,
    /// The pairs of points whose blocks are stored.
    pairs: Vec<(usize, usize)>,
}

impl<E: ForceLaw<f64>> ForceTerm<E> {
    /// The sum of the forces of a list. What they depend on, and whether conjugate gradients may be used, is what the declaration
    /// proves.
    #[must_use]
    pub fn new(list: ElementList<E>) -> Self {
        Self { list, energy: None, active: Active::default(), places: Places::default(), pairs: Vec::new() }
    }

    /// Reports the potential of the elements (damped springs have one) as the term's energy.
    #[must_use]
    pub fn with_energy(mut self) -> Self
    where
        E: Potential<f64, Points = <E as ForceLaw<f64>>::Points>,
    {
        self.energy = Some(<E as Potential<f64>>::value);
        self
    }

    fn tally(&self, flagged: u64) -> Tally {
        let evaluated = self.active.len() as u64;
        Tally { evaluated, skipped: self.list.elements().len() as u64 - evaluated, flagged, projected: 0 }
    }

    fn value(&self, element: usize, x: &[Vector3<f64>]) -> Option<Value<f64>> {
        let value = self.energy?;
        Some(value(&self.list.elements()[element], &points_of(self.list.stencil(element), x)))
    }
}

impl<E: ForceLaw<f64> + Debug> Debug for ForceTerm<E> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("ForceTerm").field("list", &self.list).finish_non_exhaustive()
    }
}

impl<E: ForceLaw<f64> + Debug> Term for ForceTerm<E> {
    fn name(&self) -> &str {
        self.list.name()
    }

    fn declaration(&self) -> &'static Declaration {
        E::DECLARATION
    }

    fn character(&self) -> Character {
        let Declaration { symmetric, velocity_dependent, quadratic, curved, .. } = *E::DECLARATION;
        Character { symmetric, velocity_dependent, quadratic, curved: curved || velocity_dependent }
    }

    fn stencils(&self) -> Stencils<'_> {
        self.list.stencils()
    }

    fn place(&mut self, dofs: &DofMap, pattern: &Pattern) {
        let n = self.list.arity();
        self.active = Active::new(self.list.stencils(), dofs);
        if self.character().curved {
            self.pairs = (0..n).flat_map(|i| (0..n).map(move |j| (i, j))).collect();
            self.places = Places::new(&self.active, self.list.stencils(), &self.pairs, dofs, pattern);
        }
    }

    fn dissipation(&self, state: State<'_>) -> Option<(f64, Tally)> {
        let evaluated = E::DECLARATION.velocity_dependent.then(|| dispatch(Dissipation { term: self, state }));
        evaluated.map(|(sum, flagged)| (sum, self.tally(flagged)))
    }

    fn has_energy(&self) -> bool {
        self.energy.is_some()
    }

    fn energy(&self, x: &[Vector3<f64>]) -> Option<(f64, Tally)> {
        let (mut sum, mut flagged) = (0.0, 0);
        for element in self.active.iter() {
            let result = self.value(element, x)?;
            sum += result.value;
            flagged += u64::from(result.flags.any());
        }
        self.energy.is_some().then(|| (sum, self.tally(flagged)))
    }

    fn element_energies(&self, x: &[Vector3<f64>]) -> Option<Vec<(usize, f64)>> {
        self.active.iter().map(|number| Some((number, self.value(number, x)?.value))).collect()
    }

    fn add_force(&self, state: State<'_>, force: &mut [Vector3<f64>]) -> Tally {
        self.tally(dispatch(Forces { term: self, state, force }))
    }

    fn add_linearisation(&self, State { x, v }: State<'_>, sum: &mut Linearisation<'_>) -> Tally {
        let mut flagged = 0;
        for (number, element) in self.active.iter().enumerate() {
            let stencil = self.list.stencil(element);
            let result = self.list.elements()[element].jacobians(&points_of(stencil, x), &points_of(stencil, v));
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
                let stencil = self.list.stencil(element);
                let result = self.list.elements()[element].force(&points_of(stencil, x), &points_of(stencil, v));
                result.force.as_ref().as_flattened().iter().all(|number| number.is_finite())
            }
        };
        self.active.iter().find(|&element| !is_finite(element))
    }
}

/// Σ ½ (f(x, 0) − f(x, v)) · v, and how many elements were flagged: a loop compiled for the level.
struct Dissipation<'a, E: ForceLaw<f64>> {
    term: &'a ForceTerm<E>,
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
            let (law, stencil) = (&term.list.elements()[element], term.list.stencil(element));
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

/// Adds forces, and returns how many elements were flagged.
struct Forces<'a, 'b, E: ForceLaw<f64>> {
    term: &'a ForceTerm<E>,
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
            let (law, stencil) = (&term.list.elements()[element], term.list.stencil(element));
            let result = law.force_at::<L>(&points_of(stencil, x), &points_of(stencil, v));
            add_vectors(stencil, result.force.as_ref(), force);
            flagged += u64::from(result.flags.any());
        }
        flagged
    }
}

impl<E: ForceLaw<f64>> ForceTerm<E> {
    /// Adds an element's blocks to the matrix: of two that are stored as one, the one that is not turned.
    fn add_blocks(&self, number: usize, weight: f64, blocks: &[Block<f64>], matrix: &mut Blocks<'_>) {
        let slots = self.places.of(number..number + 1);
        for (pair, block) in blocks.iter().enumerate() {
            if self.places.turned(number, pair) & 1 == 0 {
                matrix.add(slots[pair] as usize, weight, block);
            }
        }
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
