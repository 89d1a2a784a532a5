//! Elements with planted faults, for the audit of the audit.

use std::sync::Arc;

use super::Interpreted;
use crate::graph::{Input, Op};
use crate::inspect::{Mutation, faults, is_proved_equal};
use crate::tape::{RoutineCode, are_numbers_of_results};

/// Routines that blocks are taken from.
pub(super) const EVALUATED: [&str; 8] =
    ["value", "gradient", "reduced_hessian", "force", "jacobians", "constraint_jacobian", "residual", "jacobian"];

impl Interpreted {
    /// Returns every fault that can be planted in the numbers of the ordinary path. Operations that only choose between
    /// two equivalent forms are left alone: both are right.
    #[must_use]
    pub fn mutations(&self) -> Vec<Mutation> {
        let evaluated = self.code.routines.iter().filter(|routine| EVALUATED.contains(&routine.name));
        // The unknowns of a residual need not come in threes. A fault must not read a number that does not exist.
        let unknowns = self.coordinates();
        let exists = |op: Op| !matches!(op, Op::Input(Input::Position(i)) if usize::from(i) >= unknowns);
        let mut list = Vec::new();
        for RoutineCode { name, ordinary, .. } in std::iter::once(&self.code.rest).chain(evaluated) {
            let is_number = are_numbers_of_results(ordinary);
            let statements = ordinary.statements.list().iter().enumerate();
            for (place, &before) in statements.filter(|(place, _)| is_number[*place]) {
                let planted = faults(before).into_iter().filter(|(_, after)| *after != before && exists(*after));
                list.extend(planted.map(|(fault, after)| Mutation { fault, routine: name, place, before, after }));
            }
        }
        list
    }

    /// Returns the element with a fault planted.
    #[must_use]
    pub fn mutated(&self, mutation: &Mutation) -> Self {
        let mut code = (*self.code).clone();
        let routine = match code.routines.iter_mut().find(|routine| routine.name == mutation.routine) {
            Some(routine) => routine,
            None => &mut code.rest,
        };
        routine.ordinary.statements = routine.ordinary.statements.with(mutation.place, mutation.after);
        routine.is_broken = true;
        // A fault that leaves too many numbers for a tape leaves the element sound: nothing notices it.
        let routines = code.record().map_or_else(|_| Arc::clone(&self.routines), Arc::new);
        Self { routines, code: Arc::new(code), ..self.clone() }
    }

    /// Returns whether a fault provably changes nothing in exact arithmetic. Both routines are built into one graph in
    /// which equal expressions are one node, rounding errors are 0, and 0 and 1 fold. `false` if that proves nothing.
    #[must_use]
    pub fn is_proved_equivalent(&self, mutation: &Mutation) -> bool {
        let routine = self.code.routines.iter().find(|routine| routine.name == mutation.routine);
        let sound = &routine.unwrap_or(&self.code.rest).ordinary;
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
