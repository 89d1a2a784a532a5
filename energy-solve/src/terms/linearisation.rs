use energy_dsl::Vector3;

use crate::matrix::precision::Blocks;
use crate::terms::curvature::Curvature;

/// The factors α and β of α ∂f/∂x + β ∂f/∂v.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Weights {
    /// α.
    pub position: f64,
    /// β.
    pub velocity: f64,
}

/// The sums to which a term adds its force and Jacobians.
#[derive(Debug)]
pub struct Linearisation<'a> {
    /// α and β.
    pub weights: Weights,
    /// Treatment of negative eigenvalues.
    pub curvature: Curvature,
    /// Blocks of α ∂f/∂x + β ∂f/∂v, by [`Pattern::slot`](crate::Pattern::slot). One more, at
    /// [`Pattern::nowhere`](crate::Pattern::nowhere), collects the blocks of pinned vertices.
    pub matrix: Blocks<'a>,
    /// f of all vertices, in N.
    pub force: &'a mut [Vector3<f64>],
    /// (∂f/∂x) v of all vertices, in N/s; `None` if it is not needed.
    pub stiffness_times_velocity: Option<&'a mut [Vector3<f64>]>,
}
