//! Saved states of elements.

/// The states of a system's elements: the memory that they keep from step to step. Save them with
/// [`MixedSystem::states`](super::MixedSystem::states).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ElementStates {
    /// The states of each term's elements, one after the other; empty for a term without.
    pub by_term: Vec<Vec<f64>>,
}
