//! The groups of results of each routine, in order.

use energy_runtime::RoutineKind;

/// How the numbers of a group are arranged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Shape {
    /// A single number, without components.
    Number,
    /// A list of numbers.
    Numbers,
    /// 3-vectors, one after the other.
    Vectors,
    /// 3×3 blocks, row by row, one after the other.
    Blocks,
}

impl Shape {
    /// Returns the shape for mixed unknowns, which are flat.
    pub(crate) const fn flat(self) -> Self {
        match self {
            Self::Number => Self::Number,
            Self::Numbers | Self::Vectors | Self::Blocks => Self::Numbers,
        }
    }
}

/// Returns name and shape of each group that a routine computes. For mixed unknowns, all but single numbers are flat.
pub(crate) const fn groups(kind: RoutineKind) -> &'static [(&'static str, Shape)] {
    use Shape::{Blocks, Number, Numbers, Vectors};
    match kind {
        RoutineKind::Rest => &[("precomputed", Numbers)],
        RoutineKind::Value => &[("value", Number)],
        RoutineKind::Gradient => &[("value", Number), ("gradient", Vectors)],
        RoutineKind::Hessian | RoutineKind::GaussNewton => {
            &[("value", Number), ("gradient", Vectors), ("hessian", Blocks)]
        }
        RoutineKind::ReducedHessian => &[("value", Number), ("gradient", Numbers), ("hessian", Numbers)],
        RoutineKind::HessianVector => &[("product", Vectors)],
        RoutineKind::Force => &[("force", Vectors)],
        RoutineKind::Jacobians => &[("force", Vectors), ("by_position", Blocks), ("by_velocity", Blocks)],
        RoutineKind::ConstraintJacobian => &[("value", Numbers), ("jacobian", Vectors)],
        RoutineKind::ConstraintHessian => &[("value", Numbers), ("jacobian", Vectors), ("hessians", Blocks)],
        RoutineKind::Residual => &[("value", Numbers)],
        RoutineKind::Jacobian => &[("value", Numbers), ("jacobian", Numbers)],
        RoutineKind::Next => &[("state", Numbers)],
        RoutineKind::NextJacobians => &[("state", Numbers), ("by_unknowns", Numbers), ("by_state", Numbers)],
        RoutineKind::StateJacobian => &[("gradient", Numbers), ("by_state", Numbers)],
        RoutineKind::Vertex(_) => &[("value", Number), ("gradient", Numbers), ("block", Vectors)],
    }
}
