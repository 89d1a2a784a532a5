//! The subexpressions of a program in its textbook form, for audits that look for the one that loses digits.

use std::collections::BTreeMap;

use super::Lowering;
use crate::check::{Program, Typed, TypedKind};
use crate::functions::Shape;
use crate::graph::{Form, Graph, NodeId};

/// A subexpression that computes numbers.
pub struct LoweredPart<'a> {
    /// The expression in the source.
    pub expression: &'a Typed,
    /// Number of the binding whose value it is.
    pub binding: Option<usize>,
    /// Nodes of the components of its value.
    pub outputs: Vec<NodeId>,
    /// Subexpressions that it is computed from, by index.
    pub operands: Vec<usize>,
}

/// Larger formulas are not taken apart.
const MOST: usize = 2000;

/// Lowers every subexpression, operands before their uses. `None` if the formula contains derivatives or is too large.
#[must_use]
pub fn lower_parts(program: &Program) -> Option<(Graph, Vec<LoweredPart<'_>>)> {
    let mut walk = Walk {
        lowering: Lowering::new(program, Form::Textbook, None),
        list: Vec::new(),
        bindings: BTreeMap::new(),
        is_complete: true,
    };
    walk.visit(&program.result, None);
    let is_complete = walk.is_complete && walk.lowering.gradients.is_empty();
    is_complete.then_some((walk.lowering.graph, walk.list))
}

struct Walk<'a> {
    lowering: Lowering<'a>,
    list: Vec<LoweredPart<'a>>,
    /// Index of the value of each binding; `None` if it is not computed.
    bindings: BTreeMap<usize, Option<usize>>,
    is_complete: bool,
}

impl<'a> Walk<'a> {
    /// Adds an expression and its operands. Returns its index; `None` for inputs, constants and conditions.
    fn visit(&mut self, expression: &'a Typed, binding: Option<usize>) -> Option<usize> {
        match &expression.kind {
            TypedKind::Constant(_) | TypedKind::Pi | TypedKind::Input(..) => return None,
            TypedKind::Binding(number) => {
                if let Some(known) = self.bindings.get(number) {
                    return *known;
                }
                let program = self.lowering.program;
                let index = self.visit(&program.bindings[*number].value, Some(*number));
                self.bindings.insert(*number, index);
                return index;
            }
            TypedKind::Gradient(..) => self.is_complete = false,
            _ => {}
        }
        self.is_complete &= self.list.len() < MOST;
        if expression.shape == Shape::Truth || !self.is_complete {
            return None;
        }
        let operands = expression.parts().into_iter().filter_map(|part| self.visit(part, None)).collect();
        let outputs = self.lowering.expression(expression).parts;
        self.list.push(LoweredPart { expression, binding, outputs, operands });
        Some(self.list.len() - 1)
    }
}
