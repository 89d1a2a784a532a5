pub use energy_runtime::tape::Input;

/// Index of a node. Operands have smaller indices than their uses.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct NodeId(pub(crate) u32);

/// A scalar operation. Comparisons and connectives return masks, all others numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Op {
    /// A constant, as the bits of a double.
    Constant(u64),
    /// A constant mask.
    Truth(bool),
    /// The mask of configurations that may be extraordinary, so that precautions are needed.
    Cautious,
    /// π in the precision of the number type.
    Pi,
    /// An input number.
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
    /// The angle of a point with moderate x² + y². It replaces `Atan2` where that is assumed.
    ModerateAtan2(NodeId, NodeId),
    /// a to the power b.
    Pow(NodeId, NodeId),
    /// Rounding error of a + b; zero derivative.
    SumError(NodeId, NodeId),
    /// Rounding error of a − b; zero derivative.
    DifferenceError(NodeId, NodeId),
    /// Rounding error of a · b; zero derivative.
    ProductError(NodeId, NodeId),
    /// Rounding error a − b² of b = fl(√a); zero derivative.
    RootError(NodeId, NodeId),
    /// a · b − c, as if rounded once.
    FusedMulSub(NodeId, NodeId, NodeId),
    /// a · b + c, rounded once if the processor can. [`super::Graph::fused`] creates it from sums when code is emitted.
    MulAdd(NodeId, NodeId, NodeId),
    /// a · b − c.
    MulSub(NodeId, NodeId, NodeId),
    /// c − a · b.
    NegMulAdd(NodeId, NodeId, NodeId),
    /// −a · b − c.
    NegMulSub(NodeId, NodeId, NodeId),
    /// The power of two that scales |a| into [1, 2); zero derivative.
    PowerOfTwoScale(NodeId),
    /// a < b.
    Less(NodeId, NodeId),
    /// a < b, where results are the same for both outcomes.
    Precedes(NodeId, NodeId),
    /// a ≤ b.
    LessOrEqual(NodeId, NodeId),
    /// a = b.
    Equal(NodeId, NodeId),
    /// Whether a is a moderate power of a length, so that no scaling is needed.
    IsModerate(NodeId, u8),
    /// The conjunction of two masks.
    And(NodeId, NodeId),
    /// The disjunction of two masks.
    Or(NodeId, NodeId),
    /// The negation of a mask.
    Not(NodeId),
    /// Mask, value where it holds, value elsewhere.
    Select(NodeId, NodeId, NodeId),
    /// A robust primitive with its own derivative rules, by index.
    Rule(u32),
}

impl Op {
    /// Returns the operands of an elementary operation. A rule has none here.
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
            | Self::Precedes(a, b)
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

    /// Returns the operation on other operands.
    #[must_use]
    pub fn with_operands(self, mut to: impl FnMut(NodeId) -> NodeId) -> Self {
        match self {
            Self::Constant(_) | Self::Truth(_) | Self::Cautious | Self::Pi | Self::Input(_) | Self::Rule(_) => self,
            Self::Neg(a) => Self::Neg(to(a)),
            Self::Sqrt(a) => Self::Sqrt(to(a)),
            Self::Abs(a) => Self::Abs(to(a)),
            Self::Sin(a) => Self::Sin(to(a)),
            Self::Cos(a) => Self::Cos(to(a)),
            Self::Exp(a) => Self::Exp(to(a)),
            Self::Ln(a) => Self::Ln(to(a)),
            Self::PowerOfTwoScale(a) => Self::PowerOfTwoScale(to(a)),
            Self::IsModerate(a, degree) => Self::IsModerate(to(a), degree),
            Self::Not(a) => Self::Not(to(a)),
            Self::Add(a, b) => Self::Add(to(a), to(b)),
            Self::Sub(a, b) => Self::Sub(to(a), to(b)),
            Self::Mul(a, b) => Self::Mul(to(a), to(b)),
            Self::Div(a, b) => Self::Div(to(a), to(b)),
            Self::Min(a, b) => Self::Min(to(a), to(b)),
            Self::Max(a, b) => Self::Max(to(a), to(b)),
            Self::Atan2(a, b) => Self::Atan2(to(a), to(b)),
            Self::ModerateAtan2(a, b) => Self::ModerateAtan2(to(a), to(b)),
            Self::Pow(a, b) => Self::Pow(to(a), to(b)),
            Self::SumError(a, b) => Self::SumError(to(a), to(b)),
            Self::DifferenceError(a, b) => Self::DifferenceError(to(a), to(b)),
            Self::ProductError(a, b) => Self::ProductError(to(a), to(b)),
            Self::RootError(a, b) => Self::RootError(to(a), to(b)),
            Self::Less(a, b) => Self::Less(to(a), to(b)),
            Self::Precedes(a, b) => Self::Precedes(to(a), to(b)),
            Self::LessOrEqual(a, b) => Self::LessOrEqual(to(a), to(b)),
            Self::Equal(a, b) => Self::Equal(to(a), to(b)),
            Self::And(a, b) => Self::And(to(a), to(b)),
            Self::Or(a, b) => Self::Or(to(a), to(b)),
            Self::FusedMulSub(a, b, c) => Self::FusedMulSub(to(a), to(b), to(c)),
            Self::MulAdd(a, b, c) => Self::MulAdd(to(a), to(b), to(c)),
            Self::MulSub(a, b, c) => Self::MulSub(to(a), to(b), to(c)),
            Self::NegMulSub(a, b, c) => Self::NegMulSub(to(a), to(b), to(c)),
            Self::NegMulAdd(a, b, c) => Self::NegMulAdd(to(a), to(b), to(c)),
            Self::Select(mask, a, b) => Self::Select(to(mask), to(a), to(b)),
        }
    }

    /// Returns whether the node is a rounding error or a scale. Its derivative is zero for all operands.
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

    /// Returns whether the node is a mask.
    #[must_use]
    pub fn is_mask(self) -> bool {
        matches!(
            self,
            Self::Truth(_)
                | Self::Cautious
                | Self::Less(..)
                | Self::Precedes(..)
                | Self::LessOrEqual(..)
                | Self::Equal(..)
                | Self::IsModerate(..)
                | Self::And(..)
                | Self::Or(..)
                | Self::Not(_)
        )
    }
}
