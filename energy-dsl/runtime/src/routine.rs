/// The routines of declarations: what one computes of its element.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum RoutineKind {
    /// The numbers that the rest shape determines, once per element.
    Rest,
    /// The energy U.
    Value,
    /// U and ∂U/∂x.
    Gradient,
    /// U, ∂U/∂x and the triangle of ∂²U/∂x².
    Hessian,
    /// U, its gradient and the upper triangle of its Hessian in reduced coordinates.
    ReducedHessian,
    /// ∂²U/∂x² v.
    HessianVector,
    /// The force f.
    Force,
    /// f, ∂f/∂x and ∂f/∂v.
    Jacobians,
    /// C and ∂C/∂x.
    ConstraintJacobian,
    /// C, ∂C/∂x and the triangles of ∂²Cᵢ/∂x².
    ConstraintHessian,
    /// U, ∂U/∂x and the triangle of ks Jᵀ J.
    GaussNewton,
    /// The residual r.
    Residual,
    /// r and ∂r/∂u.
    Jacobian,
    /// U, and its first and second derivatives by the point of this number.
    Vertex(u8),
    /// The state after a step.
    Next,
    /// The state after a step, with its derivatives by the unknowns and by the state before.
    NextJacobians,
    /// ∂U/∂u and ∂²U/∂u∂(state); f and ∂f/∂(state) of a force, r and ∂r/∂(state) of a residual.
    StateJacobian,
}

/// The names of [`RoutineKind::Vertex`]. Elements have at most 32 points.
const VERTEX_NAMES: [&str; 32] = [
    "vertex_0",
    "vertex_1",
    "vertex_2",
    "vertex_3",
    "vertex_4",
    "vertex_5",
    "vertex_6",
    "vertex_7",
    "vertex_8",
    "vertex_9",
    "vertex_10",
    "vertex_11",
    "vertex_12",
    "vertex_13",
    "vertex_14",
    "vertex_15",
    "vertex_16",
    "vertex_17",
    "vertex_18",
    "vertex_19",
    "vertex_20",
    "vertex_21",
    "vertex_22",
    "vertex_23",
    "vertex_24",
    "vertex_25",
    "vertex_26",
    "vertex_27",
    "vertex_28",
    "vertex_29",
    "vertex_30",
    "vertex_31",
];

impl RoutineKind {
    /// All kinds of routines but those of single vertices.
    pub const ALL: [Self; 16] = [
        Self::Rest,
        Self::Value,
        Self::Gradient,
        Self::Hessian,
        Self::ReducedHessian,
        Self::HessianVector,
        Self::Force,
        Self::Jacobians,
        Self::ConstraintJacobian,
        Self::ConstraintHessian,
        Self::GaussNewton,
        Self::Residual,
        Self::Jacobian,
        Self::Next,
        Self::NextJacobians,
        Self::StateJacobian,
    ];

    /// Returns the name of the method that runs the routine: `value`, `hessian_vector`, ….
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Rest => "rest",
            Self::Value => "value",
            Self::Gradient => "gradient",
            Self::Hessian => "hessian",
            Self::ReducedHessian => "reduced_hessian",
            Self::HessianVector => "hessian_vector",
            Self::Force => "force",
            Self::Jacobians => "jacobians",
            Self::ConstraintJacobian => "constraint_jacobian",
            Self::ConstraintHessian => "constraint_hessian",
            Self::GaussNewton => "gauss_newton",
            Self::Residual => "residual",
            Self::Jacobian => "jacobian",
            Self::Next => "next",
            Self::NextJacobians => "next_jacobians",
            Self::StateJacobian => "state_jacobian",
            Self::Vertex(point) => VERTEX_NAMES[point as usize % VERTEX_NAMES.len()],
        }
    }

    /// Returns the kind of a name; `None` for any other text.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        let of_vertices = (0..32).map(Self::Vertex);
        Self::ALL.into_iter().chain(of_vertices).find(|kind| kind.name() == name)
    }

    /// Returns whether the first group of results is of values, not of derivatives.
    #[must_use]
    pub const fn has_values(self) -> bool {
        !matches!(self, Self::HessianVector | Self::StateJacobian)
    }

    /// Returns whether the first result is an energy, which is infinite outside of its domain.
    #[must_use]
    pub const fn is_energy(self) -> bool {
        matches!(
            self,
            Self::Value | Self::Gradient | Self::Hessian | Self::ReducedHessian | Self::GaussNewton | Self::Vertex(_)
        )
    }
}

#[cfg(test)]
mod tests {
    use super::RoutineKind;

    #[test]
    fn names_lead_back_to_their_kinds() {
        assert!(RoutineKind::ALL.into_iter().all(|kind| RoutineKind::named(kind.name()) == Some(kind)));
        assert_eq!(RoutineKind::named("vertex_12"), Some(RoutineKind::Vertex(12)));
        assert_eq!(RoutineKind::named("hess"), None);
    }
}
