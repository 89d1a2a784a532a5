use super::node::NodeId;
use super::{BySquare, Expansion, Graph, Op};
use energy_runtime::Flag;

/// A robust primitive of the language. Each component of a vector-valued one is a primitive.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Primitive {
    /// x·y.
    InnerProduct,
    /// 1/‖d‖.
    ReciprocalNorm,
    /// ‖d‖.
    Norm,
    /// A component of d/‖d‖.
    Unit(u8),
    /// ‖d‖^α.
    NormPower,
    /// ‖d‖ − L.
    Elongation,
    /// ½ (‖d‖ − L)².
    HalfElongationSquared,
    /// Cosine of the angle between two vectors.
    Cosine,
    /// 1 − cosine of the angle between two vectors.
    OneMinusCosine,
    /// The unsigned angle between two vectors.
    Angle,
    /// π/2 less that angle.
    Elevation,
    /// The signed dihedral angle θ of a hinge.
    Dihedral,
    /// sin θ of a dihedral angle.
    DihedralSine,
    /// cos θ of a dihedral angle.
    DihedralCosine,
    /// sin θ/2 of a dihedral angle.
    DihedralSineHalf,
    /// cos θ/2 of a dihedral angle.
    DihedralCosineHalf,
    /// sin θ/2 − sin θ₀/2 of a dihedral angle and its rest angle.
    DihedralSineDifference,
    /// 1 − cos x.
    Versine,
    /// 1 + cos x.
    Vercosine,
    /// x − sin x.
    SineRemainder,
    /// A remainder of a Taylor series, xᵖ Φₖ(x): the family, k and p. (eˣ − 1 − x)/x² has k = 2 and p = 0.
    Remainder(Expansion, u8, u8),
    /// cos √y.
    CosSqrt,
    /// sin √y / √y.
    SincSqrt,
    /// The derivative of sin √y / √y.
    SincSqrtSlope,
    /// sin x / x.
    Sinc,
    /// √(c (1 − cos)) of the angle between two vectors.
    RootOneMinusCosine,
    /// ln(1 + x).
    Log1p,
    /// ln(1 + x) − x.
    Log1pmx,
    /// eˣ − 1.
    Expm1,
    /// ln(1 + eˣ).
    Softplus,
    /// Huber's loss: quadratic up to a threshold, then linear.
    Huber,
    /// The pseudo-Huber loss, a smooth version of it.
    PseudoHuber,
    /// tan x.
    Tangent,
    /// asin x.
    ArcSine,
    /// acos x.
    ArcCosine,
    /// The squared angle of a rotation.
    SquaredRotation,
    /// acos w / √(1 − w²), half the angle of a rotation over its sine.
    ArcOverSine,
    /// atan x.
    ArcTangent,
    /// sinh x.
    HyperbolicSine,
    /// cosh x.
    HyperbolicCosine,
    /// tanh x.
    HyperbolicTangent,
    /// erf x.
    ErrorFunction,
    /// An entry of the rotation R of a polar decomposition F = R S.
    Rotation(u8),
    /// tr S of a polar decomposition F = R S.
    StretchTrace,
    /// tr S − 3.
    StretchTraceExcess,
    /// ‖F − R‖².
    DistanceToRotation,
    /// A singular value of F.
    SingularValue(u8),
    /// A function of the singular values of F.
    Spectral,
    /// A cubic spline through the numbers of a table.
    Spline,
    /// An entry of F⁻¹.
    Inverse(u8),
    /// A product with entries of F⁻¹, computed as one quotient.
    Quotient,
    /// A component of the quaternion exp(δ) q at δ = 0.
    Turned(u8),
    /// A component of a vector that such a quaternion turns.
    TurnedVector {
        /// The component.
        axis: u8,
        /// Whether the quaternion is the conjugate.
        backwards: bool,
    },
    /// A number y in place of its definition x, which has the same value. The arguments are y and x. If `slopes`, first
    /// derivatives are those of y, too.
    ComputedAs {
        /// Whether first derivatives are those of y.
        slopes: bool,
    },
    /// A first partial derivative of another rule.
    Partial {
        /// Node that is differentiated.
        of: u32,
        /// Index of the argument.
        by: u8,
    },
}

