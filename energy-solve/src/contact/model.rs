use energy_dsl::{Block, Vector3};

use super::{Contact, Pressed};
use crate::matrix::dof_map::DofMap;

/// Contact between features of a body, as an integrator that minimises an incremental potential uses it.
///
/// The state before the first step has no crossing. The integrator then asks for a certificate of every move of
/// positions, and evaluates energies only where a certificate allows it to go. By induction no state that it accepts
/// has a crossing.
///
/// 1. [`ContactModel::begin_step`] forgets the pairs of the last step.
/// 2. [`ContactModel::certify`] shortens each move: the warm start, the motion of pins, each trial of a line search.
/// 3. [`ContactModel::set_resistance`] tells how stiff the body is at the first iterate.
/// 4. [`ContactModel::meet`] is called at each new iterate. Pairs join there and then stay until the step ends, so that
///    a line search sees a single function.
/// 5. [`ContactModel::energy`], [`ContactModel::add_force`] and [`ContactModel::contacts`] evaluate the pairs.
/// 6. Between [`ContactModel::restrict`] and [`ContactModel::release`], only some vertices move. Pairs of others
///    may then be left out.
pub trait ContactModel: std::fmt::Debug + Send {
    /// Sets the largest number of threads. Results must not depend on it.
    fn set_threads(&mut self, _threads: usize) {}

    /// Begins a step at x: forgets all pairs.
    fn begin_step(&mut self, x: &[Vector3<f64>]);

    /// Returns the part of the straight move between two states that certainly has no crossing: 1 for the whole move.
    /// Pairs that shorten the move join at the next [`ContactModel::meet`].
    fn certify(&mut self, from: &[Vector3<f64>], to: &[Vector3<f64>]) -> f64;

    /// Sets the resistance of vertices to displacement: the diagonal blocks of M/h² + ∂²U/∂x² by row, and m/h² by
    /// vertex, in N/m.
    fn set_resistance(&mut self, dofs: &DofMap, diagonal: Vec<Block<f64>>, inertia: Vec<f64>);

    /// Adds the pairs that meet at an iterate. Returns the change of the energy there, in J.
    fn meet(&mut self, x: &[Vector3<f64>]) -> f64;

    /// Returns Σ U, in J; infinite if a pair is within its thickness. With friction, U includes its potential.
    fn energy(&self, x: &[Vector3<f64>]) -> f64;

    /// Adds −∇U to the forces on all vertices, in N.
    fn add_force(&self, x: &[Vector3<f64>], force: &mut [Vector3<f64>]);

    /// Returns the stiffness of each pair in contact, and of friction, in N/m. They come in lists that several threads
    /// may take, in an order that does not depend on threads. Those of the same vertices should follow each other.
    fn contacts(&mut self, dofs: &DofMap, x: &[Vector3<f64>]) -> Vec<Vec<Contact>>;

    /// From now on until [`ContactModel::release`], only these vertices move, from an iterate where the last
    /// [`ContactModel::meet`] was. Pairs of other vertices may be left out of all sums.
    fn restrict(&mut self, moving: &[bool]);

    /// Lets all vertices move again, from an iterate where the last [`ContactModel::meet`] was.
    fn release(&mut self);

    /// Returns where contact presses the most at x, for messages. Default nowhere.
    fn most_pressed(&self, _x: &[Vector3<f64>]) -> Option<Pressed> {
        None
    }

    /// Returns the pairs in contact at x, where the last step ended, for a caller. Default none.
    fn touching(&self, _x: &[Vector3<f64>]) -> Vec<Touching> {
        Vec::new()
    }

    /// Returns what was counted so far.
    fn counts(&self) -> ContactCounts;

    /// Returns what later steps depend on, for a checkpoint at x, where the last step ended. Default nothing.
    fn memory(&self, _x: &[Vector3<f64>]) -> ContactMemory {
        ContactMemory::default()
    }

    /// Restores the memory of a checkpoint.
    fn restore(&mut self, _memory: ContactMemory) {}
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
