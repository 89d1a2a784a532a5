//! Non-linear damping forces, declared as dissipation functions.

use std::fmt::Debug;
use std::sync::Arc;

use energy_dsl::{Declaration, Element, Packed, PackedPotential, Vector3};

use super::named_stencils::NamedStencils;
use super::placed::PlacedPotentialTerm;
use crate::matrix::dof_map::DofMap;
use crate::matrix::pattern::{Pattern, index};
use crate::terms::active::Active;
use crate::terms::counts::Tally;
use crate::terms::curvature::Curvature;
use crate::terms::linearisation::{Linearisation, Weights};
use crate::terms::restriction::Restriction;
use crate::terms::scatter_map::ScatterMaps;
use crate::terms::share::{Divisible, Share};
use crate::terms::state::{State, StepStart};
use crate::terms::stencils::Stencils;
use crate::terms::term::{Character, MadeFromTerm, PlacedTerm, Quantity, Term, TermDescription};

/// Selects the elements that act during a step. Their parameters are fixed at its start; only velocities vary.
pub trait DissipationLaw: Debug + Send + Sync {
    /// The element: a convex Rayleigh dissipation function, declared as an energy of the displacements per unit of
    /// time.
    type Element: PackedPotential<f64> + Debug + Send + Sync + 'static;
    /// Returns the elements that act on stencils with a free vertex, each with the index of its stencil, in ascending
    /// order.
    fn elements(&self, start: &StepStart<'_>, is_free: &[bool]) -> Vec<(usize, Self::Element)>;
}

/// The forces −∂R/∂v of dissipation functions R.
///
/// R is a potential of the velocities, so it is evaluated as a [`PotentialTerm`](crate::PotentialTerm) is: in SIMD
/// lanes, and by several threads.
#[derive(Debug)]
pub struct DissipationTerm<L> {
    law: L,
    on: NamedStencils,
}

impl<L: DissipationLaw> DissipationTerm<L> {
    /// Creates a term for a law whose element has N points. No element acts before the first step begins.
    #[must_use]
    pub fn new<const N: usize>(name: String, law: L, stencils: &[[usize; N]]) -> Self {
        Self { law, on: NamedStencils::new(name, stencils) }
    }
}

const CHARACTER: Character = Character { symmetric: true, velocity_dependent: true, quadratic: false, curved: true };

impl<L: DissipationLaw> TermDescription for DissipationTerm<L> {
    fn name(&self) -> &str {
        &self.on.name
    }

    fn declaration(&self) -> &Declaration {
        <L::Element as Element>::DECLARATION
    }

    fn character(&self) -> Character {
        CHARACTER
    }

    fn stencils(&self) -> Stencils<'_> {
        self.on.stencils()
    }
}

impl<L: DissipationLaw + 'static> Term for DissipationTerm<L> {
    fn place(self: Box<Self>, dofs: &DofMap, pattern: &Pattern) -> Box<dyn PlacedTerm> {
        let stencils = self.stencils();
        let is_free = |vertex: u32| dofs.row(vertex as usize).is_some();
        let is_free = stencils.iter().map(|mut stencil| stencil.any(is_free)).collect();
        let maps = ScatterMaps::of_all(stencils, dofs, pattern);
        let acting = acting::<L>(Vec::new(), &self, &maps);
        Box::new(PlacedDissipationTerm { term: self.into(), is_free, maps, shares: Vec::new(), acting })
    }
}

/// A [`DissipationTerm`] within a system.
#[derive(Debug)]
struct PlacedDissipationTerm<L: DissipationLaw> {
    term: Arc<DissipationTerm<L>>,
    /// Whether each stencil has a free vertex.
    is_free: Vec<bool>,
    /// ScatterMap of the blocks of all stencils.
    maps: ScatterMaps,
    shares: Vec<Share>,
    /// The elements that act during this step, as a potential of the velocities.
    acting: PlacedPotentialTerm<Packed<L::Element>>,
}

