//! Terms whose elements are evaluated by a function of the caller, all at once.

use std::fmt::Debug;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use energy_dsl::{Block, Declaration, Vector3, triangle_index};

use crate::matrix::dof_map::DofMap;
use crate::matrix::pattern::Pattern;
use crate::matrix::vector::block_times;
use crate::terms::counts::Tally;
use crate::terms::curvature::{Curvature, change_dense, is_semi_definite};
use crate::terms::linearisation::Linearisation;
use crate::terms::state::{State, StepStart};
use crate::terms::stencils::Stencils;
use crate::terms::term::{Character, MadeFromTerm, PlacedTerm, Quantity, Term, TermDescription};

/// The results that an [`OwnLaw`] is asked for. Each includes those before it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Order {
    /// Energies of the elements.
    Energy,
    /// Energies and forces.
    Force,
    /// Energies, forces and Jacobians.
    Jacobians,
}

/// Results of n elements with p points each, one element after the other. They are zero when a law is asked for them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct OwnResults {
    /// U of each element, in J; unused by force laws.
    pub energies: Vec<f64>,
    /// f of each point, in N: 3 p numbers per element. For an energy, f = −∂U/∂x.
    pub forces: Vec<f64>,
    /// ∂f/∂x, row by row: 3 p × 3 p numbers per element. For an energy, −∂²U/∂x².
    pub by_position: Vec<f64>,
    /// ∂f/∂v, row by row; unused by laws that do not depend on velocities.
    pub by_velocity: Vec<f64>,
    /// Number of elements at inputs where the formula has no unique derivative.
    pub flagged: u64,
}

/// A force or an energy of all elements of a term, as a function of the positions and velocities of their points.
pub trait OwnLaw: Debug + Send + Sync {
    /// The declaration of one element.
    fn declaration(&self) -> &Declaration;
    /// The number of vertices of one element.
    fn points(&self) -> usize {
        self.declaration().points.len()
    }
    /// The properties of the force.
    fn character(&self) -> Character;
    /// Whether the force is −∂U/∂x.
    fn has_energy(&self) -> bool;
    /// Writes the results of an order. `x` and `v` hold the points of one element after the other, 3 p numbers each.
    fn evaluate(&self, order: Order, x: &[f64], v: &[f64], results: &mut OwnResults);
    /// Notes the state at the start of a step, for a law that stays fixed over the step. `x` and `v` are as in
    /// [`OwnLaw::evaluate`].
    fn begin_step(&mut self, _x: &[f64], _v: &[f64]) {}
    /// Whether the force at fixed positions and velocities may have changed since the last step. Islands that it acts
    /// on then do not sleep.
    fn varies(&self) -> bool {
        false
    }
}

/// A term of an [`OwnLaw`]. All elements are evaluated, also those whose vertices are pinned.
#[derive(Debug)]
pub struct OwnTerm<L> {
    name: String,
    law: L,
    vertices: Vec<u32>,
}

impl<L: OwnLaw> OwnTerm<L> {
    /// Creates a term; the stencils of its elements follow each other.
    ///
    /// # Panics
    /// If the last stencil is incomplete.
    #[must_use]
    pub fn new(name: String, law: L, vertices: Vec<u32>) -> Self {
        let points = law.points();
        assert!(vertices.len().is_multiple_of(points), "{name}: every element has {points} vertices");
        Self { name, law, vertices }
    }
}

impl<L: OwnLaw> TermDescription for OwnTerm<L> {
    fn name(&self) -> &str {
        &self.name
    }

    fn declaration(&self) -> &Declaration {
        self.law.declaration()
    }

    fn character(&self) -> Character {
        // A caller may change the law between steps, so its Jacobians are never kept.
        Character { quadratic: false, ..self.law.character() }
    }

    fn stencils(&self) -> Stencils<'_> {
        Stencils::new(self.law.points(), &self.vertices)
    }
}

impl<L: OwnLaw + 'static> Term for OwnTerm<L> {
    fn place(self: Box<Self>, dofs: &DofMap, pattern: &Pattern) -> Box<dyn PlacedTerm> {
        let curved = self.character().curved;
        let (n, stencils) = (self.stencils().arity(), self.stencils());
        let row = |element: usize, point: usize| dofs.row(stencils.vertex(element, point) as usize);
        let mut slots = Vec::new();
        for element in 0..if curved { stencils.len() } else { 0 } {
            for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
                let found = row(element, i).zip(row(element, j)).and_then(|(i, j)| pattern.slot(i, j));
                slots.push(found.and_then(|(slot, transposed)| (!transposed).then_some(slot)));
            }
        }
        let found = AtomicU64::new(f64::NAN.to_bits());
        Box::new(PlacedOwnTerm { term: *self, slots, found })
    }
}

