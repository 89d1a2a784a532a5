use std::sync::{Arc, Mutex, PoisonError};

use energy_dsl::{Declaration, Element, Potential, Vector3};
use energy_elements::ZeroLengthSpring;
use energy_solve::{
    Character, DofMap, Linearisation, Pattern, PlacedTerm, Quantity, State, Stencils, Tally, Term, TermDescription,
    index,
};

use crate::geometry::dot;
use crate::model::{IslandModel, TermLabel};

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
        TermLabel { name: NAME.to_owned(), element: <ZeroLengthSpring as Element>::DECLARATION.name }
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
    /// Returns the held vertex, as an index within the island, with the slot of its block; `None` if it is pinned or
    /// elsewhere.
    fn held(&self) -> Option<(Held, usize)> {
        let held = self.grip.get()?;
        let vertex = self.vertices.iter().position(|&vertex| vertex == held.vertex)?;
        Some((Held { vertex, ..held }, self.slots[vertex]?))
    }

    fn tally(&self) -> Tally {
        let evaluated = u64::from(self.held().is_some());
        Tally { evaluated, skipped: self.stencils.len() as u64 - evaluated, flagged: 0, projected: 0 }
    }
}

impl TermDescription for GripTerm {
    fn name(&self) -> &str {
        NAME
    }

    fn declaration(&self) -> &'static Declaration {
        <ZeroLengthSpring as Element>::DECLARATION
    }

    fn character(&self) -> Character {
        Character { symmetric: true, velocity_dependent: false, quadratic: false, curved: true }
    }

    fn stencils(&self) -> Stencils<'_> {
        Stencils::new(1, &self.stencils)
    }
}

impl Term for GripTerm {
    fn place(mut self: Box<Self>, dofs: &DofMap, pattern: &Pattern) -> Box<dyn PlacedTerm> {
        self.slots =
            self.stencils.iter().map(|&vertex| dofs.place(vertex as usize).map(|row| pattern.diagonal(row))).collect();
        self
    }
}

impl PlacedTerm for GripTerm {
    fn has_energy(&self) -> bool {
        true
    }

    fn energy(&self, x: &[Vector3<f64>]) -> Option<(f64, Tally)> {
        let value = |(held, _): (Held, usize)| self.grip.spring.value(&[x[held.vertex], held.target]).value;
        Some((self.held().map_or(0.0, value), self.tally()))
    }

    fn add_force(&self, State { x, .. }: State<'_>, force: &mut [Vector3<f64>]) -> Tally {
        if let Some((Held { vertex, target }, _)) = self.held() {
            let gradient = self.grip.spring.gradient(&[x[vertex], target]).gradient[0];
            (0..3).for_each(|axis| force[vertex][axis] -= gradient[axis]);
        }
        self.tally()
    }

    /// The Hessian of a spring with rest length 0 is positive semi-definite, so projection changes nothing.
    fn add_linearisation(&self, State { x, v }: State<'_>, sum: &mut Linearisation<'_>) -> Tally {
        if let Some((Held { vertex, target }, slot)) = self.held() {
            let result = self.grip.spring.hessian(&[x[vertex], target]);
            let block = result.hessian.as_ref()[0];
            sum.matrix.add(slot, -sum.weights.position, &block);
            for i in 0..3 {
                sum.force[vertex][i] -= result.gradient[0][i];
                if let Some(product) = &mut sum.stiffness_times_velocity {
                    product[vertex][i] -= dot(block[i], v[vertex]);
                }
            }
        }
        self.tally()
    }

    fn find_non_finite(&self, _quantity: Quantity, State { x, .. }: State<'_>) -> Option<usize> {
        let (held, _) = self.held()?;
        let value = self.grip.spring.value(&[x[held.vertex], held.target]).value;
        (!value.is_finite()).then_some(held.vertex)
    }
}
