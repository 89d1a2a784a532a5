//! Faults to plant in compiled routines. They show whether an audit would notice them.

use std::fmt;

use crate::graph::{Input, Op};

/// The kinds of fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Fault {
    /// A flipped sign: + for −, or a missing minus sign.
    FlippedSign,
    /// A missing term of a sum.
    DroppedTerm,
    /// A missing factor of a product.
    DroppedFactor,
    /// A doubled constant.
    ChangedFactor,
    /// Swapped operands, where the order matters.
    SwappedOperands,
    /// One operand used twice, and the other not at all.
    WrongOperand,
    /// A wrong function: cosine for sine, minimum for maximum, no root.
    WrongFunction,
    /// A wrong component of a point or parameter.
    WrongInput,
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::FlippedSign => "flipped sign",
            Self::DroppedTerm => "dropped term",
            Self::DroppedFactor => "dropped factor",
            Self::ChangedFactor => "changed factor",
            Self::SwappedOperands => "swapped operands",
            Self::WrongOperand => "wrong operand",
            Self::WrongFunction => "wrong function",
            Self::WrongInput => "wrong input",
        })
    }
}

/// A fault in one operation of one routine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Mutation {
    /// Kind of the fault.
    pub fault: Fault,
    /// Routine with the fault; `rest` is the part that the rest shape determines.
    pub routine: &'static str,
    pub(crate) place: usize,
    pub(crate) before: Op,
    pub(crate) after: Op,
}

impl fmt::Display for Mutation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { fault, routine, place, before, after } = self;
        write!(f, "{fault} in `{routine}`, operation {place}: {} for {}", symbol(*after), symbol(*before))
    }
}

/// Returns the faults that fit an operation.
pub(crate) fn faults(op: Op) -> Vec<(Fault, Op)> {
    use Fault::{
        ChangedFactor, DroppedFactor, DroppedTerm, FlippedSign, SwappedOperands, WrongFunction, WrongInput,
        WrongOperand,
    };
    // max(a, a) = a passes an operand on.
    let pass = |a| Op::Max(a, a);
    match op {
        Op::Neg(a) => vec![(FlippedSign, pass(a))],
        Op::Add(a, b) => vec![
            (FlippedSign, Op::Sub(a, b)),
            (DroppedTerm, pass(a)),
            (DroppedTerm, pass(b)),
            (WrongOperand, Op::Add(a, a)),
        ],
        Op::Sub(a, b) => vec![
            (FlippedSign, Op::Add(a, b)),
            (DroppedTerm, pass(a)),
            (DroppedTerm, Op::Neg(b)),
            (SwappedOperands, Op::Sub(b, a)),
        ],
        Op::Mul(a, b) => vec![(DroppedFactor, pass(a)), (DroppedFactor, pass(b)), (WrongOperand, Op::Mul(a, a))],
        Op::Div(a, b) => {
            vec![(SwappedOperands, Op::Div(b, a)), (WrongFunction, Op::Mul(a, b)), (DroppedFactor, pass(a))]
        }
        Op::MulAdd(a, b, c) => vec![
            (FlippedSign, Op::NegMulAdd(a, b, c)),
            (DroppedTerm, pass(c)),
            (DroppedTerm, Op::Mul(a, b)),
            (WrongOperand, Op::MulAdd(a, a, c)),
        ],
        Op::MulSub(a, b, c) => vec![
            (FlippedSign, Op::MulAdd(a, b, c)),
            (DroppedTerm, Op::Neg(c)),
            (DroppedTerm, Op::Mul(a, b)),
            (SwappedOperands, Op::NegMulAdd(a, b, c)),
        ],
        Op::NegMulAdd(a, b, c) => {
            vec![(FlippedSign, Op::MulAdd(a, b, c)), (DroppedTerm, pass(c)), (SwappedOperands, Op::MulSub(a, b, c))]
        }
        Op::NegMulSub(a, b, c) => {
            vec![(FlippedSign, Op::MulSub(a, b, c)), (DroppedTerm, Op::Neg(c)), (WrongOperand, Op::NegMulSub(a, a, c))]
        }
        Op::Sqrt(a) => vec![(WrongFunction, pass(a))],
        Op::Abs(a) => vec![(WrongFunction, pass(a))],
        Op::Sin(a) => vec![(WrongFunction, Op::Cos(a))],
        Op::Cos(a) => vec![(WrongFunction, Op::Sin(a))],
        Op::Exp(a) => vec![(WrongFunction, pass(a))],
        Op::Ln(a) => vec![(WrongFunction, pass(a))],
        Op::Atan2(a, b) => vec![(SwappedOperands, Op::Atan2(b, a))],
        Op::ModerateAtan2(a, b) => vec![(SwappedOperands, Op::ModerateAtan2(b, a))],
        Op::Pow(a, b) => vec![(SwappedOperands, Op::Pow(b, a))],
        Op::Min(a, b) => vec![(WrongFunction, Op::Max(a, b))],
        Op::Max(a, b) => vec![(WrongFunction, Op::Min(a, b))],
        Op::Select(mask, a, b) => vec![(SwappedOperands, Op::Select(mask, b, a))],
        Op::Constant(bits) if f64::from_bits(bits) != 0.0 => {
            vec![(ChangedFactor, Op::Constant((2.0 * f64::from_bits(bits)).to_bits()))]
        }
        Op::Input(input) => vec![(WrongInput, Op::Input(neighbour(input)))],
        _ => Vec::new(),
    }
}

/// Returns the other component of a pair, which always exists.
fn neighbour(input: Input) -> Input {
    match input {
        // Other axes of the same point: x for y, y for z, z for x.
        Input::Position(i) => Input::Position(i / 3 * 3 + (i + 2) % 3),
        Input::Velocity(i) => Input::Velocity(i / 3 * 3 + (i + 2) % 3),
        other => other,
    }
}

fn symbol(op: Op) -> &'static str {
    match op {
        Op::Add(a, b) if a == b => "a + a",
        Op::Mul(a, b) if a == b => "a · a",
        Op::Max(a, b) if a == b => "an operand alone",
        _ => op.description(),
    }
}
