use energy_dsl::{Block, Vector3};

use super::{Contact, Pressed};
use crate::matrix::dof_map::DofMap;

/// The forces of the active set: the pairs in contact.
pub trait ContactForces {
    /// Returns Σ U, in J; infinite if a pair is within its thickness. With friction, U includes its potential.
    fn energy(&self, x: &[Vector3<f64>]) -> f64;

    /// Adds −∇U to the forces on all vertices, in N.
    fn add_force(&self, x: &[Vector3<f64>], force: &mut [Vector3<f64>]);
}

/// Contact between features of a body, between steps. Its forces are those of the last step.
///
/// The state before the first step has no crossing. In a step, an integrator that minimises an incremental potential
/// passes every move of positions through [`ContactStep::filter_step`], and evaluates energies only where this allows
/// it to go. By induction no state that it accepts has a crossing.
pub trait ContactModel: ContactForces + std::fmt::Debug + Send {
    /// Sets the largest number of threads. Results must not depend on it.
    fn set_threads(&mut self, _threads: usize) {}

    /// Begins a step at x, where the last step ended, with an empty active set. The step ends when its contact is
    /// dropped. A step that failed may begin again.
    fn begin_step(&mut self, x: &[Vector3<f64>]) -> Box<dyn ContactStep + '_>;

    /// Returns the pairs in contact at x, where the last step ended, for a caller. Default none.
    fn touching(&self, _x: &[Vector3<f64>]) -> Vec<Touching> {
        Vec::new()
    }

    /// Returns what later steps depend on, for a checkpoint at x, where the last step ended. Default nothing.
    fn memory(&self, _x: &[Vector3<f64>]) -> ContactMemory {
        ContactMemory::default()
    }

    /// Restores the memory of a checkpoint.
    fn restore(&mut self, _memory: ContactMemory) {}
}

/// Contact during one step.
pub trait ContactStep: ContactForces {
    /// Returns the part of the straight move between two states that is certified to have no crossing: 1 for the whole
    /// move. Pairs that shorten the move become active at the next [`ContactStep::update_active_set`].
    fn filter_step(&mut self, from: &[Vector3<f64>], to: &[Vector3<f64>]) -> f64;

    /// Lags friction: it acts on the pairs in contact at the start of the step, with their normal forces there.
    fn lag_friction(&mut self, resistance: &Resistance);

    /// Adds pairs to the active set at a new iterate. They stay until the step ends, so that a line search sees a
    /// single function. The resistance is that at the first iterate. Returns the change of the energy at x, in J.
    fn update_active_set(&mut self, x: &[Vector3<f64>], resistance: &Resistance) -> f64;

    /// Returns the stiffness of each active pair, and of friction, in N/m. They come in lists that several threads may
    /// take, in an order that does not depend on threads. Those of the same vertices should follow each other.
    fn stiffness(&mut self, dofs: &DofMap, x: &[Vector3<f64>], sliding: SlidingStiffness) -> Vec<Vec<Contact>>;

    /// Lets only these vertices move until [`ContactStep::release`], from the iterate of the last
    /// [`ContactStep::update_active_set`]. Pairs of other vertices may be left out of all sums.
    fn restrict(&mut self, moving: &[bool]);

    /// Lets all vertices move again, from the iterate of the last [`ContactStep::update_active_set`].
    fn release(&mut self);

    /// Returns where contact presses the most at x, for messages. Default nowhere.
    fn most_pressed(&self, _x: &[Vector3<f64>]) -> Option<Pressed> {
        None
    }

    /// Returns what was counted in all steps so far.
    fn counts(&self) -> ContactCounts;
}

/// The stiffness of friction along the slide. Let U(t) be the energy of a tangential displacement t.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SlidingStiffness {
    /// ∂²U/∂t². Newton's method converges fast with it, but it nearly vanishes for a pair that slips, so that steps are
    /// far too long.
    #[default]
    Exact,
    /// ‖∂U/∂t‖/‖t‖: the line from the origin to the force. It is never less than the exact stiffness.
    Secant,
}

/// The resistance of vertices to displacement, in N/m, from which contact derives the stiffness of its pairs.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Resistance {
    /// Diagonal blocks of M/h² + ∂²U/∂x² by vertex; `None` for a pinned one.
    pub blocks: Vec<Option<Block<f64>>>,
    /// m/h² by vertex, the least resistance.
    pub inertia: Vec<f64>,
}

impl Resistance {
    /// Takes the diagonal blocks by row, and m/h² by vertex.
    #[must_use]
    pub fn new(dofs: &DofMap, diagonal: impl IntoIterator<Item = Block<f64>>, inertia: Vec<f64>) -> Self {
        let mut blocks = vec![None; dofs.vertex_count()];
        for (&vertex, block) in dofs.free().iter().zip(diagonal) {
            blocks[vertex] = Some(block);
        }
        Self { blocks, inertia }
    }
}

/// Two features in contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Touching {
    /// The vertices of the first feature, then those of the second; a vertex of a shorter feature may be repeated.
    pub vertices: [u32; 4],
    /// The number of vertices of the first feature: 1 for a point and a triangle, 2 for two edges.
    pub first: usize,
    /// Distance of the features, in m.
    pub distance: f64,
    /// Unit vector from the second feature to the first.
    pub normal: Vector3<f64>,
    /// The push along the normal, in N, without friction.
    pub force: f64,
}

/// State that contact keeps from step to step, such as how far sticking pairs have slid.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ContactMemory {
    /// One name for each entry.
    pub names: Vec<[u32; 3]>,
    /// Two vectors for each entry.
    pub vectors: Vec<[Vector3<f64>; 2]>,
}

/// Numbers of pairs and moves.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct ContactCounts {
    /// Searches for candidate pairs.
    pub searches: u64,
    /// Searches that found nothing near anything.
    pub clear: u64,
    /// Candidate pairs that could come within reach near the iterate, summed over the certified moves.
    pub candidates: u64,
    /// Pairs whose move needed more than a comparison of distances.
    pub tested: u64,
    /// Certified moves.
    pub moves: u64,
    /// Moves that were shortened.
    pub shortened: u64,
    /// The sum of the parts that were left of them.
    pub left: f64,
    /// Pairs in contact, summed over the linear systems of all vertices.
    pub active: u64,
    /// Linear systems of all vertices.
    pub systems: u64,
}