impl Primitive {
    /// Returns whether it may be finite where an argument is infinite.
    #[must_use]
    pub const fn saturates(self) -> bool {
        matches!(self, Self::ArcTangent | Self::HyperbolicTangent | Self::ErrorFunction | Self::Softplus | Self::Expm1)
    }

    /// Returns whether its value may be differentiated in its place. Which is shorter depends on the formula.
    #[must_use]
    pub(crate) const fn is_rational(self) -> bool {
        matches!(self, Self::Inverse(_) | Self::Quotient)
    }

    /// Returns its name in the documentation of generated code; `None` if it is internal.
    #[must_use]
    pub const fn label(self) -> Option<&'static str> {
        Some(match self {
            Self::Norm => "norm ‖d‖",
            Self::Unit(_) => "unit vector d/‖d‖",
            Self::NormPower => "power of a norm ‖d‖^α",
            Self::Elongation => "elongation ‖d‖ − L",
            Self::HalfElongationSquared => "squared elongation ½(‖d‖ − L)²",
            Self::Cosine => "cosine between vectors",
            Self::OneMinusCosine => "1 − cosine between vectors",
            Self::Angle => "angle between vectors",
            Self::Elevation => "angle between a vector and a plane",
            Self::Dihedral => "dihedral angle θ",
            Self::DihedralSine => "sin θ of a dihedral angle",
            Self::DihedralCosine => "cos θ of a dihedral angle",
            Self::DihedralSineHalf => "sin θ/2 of a dihedral angle",
            Self::DihedralCosineHalf => "cos θ/2 of a dihedral angle",
            Self::DihedralSineDifference => "sin θ/2 − sin θ₀/2 of a dihedral angle",
            Self::Versine => "1 − cos x",
            Self::Vercosine => "1 + cos x",
            Self::SineRemainder => "x − sin x",
            Self::Remainder(..) => "remainder of a Taylor series",
            Self::ReciprocalNorm => "reciprocal norm 1/‖d‖",
            Self::CosSqrt => "cos √y",
            Self::SincSqrt => "sin √y / √y",
            Self::Sinc => "sin x / x",
            Self::RootOneMinusCosine => "√(1 − cosine between vectors)",
            Self::Log1p => "log1p",
            Self::Log1pmx => "log1pmx",
            Self::Expm1 => "expm1",
            Self::Softplus => "softplus",
            Self::Huber => "Huber loss",
            Self::PseudoHuber => "pseudo-Huber loss",
            Self::Tangent => "tan x",
            Self::ArcSine => "asin x",
            Self::ArcCosine => "acos x",
            Self::SquaredRotation => "squared angle of a rotation",
            Self::ArcOverSine => "angle over sine of a rotation",
            Self::ArcTangent => "atan x",
            Self::HyperbolicSine => "sinh x",
            Self::HyperbolicCosine => "cosh x",
            Self::HyperbolicTangent => "tanh x",
            Self::ErrorFunction => "erf x",
            Self::Rotation(_) => "rotation of a polar decomposition F = R S",
            Self::StretchTrace => "tr S of a polar decomposition F = R S",
            Self::StretchTraceExcess => "tr S − 3 of a polar decomposition F = R S",
            Self::DistanceToRotation => "squared distance ‖F − R‖² to the rotation of F = R S",
            Self::SingularValue(_) | Self::Spectral => "functions of singular values",
            Self::Spline => "cubic spline",
            Self::InnerProduct
            | Self::Inverse(_)
            | Self::Quotient
            | Self::Partial { .. }
            | Self::SincSqrtSlope
            | Self::ComputedAs { .. }
            | Self::Turned(_)
            | Self::TurnedVector { .. } => return None,
        })
    }
}

/// A flag that is raised from a given order of derivative on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RuleFlag {
    /// Lowest order of derivative that is a convention: 0 is the value, 1 first derivatives, 2 second derivatives.
    pub order: u8,
    /// Flag that is raised.
    pub flag: Flag,
    /// Mask where it is raised.
    pub mask: NodeId,
    /// Whether no limit exists where it is raised.
    pub definite: bool,
}

