//! Recognises naive spellings that have a robust form, such as `1 - dot(unit(a), unit(b))`.
//!
//! The graph knows the operation that a spelling ends in. The functions of the language supply the table of spellings.

use super::{Graph, NodeId};

/// The operation that a spelling ends in. The constructor of that operation looks the spelling up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// a + b.
    Sum,
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
    /// a + b of a formula as written, not inside of primitives and derivatives.
    WrittenSum,
    /// a − b of a formula as written.
    WrittenDifference,
    /// a / b of a formula as written.
    WrittenQuotient,
}

/// A naive spelling and its robust form.
#[derive(Debug)]
pub struct Recogniser {
    /// The spelling, for the language reference.
    pub spelling: &'static str,
    /// Description of the robust form, for the language reference.
    pub form: &'static str,
    /// The operation that the spelling ends in.
    pub ending: Ending,
    /// Returns the robust form of the operation on these operands; `None` if they do not match the spelling. A unary
    /// operation passes its operand twice.
    pub recognise: fn(&mut Graph, NodeId, NodeId) -> Option<NodeId>,
}

/// A family of functions whose Taylor series have remainders as primitives; see `functions/remainder`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Expansion {
    /// eˣ.
    Exponential,
    /// ln(1 + x).
    Logarithm,
    /// sin x and cos x.
    Trigonometric,
    /// 1 − e⁻ˣ Σ xʲ/j!, the regularised incomplete gamma function of an integer.
    IncompleteGamma,
}

impl Graph {
    /// Returns the robust form of an operation, by the first matching recogniser.
    pub(crate) fn recognised(&mut self, ending: Ending, a: NodeId, b: NodeId) -> Option<NodeId> {
        let recognisers = self.recognisers;
        recognisers.iter().filter(|row| row.ending == ending).find_map(|row| (row.recognise)(self, a, b))
    }
}
