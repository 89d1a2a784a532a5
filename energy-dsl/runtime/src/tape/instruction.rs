//! Straight-line code as data.

use super::operation::Operation;

/// One operation on slots. Numbers and masks have slots of their own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Instruction {
    /// The operation to perform.
    pub operation: Operation,
    /// Slot of the result.
    pub target: u16,
    /// Slots of the operands a, b, ….
    pub operands: [u16; 6],
}

/// A number that is known before the tape runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Constant {
    /// The number nearest to a double.
    Number(f64),
    /// π.
    Pi,
}

impl Constant {
    /// Returns the double nearest to the constant.
    #[must_use]
    pub fn nearest(self) -> f64 {
        match self {
            Self::Number(number) => number,
            Self::Pi => std::f64::consts::PI,
        }
    }
}

/// Straight-line code: instructions in the order of execution. A slot is reused after the last instruction that reads
/// it, except for the slots of inputs, constants and results.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tape {
    /// Number of number slots. The first ones hold the inputs.
    pub slots: usize,
    /// Number of mask slots.
    pub masks: usize,
    /// Slots of constants.
    pub constants: Vec<(u16, Constant)>,
    /// Mask slots of constants.
    pub truths: Vec<(u16, bool)>,
    /// The instructions, in order.
    pub instructions: Vec<Instruction>,
}
