//! Joins statements to the steps of a tape. A statement whose only reader is a sum or product joins it, which saves a
//! store, a load and the choice of an operation. The operations and their order do not change.

use super::recorder::{is_fixed, operation};
use crate::graph::{NodeId, Op};
use crate::plan::Code;
use energy_runtime::tape::Operation;

/// One instruction to be.
pub(super) struct Step {
    pub(super) operation: Operation,
    /// The statements whose results are operands.
    pub(super) reads: Vec<usize>,
}

/// Returns the step that computes each statement; `None` for inputs, constants, and statements that joined another.
pub(super) fn steps(code: &Code) -> Vec<Option<Step>> {
    let list = code.statements.list();
    let mut readers = vec![0_u32; list.len()];
    for operand in list.iter().flat_map(|op| op.operands()).chain(code.returned()) {
        readers[operand.0 as usize] += 1;
    }
    // Results that are returned have a reader of their own.
    code.returned().for_each(|result| readers[result.0 as usize] += 1);
    let mut joined = vec![false; list.len()];
    let mut steps: Vec<Option<Step>> = Vec::with_capacity(list.len());
    for place in (0..list.len()).rev() {
        if joined[place] || is_fixed(list[place]) {
            steps.push(None);
            continue;
        }
        let only = |node: NodeId| (readers[node.0 as usize] == 1).then(|| list[node.0 as usize]);
        let (operation, reads, own) = match join(list[place], &only) {
            Some(step) => step,
            None => (operation(list[place]), list[place].operands().collect(), Vec::new()),
        };
        own.into_iter().for_each(|statement| joined[statement.0 as usize] = true);
        steps.push(Some(Step { operation, reads: reads.into_iter().map(|node| node.0 as usize).collect() }));
    }
    steps.reverse();
    steps
}

/// A joint operation, its operands, and the statements that joined.
type Joint = (Operation, Vec<NodeId>, Vec<NodeId>);

/// Joins a statement with those that it alone reads. `only` returns the statement of an operand with one reader.
fn join(op: Op, only: &dyn Fn(NodeId) -> Option<Op>) -> Option<Joint> {
    match op {
        Op::MulAdd(d, e, sum) => match only(sum) {
            Some(Op::Mul(a, b)) => Some((Operation::MulThenMulAdd, vec![a, b, d, e], vec![sum])),
            Some(Op::MulAdd(a, b, c)) => match only(c) {
                Some(Op::Mul(x, y)) => Some((Operation::MulThenTwoMulAdds, vec![x, y, a, b, d, e], vec![sum, c])),
                _ => Some((Operation::TwoMulAdds, vec![a, b, c, d, e], vec![sum])),
            },
            Some(Op::NegMulAdd(a, b, c)) => Some((Operation::NegMulAddThenMulAdd, vec![a, b, c, d, e], vec![sum])),
            _ => match (only(d), only(e)) {
                (_, Some(Op::MulAdd(a, b, c))) => Some((Operation::MulAddThenMulAdd, vec![a, b, c, d, sum], vec![e])),
                (Some(Op::MulAdd(a, b, c)), _) => Some((Operation::MulAddThenMulAdd, vec![a, b, c, e, sum], vec![d])),
                _ => None,
            },
        },
        Op::NegMulAdd(d, e, sum) => match only(sum) {
            Some(Op::Mul(a, b)) => Some((Operation::MulThenNegMulAdd, vec![a, b, d, e], vec![sum])),
            Some(Op::MulAdd(a, b, c)) => Some((Operation::MulAddThenNegMulAdd, vec![a, b, c, d, e], vec![sum])),
            Some(Op::NegMulAdd(a, b, c)) => Some((Operation::TwoNegMulAdds, vec![a, b, c, d, e], vec![sum])),
            _ => None,
        },
        Op::Sub(x, y) => match (only(x), only(y)) {
            (Some(Op::Mul(a, b)), Some(Op::Mul(c, d))) => {
                Some((Operation::TwoMulsThenSub, vec![a, b, c, d], vec![x, y]))
            }
            _ => None,
        },
        Op::Mul(x, y) => [(x, y), (y, x)].into_iter().find_map(|(factor, product)| match only(product) {
            Some(Op::MulAdd(a, b, c)) => Some((Operation::MulAddThenMul, vec![a, b, c, factor], vec![product])),
            Some(Op::Mul(a, b)) => Some((Operation::TwoMuls, vec![a, b, factor], vec![product])),
            _ => None,
        }),
        Op::Add(x, y) => [(x, y), (y, x)].into_iter().find_map(|(sum, term)| match only(sum) {
            Some(Op::Add(a, b)) => Some((Operation::TwoAdds, vec![a, b, term], vec![sum])),
            _ => None,
        }),
        _ => None,
    }
}
