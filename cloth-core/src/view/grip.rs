use std::sync::{Arc, Mutex, PoisonError};

use energy_dsl::{Declaration, Element, Vector3};
use energy_elements::ZeroLengthSpring;
use energy_solve::{
    Character, DofMap, Linearisation, Pattern, PlacedTerm, Quantity, State, Stencils, Tally, Term, TermDescription,
    index,
};

use crate::model::{Anchor, IslandModel, TermLabel};

/// A soft pin for the mouse: pulls one vertex to a target by the declared [`ZeroLengthSpring`].
#[derive(Clone, Debug)]
pub(super) struct Grip {
    held: Arc<Mutex<Option<Held>>>,
    spring: ZeroLengthSpring,
}

#[derive(Clone, Copy, Debug)]
struct Held {
    vertex: usize,
    target: Vector3<f64>,
}

impl Grip {
    /// Elongation of the spring under the weight of the whole scene, in m.
    const STRETCH: f64 = 0.02;

    /// Creates a grip that is stiff enough for these masses, in kg.
    pub(super) fn carrying(masses: &[f64]) -> Self {
        let stiffness = 9.81 * masses.iter().sum::<f64>() / Self::STRETCH;
        Self { held: Arc::default(), spring: ZeroLengthSpring::new(stiffness, 0.0) }
    }

    /// Starts pulling a vertex to a target.
    pub(super) fn hold(&self, vertex: usize, target: Vector3<f64>) {
        self.set(Some(Held { vertex, target }));
    }

    /// The vertex that is held.
    pub(super) fn vertex(&self) -> Option<usize> {
        self.get().map(|held| held.vertex)
    }

    pub(super) fn release(&self) {
        self.set(None);
    }

    fn get(&self) -> Option<Held> {
        *self.held.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn set(&self, held: Option<Held>) {
        *self.held.lock().unwrap_or_else(PoisonError::into_inner) = held;
    }

    /// Label of the grip's terms.
    pub(super) fn label() -> TermLabel {
        TermLabel { name: NAME.to_owned(), element: <ZeroLengthSpring as Element>::DECLARATION.name.to_string() }
    }

    /// Adds the grip to the terms of an island.
    pub(super) fn add_to(&self, island: &mut IslandModel, label: usize) {
        let vertices = island.vertices.clone();
        let (stencils, slots) = ((0..index(vertices.len())).collect(), vec![None; vertices.len()]);
        island.terms.push(Box::new(GripTerm { grip: self.clone(), vertices, stencils, slots }));
        island.labels.push(label);
    }
}

const NAME: &str = "mouse";

/// The term of the grip on one island. It may act on any vertex, through a diagonal block, so that the matrix pattern
/// never changes.
#[derive(Debug)]
struct GripTerm {
    grip: Grip,
    /// Vertices of the island, as indices into the scene.
    vertices: Vec<usize>,
    stencils: Vec<u32>,
    /// Slot of the diagonal block of each vertex; `None` if it is pinned.
    slots: Vec<Option<usize>>,
}

impl GripTerm {
    /// Returns the spring to the target; `None` if nothing is held, or the vertex is pinned or elsewhere.
    fn anchor(&self) -> Option<Anchor> {
        let Held { vertex, target } = self.grip.get()?;
        let vertex = self.vertices.iter().position(|&own| own == vertex)?;
        Some(Anchor { vertex, slot: self.slots[vertex]?, place: target, spring: self.grip.spring })
    }

    fn tally(&self) -> Tally {
        let evaluated = u64::from(self.anchor().is_some());
        Tally { evaluated, skipped: self.stencils.len() as u64 - evaluated, flagged: 0, projected: 0 }
    }
}

impl TermDescription for GripTerm {
    fn name(&self) -> &str {
        NAME
    }

    fn declaration(&self) -> &Declaration {
        <ZeroLengthSpring as Element>::DECLARATION
    }

    fn character(&self) -> Character {
        Anchor::CHARACTER
    }

    fn stencils(&self) -> Stencils<'_> {
        Stencils::new(1, &self.stencils)
    }
}

impl Term for GripTerm {
    fn place(mut self: Box<Self>, dofs: &DofMap, pattern: &Pattern) -> Box<dyn PlacedTerm> {
        self.slots =
            self.stencils.iter().map(|&vertex| dofs.row(vertex as usize).map(|row| pattern.diagonal(row))).collect();
        self
    }
}

impl PlacedTerm for GripTerm {
    fn has_energy(&self) -> bool {
        true
    }

    fn energy(&self, x: &[Vector3<f64>]) -> Option<(f64, Tally)> {
        Some((self.anchor().map_or(0.0, |anchor| anchor.energy(x)), self.tally()))
    }

    fn add_force(&self, State { x, .. }: State<'_>, force: &mut [Vector3<f64>]) -> Tally {
        self.anchor().iter().for_each(|anchor| anchor.add_force(x, force));
        self.tally()
    }

    fn add_linearisation(&self, state: State<'_>, sum: &mut Linearisation<'_>) -> Tally {
        self.anchor().iter().for_each(|anchor| anchor.add_linearisation(state, sum));
        self.tally()
    }

    fn find_non_finite(&self, _quantity: Quantity, State { x, .. }: State<'_>) -> Option<usize> {
        self.anchor().filter(|anchor| !anchor.energy(x).is_finite()).map(|anchor| anchor.vertex)
    }
}
