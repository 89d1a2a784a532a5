//! Elements with planted faults, for the audit of the audit.

use std::sync::Arc;

use super::Interpreted;
use crate::graph::{Input, Op};
use crate::inspect::{Mutation, faults, is_proved_equal};
use crate::plan::RoutinePlan;
use crate::tape::tapes;
use energy_runtime::RoutineKind;

/// Routines that blocks are taken from.
pub(super) const EVALUATED: [RoutineKind; 12] = [
    RoutineKind::Value,
    RoutineKind::Gradient,
    RoutineKind::Hessian,
    RoutineKind::ReducedHessian,
    RoutineKind::Force,
    RoutineKind::Jacobians,
    RoutineKind::ConstraintJacobian,
    RoutineKind::Residual,
    RoutineKind::Jacobian,
    RoutineKind::Next,
    RoutineKind::NextJacobians,
    RoutineKind::StateJacobian,
];

impl Interpreted {
    /// Returns every fault that can be planted in the numbers of the ordinary path. Operations that only choose between
    /// two equivalent forms are left alone: both are right.
    #[must_use]
    pub fn mutations(&self) -> Vec<Mutation> {
        let evaluated = self.plan.routines.iter().filter(|routine| EVALUATED.contains(&routine.kind));
        // The unknowns of a residual need not come in threes. A fault must not read a number that does not exist.
        let unknowns = self.coordinates();
        let exists = |op: Op| !matches!(op, Op::Input(Input::Position(i)) if usize::from(i) >= unknowns);
        let mut list = Vec::new();
        for RoutinePlan { kind, ordinary, .. } in std::iter::once(&self.plan.rest).chain(evaluated) {
            let (routine, is_number) = (kind.name(), ordinary.are_numbers_of_results());
            let statements = ordinary.statements.list().iter().enumerate();
            for (place, &before) in statements.filter(|(place, _)| is_number[*place]) {
                let planted = faults(before).into_iter().filter(|(_, after)| *after != before && exists(*after));
                list.extend(planted.map(|(fault, after)| Mutation { fault, routine, place, before, after }));
            }
        }
        list
    }

    /// Returns the element with a fault planted.
    #[must_use]
    pub fn mutated(&self, mutation: &Mutation) -> Self {
        let mut plan = (*self.plan).clone();
        let routine = match plan.routines.iter_mut().find(|routine| routine.kind.name() == mutation.routine) {
            Some(routine) => routine,
            None => &mut plan.rest,
        };
        routine.ordinary.statements = routine.ordinary.statements.with(mutation.place, mutation.after);
        routine.is_broken = true;
        // A fault that leaves too many numbers for a tape leaves the element sound: nothing notices it.
        let routines = tapes(&plan).map_or_else(|_| Arc::clone(&self.routines), Arc::new);
        Self { routines, plan: Arc::new(plan), ..self.clone() }
    }

    /// Returns whether a fault provably changes nothing in exact arithmetic. Both routines are built into one graph in
    /// which equal expressions are one node, rounding errors are 0, and 0 and 1 fold. `false` if that proves nothing.
    #[must_use]
    pub fn is_proved_equivalent(&self, mutation: &Mutation) -> bool {
        let routine = self.plan.routines.iter().find(|routine| routine.kind.name() == mutation.routine);
        let sound = &routine.unwrap_or(&self.plan.rest).ordinary;
        let mut broken = sound.clone();
        broken.statements = broken.statements.with(mutation.place, mutation.after);
        is_proved_equal(sound, &broken)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::inspect::Fault;

    /// Pure rounding errors are 0 in exact arithmetic, and a squared cross product has no sign.
    #[test]
    fn what_changes_nothing_is_proved_and_what_changes_something_is_not() {
        let hinge = "energy Angle(a, b, c, d: Point) { dihedral(a, b, c, d) }";
        let bend = "energy Bend(a, b, c: Point) { 1 - dot(unit(b - a), unit(c - b)) }";
        for (source, least) in [(hinge, 100), (bend, 5)] {
            let element = Interpreted::from_source(source).unwrap().remove(0);
            let all = element.mutations();
            let proved = all.iter().filter(|mutation| element.is_proved_equivalent(mutation)).count();
            assert!(proved >= least && proved < all.len() / 2, "{proved} of {}", all.len());
        }
        let square = Interpreted::from_source("energy S(a, b: Point) { norm_squared(a - b) }").unwrap().remove(0);
        let value = |m: &&Mutation| m.routine == "value";
        let proved: Vec<Fault> = square
            .mutations()
            .iter()
            .filter(value)
            .filter(|mutation| square.is_proved_equivalent(mutation))
            .map(|mutation| mutation.fault)
            .collect();
        assert_eq!(proved, [Fault::SwappedOperands; 3], "a − b or b − a, squared");
    }
}
