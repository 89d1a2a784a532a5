use energy_solve::Curvature;

/// Decides whether the next iteration projects the elements' Hessians: projection on demand (Longva, Löschner,
/// Fernández-Fernández, Larionov, Ascher and Bender 2023).
///
/// Exact Hessians converge fast while their sum is positive definite. After a direction that leads nowhere, some
/// iterations are projected before exact Hessians are tried again, twice as many each time: projected ones always
/// converge.
///
/// An indefinite sum, or a step that does not shrink, also leads to projected iterations.
///
/// Cloth in contact is different: few vertices are in trouble, and the others proceed. Conjugate gradients stop at the
/// first direction of negative curvature, and the truncated direction is followed as long as it lowers the energy. One
/// projected iteration follows a step that contact shortened, because the barriers that stopped it are far from
/// quadratic. With obstacles, this saves a tenth of the iterations.
#[derive(Clone, Copy, Debug)]
pub(super) struct Projection {
    pub(super) curvature: Curvature,
    /// Whether truncated directions are followed.
    follows_truncated: bool,
    /// Projected iterations left until the next exact one.
    left: u32,
    /// Projected iterations after the next exact one that fails.
    next: u32,
}

/// A successful iteration.
#[derive(Clone, Copy, Debug)]
pub(super) struct Progress {
    /// Whether its direction solves the linear system. Otherwise it was truncated, because the sum was indefinite.
    pub is_solution: bool,
    /// Whether contact left its step whole.
    pub is_whole: bool,
    /// Whether it was a full step, and shorter than the one before.
    pub shrinks: bool,
}

impl Projection {
    /// The state at the start of a step.
    pub(super) fn on_demand(follows_truncated: bool) -> Self {
        Self { curvature: Curvature::Exact, follows_truncated, left: 0, next: if follows_truncated { 2 } else { 1 } }
    }

    /// Whether the next Hessians are exact.
    pub(super) fn is_exact(&self) -> bool {
        self.curvature == Curvature::Exact
    }

    /// Records an exact Hessian that failed.
    pub(super) fn demand(&mut self) {
        let (left, next) = (self.next, self.next.saturating_mul(2));
        *self = Self { curvature: Curvature::Clamped, left, next, ..*self };
    }

    /// Records an iteration that lowered the energy.
    pub(super) fn proceed(&mut self, progress: Progress) {
        if self.follows_truncated {
            self.left = self.left.saturating_sub(1).max(u32::from(!progress.is_whole));
            self.project_if(self.left > 0);
        } else if progress.is_solution {
            self.project_if(!progress.shrinks || self.left > 0);
            self.left = self.left.saturating_sub(u32::from(progress.shrinks));
        } else {
            self.demand();
        }
    }

    fn project_if(&mut self, is_wanted: bool) {
        self.curvature = if is_wanted { Curvature::Clamped } else { Curvature::Exact };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SHORTER: Progress = Progress { is_solution: true, is_whole: true, shrinks: true };

    /// Counts the projected iterations until the next exact one.
    fn projected(projection: &mut Projection) -> usize {
        let mut count = 0;
        while !projection.is_exact() {
            projection.proceed(SHORTER);
            count += 1;
        }
        count
    }

    #[test]
    fn the_number_of_projected_iterations_doubles() {
        for (follows_truncated, counts) in [(false, [2, 3, 5, 9]), (true, [2, 4, 8, 16])] {
            let mut projection = Projection::on_demand(follows_truncated);
            assert!(projection.is_exact());
            for expected in counts {
                projection.demand();
                assert_eq!(projected(&mut projection), expected);
            }
        }
    }

    #[test]
    fn steps_that_do_not_shrink_are_followed_by_projected_ones() {
        let mut projection = Projection::on_demand(false);
        projection.proceed(SHORTER);
        assert!(projection.is_exact());
        projection.proceed(Progress { shrinks: false, ..SHORTER });
        assert_eq!(projected(&mut projection), 1);
        projection.proceed(Progress { is_solution: false, ..SHORTER });
        assert_eq!(projected(&mut projection), 2);
    }

    #[test]
    fn truncated_directions_are_followed_and_shortened_steps_projected_once() {
        let mut projection = Projection::on_demand(true);
        projection.proceed(Progress { is_solution: false, shrinks: false, ..SHORTER });
        assert!(projection.is_exact());
        projection.proceed(Progress { is_whole: false, ..SHORTER });
        assert_eq!(projected(&mut projection), 1);
    }
}
