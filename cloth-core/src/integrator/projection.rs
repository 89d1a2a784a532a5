use energy_solve::Curvature;

/// Decides whether the next iteration projects the elements' Hessians.
///
/// Exact Hessians converge fast where their sum is positive definite. Where it is not, conjugate gradients stop at the
/// first direction of negative curvature. Up to there they follow a descent direction, which usually lowers the energy:
/// few vertices are in trouble, all others proceed. Only if a direction leads nowhere, some iterations are projected
/// before exact Hessians are tried again, twice as many each time (projection on demand: Longva, Löschner,
/// Fernández-Fernández, Larionov, Ascher and Bender 2023). Projected iterations always converge.
#[derive(Clone, Copy, Debug)]
pub(super) struct Projection {
    pub(super) curvature: Curvature,
    /// Projected iterations left until the next exact one.
    left: u32,
    /// Projected iterations after the next direction that leads nowhere.
    next: u32,
}

impl Projection {
    /// The state at the start of a step.
    pub(super) fn on_demand() -> Self {
        Self { curvature: Curvature::Exact, left: 0, next: 2 }
    }

    /// Whether the next Hessians are exact.
    pub(super) fn is_exact(&self) -> bool {
        self.curvature == Curvature::Exact
    }

    /// Records an exact Hessian whose direction does not lower the energy.
    pub(super) fn demand(&mut self) {
        *self = Self { curvature: Curvature::Clamped, left: self.next, next: self.next.saturating_mul(2) };
    }

    /// Records an iteration that lowered the energy. If contact shortened its step, the next Hessian is projected: the
    /// barriers that stopped the step are far from quadratic.
    pub(super) fn proceed(&mut self, is_free: bool) {
        self.left = self.left.saturating_sub(1).max(u32::from(!is_free));
        self.curvature = if self.left == 0 { Curvature::Exact } else { Curvature::Clamped };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_number_of_projected_iterations_doubles() {
        let mut projection = Projection::on_demand();
        for waits in [2, 4, 8, 16] {
            projection.demand();
            let mut count = 0;
            while !projection.is_exact() {
                projection.proceed(true);
                count += 1;
            }
            assert_eq!(count, waits);
            projection.proceed(true);
            assert!(projection.is_exact());
        }
    }

    #[test]
    fn one_projected_iteration_follows_a_step_that_contact_shortened() {
        let mut projection = Projection::on_demand();
        projection.proceed(false);
        assert!(!projection.is_exact());
        projection.proceed(false);
        assert!(!projection.is_exact());
        projection.proceed(true);
        assert!(projection.is_exact());
    }
}
