//! Tapes whose parameters a caller changes between evaluations.

use std::sync::{Arc, Mutex, PoisonError};

use energy_dsl::tape::TapeElements;
use energy_dsl::{Declaration, Vector3};

use super::TapeTerm;
use super::placed::PlacedPotentialTerm;
use super::tapes::TapePacks;
use crate::matrix::dof_map::DofMap;
use crate::matrix::pattern::Pattern;
use crate::terms::active::Active;
use crate::terms::counts::Tally;
use crate::terms::linearisation::Linearisation;
use crate::terms::places::BlockPlaces;
use crate::terms::restriction::Restriction;
use crate::terms::share::{Divisible, Share};
use crate::terms::state::{State, StepStart};
use crate::terms::stencils::Stencils;
use crate::terms::term::{Character, PlacedTerm, Quantity, Term, TermDescription};

/// The parameters of a [`SteeredTapeTerm`], shared between the term and its caller.
///
/// New elements take effect with the next start of a step; see [`System::begin_step`](crate::System::begin_step).
#[derive(Clone, Debug)]
pub struct SteeredTapes {
    shared: Arc<Mutex<(u64, TapeElements)>>,
}

impl SteeredTapes {
    /// Shares some elements.
    #[must_use]
    pub fn new(elements: TapeElements) -> Self {
        Self { shared: Arc::new(Mutex::new((0, elements))) }
    }

    /// Replaces the elements by others of the same declaration.
    ///
    /// # Panics
    /// If their number differs.
    pub fn replace(&self, elements: TapeElements) {
        let mut shared = self.shared.lock().unwrap_or_else(PoisonError::into_inner);
        assert_eq!(shared.1.len(), elements.len(), "parameters of another number of elements");
        *shared = (shared.0 + 1, elements);
    }

    /// Whether a term, or another copy of this, still shares the elements.
    #[must_use]
    pub fn is_shared(&self) -> bool {
        Arc::strong_count(&self.shared) > 1
    }

    /// Returns the number of replacements, and the elements.
    fn now(&self) -> (u64, TapeElements) {
        self.shared.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    fn version(&self) -> u64 {
        self.shared.lock().unwrap_or_else(PoisonError::into_inner).0
    }
}

/// A [`TapeTerm`] whose parameters change when its caller wants.
///
/// ```no_run
/// # use energy_dsl::{Declaration, tape::TapeElements};
/// # fn example(declaration: &'static Declaration, soft: TapeElements, stiff: TapeElements) {
/// use energy_solve::{SteeredTapeTerm, SteeredTapes};
///
/// let springs = SteeredTapes::new(soft);
/// let term = SteeredTapeTerm::new("springs".to_owned(), declaration, springs.clone(), [0, 1, 1, 2]);
/// springs.replace(stiff); // from the next step on
/// # drop(term);
/// # }
/// ```
#[derive(Debug)]
pub struct SteeredTapeTerm {
    term: TapeTerm,
    tapes: SteeredTapes,
}

impl SteeredTapeTerm {
    /// Creates the sum of the energies of some elements, as [`TapeTerm::new`] does.
    ///
    /// # Panics
    /// When the declaration is not an energy or constraint, or there are not as many stencils as elements.
    #[must_use]
    pub fn new(
        name: String,
        declaration: &'static Declaration,
        tapes: SteeredTapes,
        vertices: impl IntoIterator<Item = usize>,
    ) -> Self {
        Self { term: TapeTerm::new(name, declaration, tapes.now().1, vertices), tapes }
    }
}

impl TermDescription for SteeredTapeTerm {
    fn name(&self) -> &str {
        self.term.name()
    }

    fn declaration(&self) -> &'static Declaration {
        self.term.declaration()
    }

    fn character(&self) -> Character {
        Character { quadratic: false, ..self.term.character() }
    }

    fn stencils(&self) -> Stencils<'_> {
        self.term.stencils()
    }
}

impl Term for SteeredTapeTerm {
    fn place(self: Box<Self>, dofs: &DofMap, pattern: &Pattern) -> Box<dyn PlacedTerm> {
        let Self { term, tapes } = *self;
        let active = Active::new(term.stencils(), dofs);
        let places = match term.declaration.curved {
            true => BlockPlaces::new(&active, term.stencils(), dofs, pattern),
            false => BlockPlaces::default(),
        };
        let (seen, elements) = tapes.now();
        let now = renewed(&term, elements, &active, &places);
        Box::new(PlacedSteeredTerm { term, tapes, seen, active, places, shares: Vec::new(), now })
    }
}

