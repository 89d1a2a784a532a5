use energy_solve::Curvature;

/// Decides whether the next iteration projects the elements' Hessians: projection on demand (Longva, Löschner,
/// Fernández-Fernández, Larionov, Ascher and Bender 2023).
///
/// Exact Hessians converge fast while their sum is positive definite. After an indefinite sum, some iterations are
/// projected before exact Hessians are tried again, twice as many each time: projected ones always converge.
#[derive(Clone, Copy, Debug)]
pub(super) struct Projection {
    pub(super) curvature: Curvature,
    /// Projected iterations left until the next exact one.
    left: u32,
    /// Projected iterations after the next indefinite sum.
    next: u32,
}

impl Projection {
    /// The state at the start of a step.
    pub(super) fn on_demand() -> Self {
        Self { curvature: Curvature::Exact, left: 0, next: 1 }
    }

    /// Whether the next Hessians are exact.
    pub(super) fn is_exact(&self) -> bool {
        self.curvature == Curvature::Exact
    }

    /// Records an exact sum that was not positive definite.
    pub(super) fn demand(&mut self) {
        *self = Self { curvature: Curvature::Clamped, left: self.next, next: self.next.saturating_mul(2) };
    }

    /// Records a successful iteration. Steps that do not shrink mean that the iterate is far from the minimum; only
    /// projected Hessians guarantee descent there.
    pub(super) fn proceed(&mut self, shrinks: bool) {
        self.curvature = if shrinks && self.left == 0 { Curvature::Exact } else { Curvature::Clamped };
        self.left = self.left.saturating_sub(u32::from(shrinks));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Counts the projected iterations until the next exact one.
    fn projected(projection: &mut Projection) -> usize {
        let mut count = 0;
        while !projection.is_exact() {
            projection.proceed(true);
            count += 1;
        }
        count
    }

    #[test]
    fn the_number_of_projected_iterations_doubles() {
        let mut projection = Projection::on_demand();
        assert!(projection.is_exact());
        for waits in [2, 3, 5, 9] {
            projection.demand();
            assert_eq!(projected(&mut projection), waits);
        }
    }

    #[test]
    fn steps_that_do_not_shrink_are_followed_by_projected_ones() {
        let mut projection = Projection::on_demand();
        projection.proceed(true);
        assert!(projection.is_exact());
        projection.proceed(false);
        assert_eq!(projected(&mut projection), 1);
    }
}