/// The value and the derivatives of a primitive, as expressions of the same graph.
#[derive(Clone, Debug)]
pub struct Rule {
    /// The primitive.
    pub primitive: Primitive,
    /// Arguments that it is differentiated with respect to.
    pub arguments: Vec<NodeId>,
    /// Expression of the value.
    pub value: NodeId,
    /// ∂value/∂argument, one product per argument.
    pub first: Vec<Product>,
    /// ∂²value/∂argument²: the upper triangle row by row (see [`symmetric_index`]), each entry a sum of products.
    /// `None`: differentiate `value` instead.
    pub second: Option<Vec<Vec<Product>>>,
    /// Flags of the value and its derivatives.
    pub flags: Vec<RuleFlag>,
    /// Sine and cosine of a dihedral angle; `None` for other rules.
    pub dihedral: Option<DihedralParts>,
    /// Half the square of an elongation; `None` for other rules.
    pub half_square: Option<NodeId>,
    /// The vector of a length; `None` for other rules.
    pub vector: Option<Vec<NodeId>>,
    /// Its derivatives by ½ d·d, if it is a function of ‖d‖; `None` for other rules.
    pub(crate) by_square: Option<BySquare>,
    /// An expression that the user wrote inside of the rule; `None` for other rules. Its singularities count.
    pub inner: Option<NodeId>,
}

/// Factors that are multiplied from left to right. A weight multiplies the first factor, so that entries which share
/// leading factors also share these products.
pub type Product = Vec<NodeId>;

/// A number that is computed by another expression than the one that defines it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ComputedAs {
    pub computed: NodeId,
    pub defined: NodeId,
    /// Whether first derivatives are those of the expression that computes it.
    pub slopes: bool,
}

/// Functions of a dihedral angle that do not need the angle.
#[derive(Clone, Copy, Debug)]
pub struct DihedralParts {
    /// sin θ.
    pub sine: NodeId,
    /// cos θ.
    pub cosine: NodeId,
    /// sin θ/2.
    pub sine_half: NodeId,
    /// cos θ/2.
    pub cosine_half: NodeId,
    /// Mask where the angle is a convention.
    pub degenerate: NodeId,
}

/// Returns the index of (i, j), i ≤ j < n, in an upper triangle stored row by row.
#[must_use]
pub const fn symmetric_index(n: usize, i: usize, j: usize) -> usize {
    let (i, j) = if i <= j { (i, j) } else { (j, i) };
    i * n - i * (i + 1) / 2 + j
}

/// Returns all (i, j) with i ≤ j < n.
pub(crate) fn upper(n: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..n).flat_map(move |i| (i..n).map(move |j| (i, j)))
}

impl Graph {
    /// Adds a rule. `extra` distinguishes rules with equal primitives and arguments but different constants.
    pub(crate) fn add_rule(&mut self, rule: Rule, extra: &[NodeId]) -> NodeId {
        let mut key = rule.arguments.clone();
        key.extend_from_slice(extra);
        let key = (rule.primitive, key);
        if let Some(&node) = self.rule_index.get(&key) {
            return node;
        }
        let varies = rule.arguments.iter().any(|&a| self.varies(a));
        if !varies {
            // If nothing differentiates it and it raises no flag, its value suffices.
            if rule.flags.is_empty() && rule.dihedral.is_none() && rule.half_square.is_none() {
                return rule.value;
            }
        }
        self.rules.push(rule);
        let id = u32::try_from(self.rules.len() - 1).expect("fewer than 2³² rules");
        let node = self.push(Op::Rule(id), varies);
        self.rule_index.insert(key, node);
        node
    }

    /// Returns the rule of a primitive with these arguments and no other constants, if there is one.
    pub(crate) fn known_rule(&self, primitive: Primitive, arguments: &[NodeId]) -> Option<NodeId> {
        self.rule_index.get(&(primitive, arguments.to_vec())).copied()
    }

