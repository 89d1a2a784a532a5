/// The routines of declarations: what one computes of its element.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum RoutineKind {
    /// The numbers that the rest shape determines, once per element.
    Rest,
    /// U.
    Value,
    /// U and ∂U/∂x.
    Gradient,
    /// U, ∂U/∂x and the triangle of ∂²U/∂x².
    Hessian,
    /// U, its gradient and the upper triangle of its Hessian in reduced coordinates.
    ReducedHessian,
    /// ∂²U/∂x² v.
    HessianVector,
    /// f.
    Force,
    /// f, ∂f/∂x and ∂f/∂v.
    Jacobians,
    /// C and ∂C/∂x.
    ConstraintJacobian,
    /// C, ∂C/∂x and the triangles of ∂²Cᵢ/∂x².
    ConstraintHessian,
    /// U, ∂U/∂x and the triangle of ks Jᵀ J.
    GaussNewton,
    /// r.
    Residual,
    /// r and ∂r/∂u.
    Jacobian,
}

impl RoutineKind {
    /// All kinds of routines.
    pub const ALL: [Self; 13] = [
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
        }
    }

    /// Returns the kind of a name; `None` for any other text.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.name() == name)
    }

    /// Returns whether the first group of results is of values, not of derivatives.
    #[must_use]
    pub const fn has_values(self) -> bool {
        !matches!(self, Self::HessianVector)
    }

    /// Returns whether the first result is an energy, which is infinite outside of its domain.
    #[must_use]
    pub const fn is_energy(self) -> bool {
        matches!(self, Self::Value | Self::Gradient | Self::Hessian | Self::ReducedHessian | Self::GaussNewton)
    }
}

#[cfg(test)]
mod tests {
    use super::RoutineKind;

    #[test]
    fn names_lead_back_to_their_kinds() {
        assert!(RoutineKind::ALL.into_iter().all(|kind| RoutineKind::named(kind.name()) == Some(kind)));
        assert_eq!(RoutineKind::named("hess"), None);
    }
}
