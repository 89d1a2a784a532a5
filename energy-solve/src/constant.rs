use energy_dsl::Block;

use crate::curvature::Curvature;
use crate::term::Weights;

/// M + α ∂f/∂x + β ∂f/∂v of masses and quadratic terms: evaluated once for all steps of one size.
#[derive(Clone, Debug)]
pub(crate) struct Constant<T> {
    pub(crate) weights: Weights,
    pub(crate) curvature: Curvature,
    /// The masses of all vertices; empty for none.
    pub(crate) masses: Vec<f64>,
    /// Whether some element's curvature had to be changed; where none had, they serve for any treatment.
    pub(crate) projected: bool,
    pub(crate) blocks: Vec<Block<T>>,
}

impl<T> Constant<T> {
    /// Whether it is what is asked for.
    pub(crate) fn serves(&self, weights: Weights, curvature: Curvature, masses: &[f64]) -> bool {
        self.weights == weights && (!self.projected || self.curvature == curvature) && self.masses == masses
    }
}
