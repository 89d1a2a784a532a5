use energy_solve::Curvature;

/// Whether elements' Hessians are projected in the next iteration: on demand (Longva, Löschner, Fernández-Fernández, Larionov, Ascher and Bender 2023).
///
/// Exact ones converge fast where their sum is positive definite. Where it was not, so many iterations are projected before exact ones are tried again,
/// twice as many each time: where exact Hessians keep leading astray, projected ones still converge.
#[derive(Clone, Copy, Debug)]
pub(super) struct Projection {
    pub(super) curvature: Curvature,
    /// Projected iterations until the next try, …
    left: u32,
    /// … and after it, if that fails too.
    next: u32,
}

impl Projection {
    /// At the start of a step.
    pub(super) fn on_demand() -> Self {
        Self { curvature: Curvature::Exact, left: 0, next: 1 }
    }

    /// Whether Hessians are exact now.
    pub(super) fn is_exact(&self) -> bool {
        self.curvature == Curvature::Exact
    }

    /// After an exact sum that was not positive definite.
    pub(super) fn demand(&mut self) {
        *self = Self { curvature: Curvature::Clamped, left: self.next, next: self.next.saturating_mul(2) };
    }

    /// After another iteration. Those whose steps do not shrink are far from the end, where only projected ones are sure to lead there.
    pub(super) fn proceed(&mut self, shrinks: bool) {
        self.curvature = if shrinks && self.left == 0 { Curvature::Exact } else { Curvature::Clamped };
        self.left = self.left.saturating_sub(u32::from(shrinks));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// How many iterations are projected until the next exact one.
    fn projected(projection: &mut Projection) -> usize {
        let mut count = 0;
        while !projection.is_exact() {
            projection.proceed(true);
            count += 1;
        }
        count
    }

    #[test]
    fn exact_hessians_are_tried_ever_more_rarely() {
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
