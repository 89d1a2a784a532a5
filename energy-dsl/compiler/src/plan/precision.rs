//! Plans for one precision. A plan serves all precisions, and selects by a comparison of constants where they differ. A
//! compiler folds that in Rust; text in other languages has only the statements that its precision needs.

use super::statements::{Code, Statements};
use super::{GeneralPlan, Plan, RoutinePlan};
use crate::graph::{NodeId, Op};

impl Plan {
    /// Returns the plan for numbers that are rounded in this way.
    pub(crate) fn in_precision(&self, round: fn(f64) -> f64) -> Self {
        let code = |code: &Code| code.in_precision(round);
        let routine = |routine: &RoutinePlan| RoutinePlan {
            ordinary: code(&routine.ordinary),
            general: routine.general.as_ref().map(|general| GeneralPlan {
                before: code(&general.before),
                guard: code(&general.guard),
                path: code(&general.path),
                outside: general.outside.as_ref().map(code),
                ..*general
            }),
            ..*routine
        };
        Self {
            declaration: self.declaration.clone(),
            rest: routine(&self.rest),
            at_rest: self.at_rest.as_ref().map(code),
            routines: self.routines.iter().map(routine).collect(),
            expansion: self.expansion.as_ref().map(code),
            repetition: self.repetition.clone(),
            ..*self
        }
    }
}

impl Code {
    pub(super) fn in_precision(&self, round: fn(f64) -> f64) -> Self {
        let (statements, stands_for) = decided(self.statements.list(), round);
        let place = |at: NodeId| stands_for[at.0 as usize];
        let statements = Statements::of(statements).with_names(&self.statements, |at| Some(place(at)));
        self.on(statements, place).without_unused()
    }

    /// Removes statements that no result needs.
    fn without_unused(&self) -> Self {
        let list = self.statements.list();
        let mut needed = vec![false; list.len()];
        self.returned().for_each(|at| needed[at.0 as usize] = true);
        for place in (0..list.len()).rev() {
            if needed[place] {
                list[place].operands().for_each(|at| needed[at.0 as usize] = true);
            }
        }
        let mut places = vec![NodeId(0); list.len()];
        let mut kept = Vec::new();
        for (place, op) in list.iter().enumerate().filter(|(place, _)| needed[*place]) {
            places[place] = NodeId(u32::try_from(kept.len()).expect("fewer than 2³² statements"));
            kept.push(op.with_operands(|at| places[at.0 as usize]));
        }
        let place = |at: NodeId| places[at.0 as usize];
        let statements = Statements::of(kept);
        let statements = statements.with_names(&self.statements, |at| needed[at.0 as usize].then(|| place(at)));
        self.on(statements, place)
    }
}

/// Returns statements whose operands are what decided selections and connectives stand for, and for each statement the
/// one that stands for it.
fn decided(list: &[Op], round: fn(f64) -> f64) -> (Vec<Op>, Vec<NodeId>) {
    let mut stands_for: Vec<NodeId> = Vec::with_capacity(list.len());
    let mut truths: Vec<Option<bool>> = Vec::with_capacity(list.len());
    let mut statements = Vec::with_capacity(list.len());
    for (op, own) in list.iter().zip((0..).map(NodeId)) {
        let op = op.with_operands(|at| stands_for[at.0 as usize]);
        let truth = |at: NodeId| truths[at.0 as usize];
        let number = |at: NodeId| match statements[at.0 as usize] {
            Op::Constant(bits) => Some(round(f64::from_bits(bits))),
            _ => None,
        };
        let (place, outcome) = match op {
            Op::Less(a, b) => (own, number(a).zip(number(b)).map(|(a, b)| a < b)),
            Op::Truth(truth) => (own, Some(truth)),
            Op::Not(a) => (own, truth(a).map(|truth| !truth)),
            Op::Select(mask, yes, no) => match truth(mask) {
                Some(truth) => (if truth { yes } else { no }, None),
                None => (own, None),
            },
            // Either side of a connective decides, or leaves the other.
            Op::And(a, b) | Op::Or(a, b) => {
                let deciding = matches!(op, Op::Or(..));
                match (truth(a), truth(b)) {
                    (Some(truth), _) => (if truth == deciding { a } else { b }, None),
                    (_, Some(truth)) => (if truth == deciding { b } else { a }, None),
                    (None, None) => (own, None),
                }
            }
            _ => (own, None),
        };
        stands_for.push(place);
        truths.push(if place == own { outcome } else { truths[place.0 as usize] });
        statements.push(op);
    }
    (statements, stands_for)
}
