//! Moves what the rest shape alone determines from the moving part to the `rest` block, so that each element computes
//! it once. det(D B) with a constant matrix B becomes det(D) det(B) first: D holds plain differences of points, D B
//! full inner products.

use std::collections::{BTreeMap, BTreeSet};

use super::Lowering;
use crate::check::{Binding, Program, Typed, TypedKind};
use crate::functions::{Function, Shape, find};
use crate::graph::{Form, NodeId, Op};

/// Operations that a stored number must save. Fewer cost less than reading it.
const FEWEST_OPERATIONS: usize = 4;

/// Returns the program with determinants split and constant parts moved. Without a `rest` block, nothing is stored, and
/// the program stays as it is.
pub(super) fn with_constant_parts_stored(program: &Program) -> Program {
    let mut stored = program.clone();
    if !program.bindings.iter().any(|binding| binding.rest) {
        return stored;
    }
    let split = Split::new(program);
    let moving = || program.bindings.iter().enumerate().filter(|(_, binding)| !binding.rest);
    for (number, binding) in moving() {
        stored.bindings[number].value = split.expression(&binding.value);
    }
    stored.result = split.expression(&program.result);
    stored.next = program.next.as_ref().map(|next| split.expression(next));
    let mut mover = Mover::new(&stored);
    let values: Vec<_> =
        moving().map(|(number, _)| (number, mover.expression(&stored.bindings[number].value))).collect();
    let result = mover.expression(&stored.result);
    let next = stored.next.as_ref().map(|next| mover.expression(next));
    let moved = mover.moved;
    values.into_iter().for_each(|(number, value)| stored.bindings[number].value = value);
    (stored.result, stored.next) = (result, next);
    stored.bindings.extend(moved);
    stored
}

/// Returns, for each binding, whether it depends on the `rest` block and constants only.
fn constant_bindings(program: &Program) -> Vec<bool> {
    let mut constant = Vec::with_capacity(program.bindings.len());
    for binding in &program.bindings {
        let value = binding.rest || is_constant(&binding.value, &constant);
        constant.push(value);
    }
    constant
}

fn is_constant(typed: &Typed, bindings: &[bool]) -> bool {
    match &typed.kind {
        TypedKind::Constant(_) | TypedKind::Pi => true,
        TypedKind::Binding(number) => bindings[*number],
        TypedKind::Input(..) | TypedKind::Gradient(..) => false,
        TypedKind::Call(..) | TypedKind::Array(_) | TypedKind::Select(..) => {
            typed.parts().into_iter().all(|part| is_constant(part, bindings))
        }
    }
}

/// Splits determinants of products of a moving and a constant matrix.
struct Split<'a> {
    program: &'a Program,
    constant: Vec<bool>,
    times: &'static Function,
}

impl<'a> Split<'a> {
    fn new(program: &'a Program) -> Self {
        let times = find("*").expect("compiler bug: no product");
        Self { program, constant: constant_bindings(program), times }
    }

    fn expression(&self, typed: &Typed) -> Typed {
        let TypedKind::Call(det, list) = &typed.kind else {
            return typed.map_parts(|part| self.expression(part));
        };
        match self.factors(&list[0]).filter(|_| det.name == "det") {
            Some(factors) => {
                let determinants = factors.iter().map(|factor| {
                    let kind = TypedKind::Call(det, vec![factor.clone()]);
                    self.expression(&Typed { kind, ..typed.clone() })
                });
                Typed { kind: TypedKind::Call(self.times, determinants.collect()), ..typed.clone() }
            }
            None => typed.map_parts(|part| self.expression(part)),
        }
    }

    /// Returns the factors of a product of two square matrices, one of them constant.
    fn factors(&self, matrix: &'a Typed) -> Option<&'a [Typed]> {
        match &matrix.kind {
            TypedKind::Binding(number) if !self.constant[*number] => {
                self.factors(&self.program.bindings[*number].value)
            }
            TypedKind::Call(times, list) if times.name == self.times.name => {
                let square = |factor: &Typed| matches!(factor.shape, Shape::Matrix(rows, columns) if rows == columns);
                let constant = list.iter().filter(|factor| is_constant(factor, &self.constant)).count();
                (constant == 1 && list.iter().all(square)).then_some(list)
            }
            _ => None,
        }
    }
}

/// Moves constant parts that are worth a stored number.
struct Mover<'a> {
    program: &'a Program,
    constant: Vec<bool>,
    /// The `rest` block and the parts that were moved to it.
    rest: Lowering<'a>,
    moved: Vec<Binding>,
    /// Numbers of the moved parts, by their nodes.
    known: BTreeMap<Vec<NodeId>, usize>,
}

impl<'a> Mover<'a> {
    fn new(program: &'a Program) -> Self {
        let rest = Lowering::new(program, Form::Robust, None);
        Self { program, constant: constant_bindings(program), rest, moved: Vec::new(), known: BTreeMap::new() }
    }

    fn expression(&mut self, typed: &Typed) -> Typed {
        match self.moved(typed) {
            Some(number) => Typed { kind: TypedKind::Binding(number), ..typed.clone() },
            None => typed.map_parts(|part| self.expression(part)),
        }
    }

    /// Moves an expression if it is constant, polynomial and worth a stored number; returns its binding.
    fn moved(&mut self, typed: &Typed) -> Option<usize> {
        if matches!(typed.kind, TypedKind::Binding(_)) || !is_constant(typed, &self.constant) {
            return None;
        }
        let parts = self.rest.expression(typed).parts;
        if self.operations(&parts)? < FEWEST_OPERATIONS * parts.len() {
            return None;
        }
        let next = self.program.bindings.len() + self.moved.len();
        let number = *self.known.entry(parts).or_insert(next);
        if number == next {
            self.moved.push(Binding {
                name: String::new(),
                value: typed.clone(),
                rest: true,
                unit: None,
                constant: None,
                depth: 0,
            });
        }
        Some(number)
    }

    /// Counts the operations from stored numbers to `parts`; `None` unless they are sums and products. Others may be
    /// singular, and must be flagged where the formula is evaluated.
    fn operations(&self, parts: &[NodeId]) -> Option<usize> {
        let stored = |number: &usize| self.program.bindings[*number].rest;
        let bindings = self.rest.done.iter().filter(|(number, _)| stored(number));
        let leaves: BTreeSet<NodeId> = bindings.flat_map(|(_, value)| value.parts.iter().copied()).collect();
        let (mut seen, mut stack, mut operations) = (leaves, parts.to_vec(), 0);
        while let Some(node) = stack.pop() {
            if seen.insert(node) {
                let op = self.rest.graph.op(node);
                match op {
                    Op::Constant(_) | Op::Pi => {}
                    Op::Neg(_) | Op::Add(..) | Op::Sub(..) | Op::Mul(..) => operations += 1,
                    _ => return None,
                }
                stack.extend(op.operands());
            }
        }
        Some(operations)
    }
}
