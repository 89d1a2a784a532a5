use std::ops::Range;

use energy_dsl::Vector3;

use crate::terms::counts::Tally;
use crate::terms::linearisation::Linearisation;
use crate::terms::state::State;

/// The part of the sums that one thread computes: consecutive vertices and the blocks in their rows of the matrix.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Share {
    /// Index among all shares.
    pub number: usize,
    /// Range of vertices.
    pub vertices: Range<usize>,
    /// Range of blocks, by [`Pattern::slot`](crate::Pattern::slot).
    pub blocks: Range<usize>,
}

/// A term that several threads sum at the same time, each its own share.
///
/// Elements across the border of two shares are evaluated for both. Every entry is a sum in the order of the elements,
/// so results do not depend on the shares.
pub trait Divisible: Sync {
    /// The number of parts that the energy is a sum of. It depends on the elements alone.
    fn energy_parts(&self) -> usize;
    /// Returns one part of the energy, in J.
    fn energy_part(&self, part: usize, x: &[Vector3<f64>]) -> (f64, Tally);
    /// Adds f of the vertices of a share; `force` holds these vertices only.
    fn add_force_of(&self, share: &Share, state: State<'_>, force: &mut [Vector3<f64>]) -> Tally;
    /// Adds f and its Jacobians; `sum` holds the vertices and blocks of a share only.
    fn add_linearisation_of(&self, share: &Share, state: State<'_>, sum: &mut Linearisation<'_>) -> Tally;
}