/// Packs the active elements.
fn renewed(
    term: &TapeTerm,
    elements: TapeElements,
    active: &Active,
    places: &BlockPlaces,
) -> PlacedPotentialTerm<TapePacks> {
    let stencils = term.stencils();
    let vertex = |number: usize, point: usize| stencils.vertex(active.element(number), point);
    let count = elements.len();
    let elements = if active.is_all() { elements } else { elements.selected(&active.iter().collect::<Vec<_>>()) };
    let packed = TapePacks::new(term.declaration, elements, vertex);
    let all = (count, term.vertices.clone());
    PlacedPotentialTerm::in_places(term.name.clone(), all, (active.clone(), packed), places.clone())
}

/// A [`SteeredTapeTerm`] within a system.
#[derive(Debug)]
struct PlacedSteeredTerm {
    term: TapeTerm,
    tapes: SteeredTapes,
    /// The number of replacements when the elements were packed.
    seen: u64,
    active: Active,
    places: BlockPlaces,
    shares: Vec<Share>,
    now: PlacedPotentialTerm<TapePacks>,
}

impl TermDescription for PlacedSteeredTerm {
    fn name(&self) -> &str {
        self.term.name()
    }

    fn declaration(&self) -> &'static Declaration {
        self.term.declaration()
    }

    fn character(&self) -> Character {
        Character { quadratic: false, ..self.term.character() }
    }

    fn stencils(&self) -> Stencils<'_> {
        self.term.stencils()
    }
}

impl Divisible for PlacedSteeredTerm {
    fn energy_parts(&self) -> usize {
        self.now.energy_parts()
    }

    fn energy_part(&self, part: usize, x: &[Vector3<f64>]) -> (f64, Tally) {
        self.now.energy_part(part, x)
    }

    fn add_force_of(&self, share: &Share, state: State<'_>, force: &mut [Vector3<f64>]) -> Tally {
        self.now.add_force_of(share, state, force)
    }

    fn add_linearisation_of(&self, share: &Share, state: State<'_>, sum: &mut Linearisation<'_>) -> Tally {
        self.now.add_linearisation_of(share, state, sum)
    }
}

impl PlacedTerm for PlacedSteeredTerm {
    fn restricted(&self, restriction: &Restriction<'_>) -> Option<Box<dyn PlacedTerm>> {
        self.now.restricted(restriction)
    }

    fn begin_step(&mut self, _: StepStart<'_>) {
        if self.tapes.version() != self.seen {
            let (seen, elements) = self.tapes.now();
            self.now = renewed(&self.term, elements, &self.active, &self.places);
            self.now.divide(&self.shares);
            self.seen = seen;
        }
    }

    fn is_driven(&self) -> bool {
        true
    }

    fn varies(&self, _: f64, _: f64) -> bool {
        self.tapes.version() != self.seen
    }

    fn divide(&mut self, shares: &[Share]) {
        shares.clone_into(&mut self.shares);
        self.now.divide(shares);
    }

    fn divisible(&self) -> Option<&dyn Divisible> {
        Some(self)
    }

    fn has_energy(&self) -> bool {
        true
    }

    fn energy(&self, x: &[Vector3<f64>]) -> Option<(f64, Tally)> {
        self.now.energy(x)
    }

    fn energy_found(&self) -> Option<f64> {
        self.now.energy_found()
    }

    fn element_energies(&self, x: &[Vector3<f64>]) -> Option<Vec<(usize, f64)>> {
        self.now.element_energies(x)
    }

    fn add_force(&self, state: State<'_>, force: &mut [Vector3<f64>]) -> Tally {
        self.now.add_force(state, force)
    }

    fn add_linearisation(&self, state: State<'_>, sum: &mut Linearisation<'_>) -> Tally {
        self.now.add_linearisation(state, sum)
    }

    fn find_non_finite(&self, quantity: Quantity, state: State<'_>) -> Option<usize> {
        self.now.find_non_finite(quantity, state)
    }
}