/// An [`OwnTerm`] within a system.
#[derive(Debug)]
struct PlacedOwnTerm<L> {
    term: OwnTerm<L>,
    /// Index of the block of each pair of points of each element; `None` if a point is pinned, or if the matrix stores
    /// the transposed block.
    slots: Vec<Option<usize>>,
    /// Σ U at the last evaluation of forces, as bits.
    found: AtomicU64,
}

impl<L: OwnLaw> PlacedOwnTerm<L> {
    fn points(&self) -> usize {
        self.term.law.points()
    }

    fn count(&self) -> usize {
        self.term.vertices.len() / self.points()
    }

    fn gathered(&self, all: &[Vector3<f64>]) -> Vec<f64> {
        let mut numbers = Vec::with_capacity(3 * self.term.vertices.len());
        self.term.vertices.iter().for_each(|&vertex| numbers.extend_from_slice(&all[vertex as usize]));
        numbers
    }

    fn evaluated(&self, order: Order, state: State<'_>) -> OwnResults {
        let (n, coordinates) = (self.count(), 3 * self.points());
        let Character { curved, velocity_dependent, .. } = self.term.law.character();
        let zeros = |wanted: bool, size: usize| if wanted { vec![0.0; n * size] } else { Vec::new() };
        let jacobians = order == Order::Jacobians;
        let mut results = OwnResults {
            energies: zeros(self.term.law.has_energy(), 1),
            forces: zeros(order >= Order::Force, coordinates),
            by_position: zeros(jacobians && curved, coordinates * coordinates),
            by_velocity: zeros(jacobians && velocity_dependent, coordinates * coordinates),
            flagged: 0,
        };
        let v = if velocity_dependent { self.gathered(state.v) } else { Vec::new() };
        self.term.law.evaluate(order, &self.gathered(state.x), &v, &mut results);
        let energy: f64 = results.energies.iter().sum();
        if order >= Order::Force {
            self.found.store(energy.to_bits(), Relaxed);
        }
        results
    }

    fn tally(&self, flagged: u64) -> Tally {
        Tally { evaluated: self.count() as u64, flagged, ..Tally::default() }
    }

    fn scatter(&self, numbers: &[f64], force: &mut [Vector3<f64>]) {
        for (&vertex, point) in self.term.vertices.iter().zip(numbers.as_chunks::<3>().0) {
            for axis in 0..3 {
                force[vertex as usize][axis] += point[axis];
            }
        }
    }

    /// Adds weighted blocks of all elements to the matrix.
    fn add_blocks(&self, numbers: &[f64], weight: f64, sum: &mut Linearisation<'_>) {
        let n = self.points();
        for (element, matrix) in numbers.chunks_exact(9 * n * n).enumerate() {
            for (pair, slot) in self.slots[element * n * n..][..n * n].iter().enumerate() {
                if let Some(slot) = slot {
                    sum.matrix.add(*slot, weight, &block(matrix, n, pair / n, pair % n));
                }
            }
        }
    }

    /// Makes the Hessians −∂f/∂x positive semi-definite. Returns how many were changed.
    fn project(&self, by_position: &mut [f64], curvature: Curvature) -> u64 {
        let n = self.points();
        if curvature == Curvature::Exact || !self.term.law.has_energy() {
            return 0;
        }
        let mut projected = 0;
        let mut triangle = vec![[[0.0; 3]; 3]; n * (n + 1) / 2];
        for matrix in by_position.chunks_exact_mut(9 * n * n) {
            if is_convex(matrix, 3 * n) {
                continue;
            }
            for (i, j) in (0..n).flat_map(|i| (i..n).map(move |j| (i, j))) {
                triangle[triangle_index(n, i, j)] = block(matrix, n, i, j).map(|row| row.map(|entry| -entry));
            }
            if !change_dense(&mut triangle, n, curvature) {
                continue;
            }
            projected += 1;
            for (i, j) in (0..n).flat_map(|i| (i..n).map(move |j| (i, j))) {
                let changed = triangle[triangle_index(n, i, j)];
                for (row, column) in (0..9).map(|entry| (entry / 3, entry % 3)) {
                    let entry = -changed[row][column];
                    matrix[(3 * i + row) * 3 * n + 3 * j + column] = entry;
                    matrix[(3 * j + column) * 3 * n + 3 * i + row] = entry;
                }
            }
        }
        projected
    }
}