/// Packs the elements that act.
fn acting<L: DissipationLaw>(
    elements: Vec<(usize, L::Element)>,
    term: &DissipationTerm<L>,
    maps: &ScatterMaps,
) -> PlacedPotentialTerm<Packed<L::Element>> {
    let (numbers, elements): (Vec<usize>, Vec<L::Element>) = elements.into_iter().unzip();
    let maps = maps.of(&numbers);
    term.on.pack(&elements, Active::some(numbers.into_iter().map(index).collect()), maps)
}

/// The state in which velocities take the place of positions.
fn in_velocities(state: State<'_>) -> State<'_> {
    State { x: state.v, v: state.v }
}

impl<L: DissipationLaw> Divisible for PlacedDissipationTerm<L> {
    fn energy_parts(&self) -> usize {
        0
    }

    fn energy_part(&self, _: usize, _: &[Vector3<f64>]) -> (f64, Tally) {
        (0.0, Tally::default())
    }

    fn add_force_of(&self, share: &Share, state: State<'_>, force: &mut [Vector3<f64>]) -> Tally {
        self.acting.add_force_of(share, in_velocities(state), force)
    }

    fn add_linearisation_of(&self, share: &Share, state: State<'_>, sum: &mut Linearisation<'_>) -> Tally {
        self.acting.add_linearisation_of(share, in_velocities(state), &mut in_velocity_weights(sum))
    }
}

/// The sums for ∂f/∂v, which is the Jacobian of a potential of the velocities. A convex function needs no projection.
fn in_velocity_weights<'a>(sum: &'a mut Linearisation<'_>) -> Linearisation<'a> {
    Linearisation {
        weights: Weights { position: sum.weights.velocity, velocity: 0.0 },
        curvature: Curvature::Exact,
        matrix: sum.matrix.reborrow(),
        force: sum.force,
        stiffness_times_velocity: None,
    }
}

impl<L: DissipationLaw> MadeFromTerm for PlacedDissipationTerm<L> {
    fn term(&self) -> &dyn TermDescription {
        &*self.term
    }
}

impl<L: DissipationLaw + 'static> PlacedTerm for PlacedDissipationTerm<L> {
    /// The law selects elements at the start of a step, which the restriction does not outlive.
    fn restricted(&self, restriction: &Restriction<'_>) -> Option<Box<dyn PlacedTerm>> {
        let (term, acting) = (Arc::clone(&self.term), self.acting.restricted_to(restriction));
        let (is_free, maps, shares) = (Vec::new(), ScatterMaps::default(), Vec::new());
        Some(Box::new(Self { term, is_free, maps, shares, acting }))
    }

    fn begin_step(&mut self, start: StepStart<'_>) {
        let elements = self.term.law.elements(&start, &self.is_free);
        self.acting = acting(elements, &self.term, &self.maps);
        self.acting.divide(&self.shares);
    }

    fn divide(&mut self, shares: &[Share]) {
        shares.clone_into(&mut self.shares);
        self.acting.divide(shares);
    }

    fn divisible(&self) -> Option<&dyn Divisible> {
        Some(self)
    }

    fn dissipation(&self, State { v, .. }: State<'_>) -> Option<(f64, Tally)> {
        self.acting.energy(v)
    }

    fn has_energy(&self) -> bool {
        false
    }

    fn energy(&self, _: &[Vector3<f64>]) -> Option<(f64, Tally)> {
        None
    }

    fn add_force(&self, state: State<'_>, force: &mut [Vector3<f64>]) -> Tally {
        self.acting.add_force(in_velocities(state), force)
    }

    fn add_linearisation(&self, state: State<'_>, sum: &mut Linearisation<'_>) -> Tally {
        self.acting.add_linearisation(in_velocities(state), &mut in_velocity_weights(sum))
    }

    fn find_non_finite(&self, quantity: Quantity, state: State<'_>) -> Option<usize> {
        self.acting.find_non_finite(quantity, in_velocities(state))
    }
}
