/// A node's number. Operands have smaller numbers than their uses.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct NodeId(pub(crate) u32);

/// Where a number comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Input {
    /// Coordinate of the positions (point · 3 + axis), or an unknown of a residual.
    Position(u16),
    /// Coordinate of the velocities.
    Velocity(u16),
    /// Number of the parameters.
    Parameter(u16),
    /// Number of the rest shape.
    Rest(u16),
    /// Number that the `rest` block computed once for the element.
    Precomputed(u16),
}

/// One scalar operation. Comparisons and connectives yield masks, all others numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Op {
    /// A constant, as the bits of a double.
    Constant(u64),
    /// A mask that is the same everywhere.
    Truth(bool),
    /// A mask: whether the configuration may not be ordinary, so that precautions must be taken.
    Cautious,
    /// π, to the precision of the number type at hand.
    Pi,
    /// An input.
    Input(Input),
    /// −a.
    Neg(NodeId),
    /// a + b.
    Add(NodeId, NodeId),
    /// a − b.
    Sub(NodeId, NodeId),
    /// a · b.
    Mul(NodeId, NodeId),
    /// a / b.
    Div(NodeId, NodeId),
    /// √a.
    Sqrt(NodeId),
    /// |a|.
    Abs(NodeId),
    /// min(a, b).
    Min(NodeId, NodeId),
    /// max(a, b).
    Max(NodeId, NodeId),
    /// sin a.
    Sin(NodeId),
    /// cos a.
    Cos(NodeId),
    /// eᵃ.
    Exp(NodeId),
    /// ln a.
    Ln(NodeId),
    /// The angle of the point (x = b, y = a).
    Atan2(NodeId, NodeId),
    /// The same where x² + y² is moderate. Stands for it where that is assumed.
    ModerateAtan2(NodeId, NodeId),
    /// a to the power b.
    Pow(NodeId, NodeId),
    /// What rounding a + b lost; zero derivative.
    SumError(NodeId, NodeId),
    /// What rounding a − b lost; zero derivative.
    DifferenceError(NodeId, NodeId),
    /// What rounding a · b lost; zero derivative.
    ProductError(NodeId, NodeId),
    /// What √a, rounded to b, lost: a − b²; zero derivative.
    RootError(NodeId, NodeId),
    /// a · b − c, as if rounded once.
    FusedMulSub(NodeId, NodeId, NodeId),
    /// a · b + c, rounded once where the processor can. Made of sums by [`super::Graph::fused`] when code is written.
    MulAdd(NodeId, NodeId, NodeId),
    /// a · b − c.
    MulSub(NodeId, NodeId, NodeId),
    /// c − a · b.
    NegMulAdd(NodeId, NodeId, NodeId),
    /// −a · b − c.
    NegMulSub(NodeId, NodeId, NodeId),
    /// A power of two that brings |a| into [1, 2); zero derivative.
    PowerOfTwoScale(NodeId),
    /// a < b.
    Less(NodeId, NodeId),
    /// a ≤ b.
    LessOrEqual(NodeId, NodeId),
    /// a = b.
    Equal(NodeId, NodeId),
    /// Whether a is the given power of a length that needs no scaling.
    IsModerate(NodeId, u8),
    /// Both masks.
    And(NodeId, NodeId),
    /// Either mask.
    Or(NodeId, NodeId),
    /// The opposite mask.
    Not(NodeId),
    /// Where the mask holds the second, elsewhere the third.
    Select(NodeId, NodeId, NodeId),
    /// A robust primitive with its own derivatives.
    Rule(u32),
}

impl Op {
    /// The operands of an elementary operation (a rule's are its own affair).
    pub fn operands(self) -> impl Iterator<Item = NodeId> {
        let (count, list) = match self {
            Self::Constant(_) | Self::Truth(_) | Self::Cautious | Self::Pi | Self::Input(_) | Self::Rule(_) => {
                (0, [NodeId(0); 3])
            }
            Self::Neg(a)
            | Self::Sqrt(a)
            | Self::Abs(a)
            | Self::Sin(a)
            | Self::Cos(a)
            | Self::Exp(a)
            | Self::Ln(a)
            | Self::PowerOfTwoScale(a)
            | Self::IsModerate(a, _)
            | Self::Not(a) => (1, [a; 3]),
            Self::Add(a, b)
            | Self::Sub(a, b)
            | Self::Mul(a, b)
            | Self::Div(a, b)
            | Self::Min(a, b)
            | Self::Max(a, b)
            | Self::Atan2(a, b)
            | Self::ModerateAtan2(a, b)
            | Self::Pow(a, b)
            | Self::SumError(a, b)
            | Self::DifferenceError(a, b)
            | Self::ProductError(a, b)
            | Self::RootError(a, b)
            | Self::Less(a, b)
            | Self::LessOrEqual(a, b)
            | Self::Equal(a, b)
            | Self::And(a, b)
            | Self::Or(a, b) => (2, [a, b, b]),
            Self::Select(a, b, c)
            | Self::FusedMulSub(a, b, c)
            | Self::MulAdd(a, b, c)
            | Self::MulSub(a, b, c)
            | Self::NegMulAdd(a, b, c)
            | Self::NegMulSub(a, b, c) => (3, [a, b, c]),
        };
        list.into_iter().take(count)
    }

    /// Whether the node is a rounding error or a scale: its derivative is zero whatever its operands.
    #[must_use]
    pub fn is_constant_in_exact_arithmetic(self) -> bool {
        matches!(
            self,
            Self::SumError(..)
                | Self::DifferenceError(..)
                | Self::ProductError(..)
                | Self::RootError(..)
                | Self::PowerOfTwoScale(_)
        )
    }

    /// Whether the node is a mask and not a number.
    #[must_use]
    pub fn is_mask(self) -> bool {
        matches!(
            self,
            Self::Truth(_)
                | Self::Cautious
                | Self::Less(..)
                | Self::LessOrEqual(..)
                | Self::Equal(..)
                | Self::IsModerate(..)
                | Self::And(..)
                | Self::Or(..)
                | Self::Not(_)
        )
    }
}