/// Whether −∂f/∂x, with ∂f/∂x row by row, has no negative eigenvalue, up to rounding.
fn is_convex(by_position: &[f64], size: usize) -> bool {
    let entries = (0..size).flat_map(|i| (i..size).map(move |j| (i, j)));
    let upper: Vec<f64> = entries.map(|(i, j)| -by_position[i * size + j]).collect();
    is_semi_definite(&upper, size)
}

/// Returns block (i, j) of an element's matrix of 3 n × 3 n numbers.
fn block(matrix: &[f64], n: usize, i: usize, j: usize) -> Block<f64> {
    std::array::from_fn(|row| std::array::from_fn(|column| matrix[(3 * i + row) * 3 * n + 3 * j + column]))
}

impl<L: OwnLaw> MadeFromTerm for PlacedOwnTerm<L> {
    fn term(&self) -> &dyn TermDescription {
        &self.term
    }
}

impl<L: OwnLaw> PlacedTerm for PlacedOwnTerm<L> {
    fn begin_step(&mut self, start: StepStart<'_>) {
        let (x, v) = (self.gathered(start.state.x), self.gathered(start.state.v));
        self.term.law.begin_step(&x, &v);
    }

    fn is_driven(&self) -> bool {
        true
    }

    fn varies(&self, _from: f64, _to: f64) -> bool {
        self.term.law.varies()
    }

    fn dissipation(&self, state: State<'_>) -> Option<(f64, Tally)> {
        if !self.character().velocity_dependent {
            return None;
        }
        let still = vec![[0.0; 3]; state.v.len()];
        let moving = self.evaluated(Order::Force, state);
        let at_rest = self.evaluated(Order::Force, State { x: state.x, v: &still });
        let rates = self.gathered(state.v);
        let lost = moving.forces.iter().zip(&at_rest.forces).zip(&rates).map(|((f, still), v)| (still - f) * v);
        Some((0.5 * lost.sum::<f64>(), self.tally(moving.flagged)))
    }

    fn has_energy(&self) -> bool {
        self.term.law.has_energy()
    }

    fn energy(&self, x: &[Vector3<f64>]) -> Option<(f64, Tally)> {
        if !self.has_energy() {
            return None;
        }
        let results = self.evaluated(Order::Energy, State { x, v: x });
        Some((results.energies.iter().sum(), self.tally(results.flagged)))
    }

    fn energy_found(&self) -> Option<f64> {
        let found = f64::from_bits(self.found.load(Relaxed));
        (self.has_energy() && !found.is_nan()).then_some(found)
    }

    fn add_force(&self, state: State<'_>, force: &mut [Vector3<f64>]) -> Tally {
        let results = self.evaluated(Order::Force, state);
        self.scatter(&results.forces, force);
        self.tally(results.flagged)
    }

    fn add_linearisation(&self, state: State<'_>, sum: &mut Linearisation<'_>) -> Tally {
        let mut results = self.evaluated(Order::Jacobians, state);
        self.scatter(&results.forces, sum.force);
        let projected = self.project(&mut results.by_position, sum.curvature);
        let n = self.points();
        self.add_blocks(&results.by_position, sum.weights.position, sum);
        self.add_blocks(&results.by_velocity, sum.weights.velocity, sum);
        if let Some(product) = &mut sum.stiffness_times_velocity {
            let stencils = self.term.stencils();
            for (element, matrix) in results.by_position.chunks_exact(9 * n * n).enumerate() {
                for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
                    let [to, from] = [i, j].map(|point| stencils.vertex(element, point) as usize);
                    let part = block_times(&block(matrix, n, i, j), &state.v[from]);
                    for axis in 0..3 {
                        product[to][axis] += part[axis];
                    }
                }
            }
        }
        Tally { projected, ..self.tally(results.flagged) }
    }

    fn find_non_finite(&self, quantity: Quantity, state: State<'_>) -> Option<usize> {
        let still = vec![[0.0; 3]; state.x.len()];
        let v = if state.v.len() == state.x.len() { state.v } else { &still };
        let results = self.evaluated(Order::Force, State { x: state.x, v });
        match quantity {
            Quantity::Energy => results.energies.iter().position(|energy| !energy.is_finite()),
            Quantity::Force => {
                let mut elements = results.forces.chunks_exact(3 * self.points());
                elements.position(|forces| forces.iter().any(|number| !number.is_finite()))
            }
        }
    }
}