    /// Changes a rule that was just added.
    pub(crate) fn change_rule(&mut self, node: NodeId, change: impl FnOnce(&mut Rule)) {
        if let Op::Rule(id) = self.op(node) {
            change(&mut self.rules[id as usize]);
        }
    }

    /// Creates x, computed as y; with its slopes, or its value only.
    pub(crate) fn compute_as(&mut self, x: NodeId, y: NodeId, slopes: bool) -> NodeId {
        let (one, zero) = (self.constant(1.0), self.constant(0.0));
        let first = if slopes { [one, zero] } else { [zero, one] }.map(|slope| vec![slope]);
        let rule = Rule::factored(Primitive::ComputedAs { slopes }, vec![y, x], y, first.to_vec(), Vec::new());
        // `diff` takes the derivatives of x instead.
        self.add_rule(Rule { second: None, ..rule }, &[])
    }

    /// Returns what stands in place of what, if the node is such a number.
    pub(crate) fn computed_as(&self, node: NodeId) -> Option<ComputedAs> {
        let rule = self.rule(node)?;
        let Primitive::ComputedAs { slopes } = rule.primitive else { return None };
        Some(ComputedAs { computed: rule.arguments[0], defined: rule.arguments[1], slopes })
    }

    /// Returns the node of ∂(rule)/∂(argument `by`). It is a rule itself if second derivatives are known.
    pub(crate) fn partial(&mut self, of: NodeId, by: usize) -> NodeId {
        let rule = self.rule(of).expect("only rules have partials of their own").clone();
        let value = self.product(None, &rule.first[by]);
        let n = rule.arguments.len();
        let Some(second) = &rule.second else { return value };
        if matches!(rule.primitive, Primitive::Turned(_) | Primitive::TurnedVector { .. }) {
            // A rotation by δ after another one: not the second derivative of their sum.
            return value;
        }
        if self.rule(value).is_some() || !self.varies(value) {
            return value;
        }
        let first = (0..n).map(|j| vec![self.sum_of_products(None, &second[symmetric_index(n, by, j)])]).collect();
        let flags = rule.flags.iter().map(|f| RuleFlag { order: f.order.saturating_sub(1), ..*f }).collect();
        let by = u8::try_from(by).expect("few arguments");
        self.add_rule(
            Rule {
                primitive: Primitive::Partial { of: of.0, by },
                arguments: rule.arguments,
                value,
                first,
                second: None,
                flags,
                dihedral: None,
                half_square: None,
                vector: None,
                by_square: None,
                inner: None,
            },
            &[],
        )
    }
}

impl Rule {
    /// Creates a rule without flags.
    #[must_use]
    pub fn smooth(
        primitive: Primitive,
        arguments: Vec<NodeId>,
        value: NodeId,
        first: Vec<NodeId>,
        second: Vec<NodeId>,
    ) -> Self {
        let first = first.into_iter().map(|entry| vec![entry]).collect();
        let second = second.into_iter().map(|entry| vec![vec![entry]]).collect();
        Self::factored(primitive, arguments, value, first, second)
    }

    /// Creates a rule without flags whose derivatives are products.
    #[must_use]
    pub fn factored(
        primitive: Primitive,
        arguments: Vec<NodeId>,
        value: NodeId,
        first: Vec<Product>,
        second: Vec<Vec<Product>>,
    ) -> Self {
        let second = Some(second);
        Self {
            primitive,
            arguments,
            value,
            first,
            second,
            flags: Vec::new(),
            dihedral: None,
            half_square: None,
            vector: None,
            by_square: None,
            inner: None,
        }
    }

    /// Adds a flag to the rule.
    #[must_use]
    pub fn flagged(mut self, order: u8, flag: Flag, mask: NodeId) -> Self {
        self.flags.push(RuleFlag { order, flag, mask, definite: false });
        self
    }

    /// Adds a flag of conventions that have no limit.
    #[must_use]
    pub fn without_limit(mut self, order: u8, mask: NodeId) -> Self {
        self.flags.push(RuleFlag { order, flag: Flag::Degenerate, mask, definite: true });
        self
    }
}
