//! Recognition of naive spellings that have a robust form, such as `1 - dot(unit(a), unit(b))`.
//!
//! The graph knows where a spelling ends; which spellings exist is a table that the functions of the language supply.

use super::{Graph, NodeId};

/// The operation that a spelling ends in: its constructor looks the spelling up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// a − b.
    Difference,
    /// √a.
    Root,
    /// sin a.
    Sine,
    /// cos a.
    Cosine,
    /// a^b.
    Power,
}

/// A spelling and its robust form.
#[derive(Debug)]
pub struct Recogniser {
    /// The spelling, for the language reference.
    pub spelling: &'static str,
    /// The operation that the spelling ends in.
    pub ending: Ending,
    /// Returns the robust form of the operation on these operands; `None` if they are not of this spelling.
    /// An operation on one number is given its operand twice.
    pub recognise: fn(&mut Graph, NodeId, NodeId) -> Option<NodeId>,
}

impl Graph {
    /// The robust form of an operation, by the first recogniser that has one.
    pub(super) fn recognised(&mut self, ending: Ending, a: NodeId, b: NodeId) -> Option<NodeId> {
        let recognisers = self.recognisers;
        recognisers.iter().filter(|row| row.ending == ending).find_map(|row| (row.recognise)(self, a, b))
    }
}
