//! Lowers typed programs to scalar graphs.

#[cfg(test)]
mod fuzz;
mod parts;
mod repeated;
mod rest;
mod spectral;

pub use parts::{LoweredPart, lower_parts};
pub use repeated::Repetition;

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use crate::budget::{Budget, Phase};
use crate::check::{Program, Source, Typed, TypedKind};
use crate::diff::{Coordinates, Moving, Order, Unknown, Unknowns, by_increments, first_derivatives};
use crate::functions::{Lowered, RECOGNISERS, Shape};
use crate::graph::{Form, Graph, Input, NodeId, Origin, count, ordinary};
use repeated::{LikeTerms, like_terms};
use spectral::Spectral;

/// A program as a graph.
#[derive(Clone, Debug)]
pub struct Formula {
    /// Graph of the program.
    pub graph: Graph,
    /// Result, row by row.
    pub outputs: Vec<NodeId>,
    /// The numbers of each term, if the formula is one term of a sum.
    pub repetition: Option<Repetition>,
}

/// The `rest` block of a program as a graph, evaluated once for each element.
#[derive(Clone, Debug)]
pub struct RestFormula {
    /// Graph of the block.
    pub graph: Graph,
    /// Numbers to store, in the order of [`Input::Precomputed`].
    pub outputs: Vec<NodeId>,
    /// Determinants that the block names. They must be positive.
    pub determinants: Vec<NodeId>,
}

/// Sums of like terms become loops from this cost on. Below, unrolled terms share what they have in common.
const LEAST_COST_OF_LOOPS: usize = 1000;

/// The formulas of an element with memory. States are inputs that derivatives can be taken with respect to.
#[derive(Clone, Debug)]
pub struct Memory {
    /// The formula of the element, with the state as an input.
    pub formula: Formula,
    /// The state after a step.
    pub next: Formula,
}

/// A program as graphs.
#[derive(Clone, Debug)]
pub struct LoweredProgram {
    /// The part that the rest shape determines.
    pub rest: RestFormula,
    /// The part that moves.
    pub formula: Formula,
    /// The parts of an element with memory; `None` without a state.
    pub memory: Option<Memory>,
    /// The state at rest, from the rest shape and the parameters; `None` if it is given with each element.
    pub at_rest: Option<Formula>,
}

/// Lowers to the robust form, split into the part that the rest shape determines and the part that moves.
#[must_use]
pub fn lower(program: &Program) -> LoweredProgram {
    program.budget.enter(Phase::Lowering);
    let declared = stored_bindings(program);
    let program = &rest::with_constant_parts_stored(program);
    let mut rest = Lowering::new(program, Form::Robust, None);
    declared.into_iter().for_each(|binding| drop(rest.binding(binding)));
    let determinants = rest.graph.determinants().to_vec();
    // The loop of a sum has no place for the state after a step.
    let (outputs, formula, memory) = like_terms(program)
        .filter(|_| program.next.is_none())
        .map(|terms| repeated(&terms, &mut rest))
        .filter(|(_, formula)| formula.cost() >= LEAST_COST_OF_LOOPS)
        .map_or_else(|| unrolled(program, &mut rest), |(outputs, formula)| (outputs, formula, None));
    let at_rest = program.at_rest.as_ref().map(|state| {
        let mut lowering = Lowering::new(program, Form::Robust, None);
        let outputs = lowering.expression(state).parts;
        Formula { graph: lowering.graph, outputs, repetition: None }
    });
    LoweredProgram { rest: RestFormula { graph: rest.graph, outputs, determinants }, formula, memory, at_rest }
}

/// Returns the numbers to store, and the formulas.
fn unrolled(program: &Program, rest: &mut Lowering<'_>) -> (Vec<NodeId>, Formula, Option<Memory>) {
    let (outputs, slots) = stored(rest, stored_bindings(program));
    let memory = program.next.as_ref().map(|next| Memory {
        formula: moving(program, &program.result, &slots, true),
        next: moving(program, next, &slots, true),
    });
    (outputs, moving(program, &program.result, &slots, false), memory)
}

/// Returns the numbers of bindings, and the place of each binding among them.
fn stored(rest: &mut Lowering<'_>, bindings: impl IntoIterator<Item = usize>) -> (Vec<NodeId>, BTreeMap<usize, usize>) {
    let mut outputs = Vec::new();
    let mut slots = BTreeMap::new();
    for binding in bindings {
        slots.insert(binding, outputs.len());
        outputs.extend(rest.numbers(binding));
    }
    (outputs, slots)
}

/// Returns the numbers to store for all terms of a sum, and the formula of one term.
fn repeated(sum: &LikeTerms, rest: &mut Lowering<'_>) -> (Vec<NodeId>, Formula) {
    let LikeTerms { term, terms, stored: each, constants } = sum;
    let own: Vec<usize> = each.iter().map(|(b, _)| *b).chain(constants.iter().map(|(b, _)| *b)).collect();
    let common = stored_bindings(term).into_iter().filter(|binding| !own.contains(binding));
    let (mut outputs, mut slots) = stored(rest, common);
    let shared = outputs.len();
    let size = |binding: usize| term.bindings[binding].value.shape.size();
    let mut next = shared;
    for binding in own {
        slots.insert(binding, next);
        next += size(binding);
    }
    let stride = each.iter().map(|(binding, _)| size(*binding)).sum();
    for number in 0..*terms {
        outputs.extend(each.iter().flat_map(|(_, of)| rest.numbers(of[number])));
    }
    let row = |number: usize| constants.iter().flat_map(|(_, rows)| rows[number].clone()).collect();
    let table = (0..*terms).map(row).collect();
    (
        outputs,
        Formula { repetition: Some(Repetition { shared, stride, table }), ..moving(term, &term.result, &slots, false) },
    )
}

/// Lowers what moves. Powers of two that move outwards may meet and cancel, but may also be multiplied more often.
fn moving(program: &Program, result: &Typed, slots: &BTreeMap<usize, usize>, states_vary: bool) -> Formula {
    let formula = |outward: bool| {
        let mut moving = Lowering::new(program, Form::Robust, Some(slots.clone()));
        if states_vary {
            moving.vary_states();
        }
        moving.graph.move_outward(outward);
        let mut outputs = moving.expression(result).parts;
        moving.spectral.close(&mut moving.graph, &mut outputs);
        moving.graph.move_outward(false);
        Formula { graph: moving.graph, outputs, repetition: None }
    };
    let [inward, outward] = [false, true].map(formula);
    if outward.cost() < inward.cost() { outward } else { inward }
}

impl Formula {
    /// Returns the cost of the result on the ordinary path, that of all terms.
    fn cost(&self) -> usize {
        let mut graph = self.graph.clone();
        let outputs = ordinary(&mut graph, &self.outputs).map_or_else(|| self.outputs.clone(), |(outputs, _)| outputs);
        count(&graph, &outputs).cost() * self.repetition.as_ref().map_or(1, Repetition::terms)
    }
}

/// A program in its textbook form, without derivatives.
#[derive(Clone, Debug)]
pub struct TextbookFormula {
    /// The formula, as a graph. The derivatives that it uses are [`Input::Precomputed`].
    pub formula: Formula,
    /// The state after a step, in the same graph; empty without a state.
    pub next: Vec<NodeId>,
    /// Derivatives that the formula uses: node, section and index of the input number. Later ones may use earlier ones.
    pub gradients: Vec<(NodeId, Source, usize)>,
}

/// Lowers the whole program to its textbook form.
#[must_use]
pub fn lower_textbook(program: &Program) -> TextbookFormula {
    let mut lowering = Lowering::new(program, Form::Textbook, None);
    let outputs = lowering.expression(&program.result).parts;
    let next = program.next.as_ref().map_or_else(Vec::new, |next| lowering.expression(next).parts);
    TextbookFormula {
        formula: Formula { graph: lowering.graph, outputs, repetition: None },
        next,
        gradients: lowering.gradients,
    }
}

/// Returns the bindings of the `rest` block that the moving part reads, in order.
fn stored_bindings(program: &Program) -> Vec<usize> {
    fn visit(program: &Program, expression: &Typed, seen: &mut [bool]) {
        match &expression.kind {
            TypedKind::Binding(number) => {
                if !std::mem::replace(&mut seen[*number], true) && !program.bindings[*number].rest {
                    visit(program, &program.bindings[*number].value, seen);
                }
            }
            _ => expression.parts().into_iter().for_each(|part| visit(program, part, seen)),
        }
    }
    let mut seen = vec![false; program.bindings.len()];
    std::iter::once(&program.result).chain(&program.next).for_each(|result| visit(program, result, &mut seen));
    (0..seen.len()).filter(|&b| seen[b] && program.bindings[b].rest).collect()
}

struct Lowering<'a> {
    program: &'a Program,
    unknowns: Unknowns,
    graph: Graph,
    done: BTreeMap<usize, Lowered>,
    /// Index of each stored binding; `None` if bindings are computed here.
    slots: Option<BTreeMap<usize, usize>>,
    /// Derivatives that the evaluation of the textbook form must supply.
    gradients: Vec<(NodeId, Source, usize)>,
    spectral: Spectral,
    /// Number of nodes of the bindings that the current one reads.
    nested: usize,
}

impl<'a> Lowering<'a> {
    fn new(program: &'a Program, form: Form, slots: Option<BTreeMap<usize, usize>>) -> Self {
        let mut graph = match form {
            Form::Robust => Graph::robust(RECOGNISERS),
            Form::Textbook => Graph::textbook(),
        }
        .paid_by(&program.budget);
        graph.compensate(!program.uncompensated);
        differentiated_parameters(program).into_iter().for_each(|number| graph.vary(Input::Parameter(number)));
        Self {
            program,
            unknowns: Unknowns::of(&program.moving),
            graph,
            done: BTreeMap::new(),
            slots,
            gradients: Vec::new(),
            spectral: Spectral::default(),
            nested: 0,
        }
    }

    /// Makes the state an input that derivatives can be taken with respect to.
    fn vary_states(&mut self) {
        for state in self.program.state() {
            let numbers = state.first..state.first + state.input_type.size();
            numbers.for_each(|number| self.graph.vary(Input::Parameter(Budget::input_number(number))));
        }
    }

    fn inputs(&mut self, shape: Shape, first: usize, input: fn(u16) -> Input) -> Lowered {
        let number = |i: usize| Budget::input_number(first + i);
        Lowered { shape, parts: (0..shape.size()).map(|i| self.graph.input(input(number(i)))).collect() }
    }

    fn binding(&mut self, number: usize) -> Lowered {
        if let Some(value) = self.done.get(&number) {
            return value.clone();
        }
        let binding = &self.program.bindings[number];
        let slot = self.slots.as_ref().filter(|_| binding.rest).map(|slots| slots[&number]);
        let budget = &self.program.budget;
        let (within, before) = (budget.at_binding(Some(number)), self.graph.len());
        let outer = std::mem::take(&mut self.nested);
        let value = match slot {
            Some(slot) => self.stored(binding.value.shape, slot),
            None => self.expression(&binding.value),
        };
        let operations = self.graph.len() - before;
        budget.note(number, operations - self.nested);
        self.nested = outer + operations;
        budget.at_binding(within);
        if !binding.name.is_empty() {
            for (&part, index) in value.parts.iter().zip(value.shape.indices()) {
                self.graph.name(part, &format!("{}{index}", binding.name));
            }
        }
        self.done.insert(number, value.clone());
        value
    }

    /// Returns the numbers to store for a binding. A truth value is stored as 1 or 0.
    fn numbers(&mut self, binding: usize) -> Vec<NodeId> {
        let Lowered { shape, parts } = self.binding(binding);
        match shape {
            Shape::Truth => {
                let (one, zero) = (self.graph.constant(1.0), self.graph.constant(0.0));
                vec![self.graph.select(parts[0], one, zero)]
            }
            _ => parts,
        }
    }

    /// Reads a stored binding.
    fn stored(&mut self, shape: Shape, slot: usize) -> Lowered {
        let numbers = self.inputs(shape, slot, Input::Precomputed);
        match shape {
            Shape::Truth => {
                let zero = self.graph.constant(0.0);
                let is_zero = self.graph.equal(numbers.node(), zero);
                Lowered::truth(self.graph.not(is_zero))
            }
            _ => numbers,
        }
    }

    fn expression(&mut self, expression: &Typed) -> Lowered {
        self.program.budget.spend(1, 0);
        match &expression.kind {
            TypedKind::Constant(value) => Lowered::scalar(self.graph.constant(*value)),
            TypedKind::Pi => Lowered::scalar(self.graph.pi()),
            TypedKind::Input(source, first) => {
                let mut value = self.inputs(expression.shape, *first, input_of(*source));
                // Derivatives are by its increments. Whoever evaluates the textbook form moves it otherwise.
                if *source == Source::Position && self.graph.form() == Form::Robust {
                    let before = if expression.shape == Shape::Motion { 3 } else { 0 };
                    if let Some(rotation) = self.unknowns.rotation(&mut self.graph, first + before) {
                        value.parts.splice(before.., rotation);
                    }
                }
                if self.program.is_given_rotation(*source, *first) {
                    let before = if expression.shape == Shape::Motion { 3 } else { 0 };
                    self.graph.note_origin(&value.parts[before..], Origin::UnitQuaternion);
                }
                value
            }
            TypedKind::Binding(number) => self.binding(*number),
            TypedKind::Call(function, arguments) => {
                let mut arguments: Vec<_> = arguments.iter().map(|a| self.expression(a)).collect();
                self.spectral.separate(&mut self.graph, &mut arguments);
                (function.lower)(&mut self.graph, &arguments)
            }
            TypedKind::Select(condition, yes, no) => {
                let mut operands = [condition, yes, no].map(|operand| self.expression(operand));
                self.spectral.separate(&mut self.graph, &mut operands);
                let [condition, yes, no] = operands;
                let mask = condition.node();
                let parts = yes.parts.iter().zip(&no.parts).map(|(&y, &n)| self.graph.select(mask, y, n)).collect();
                Lowered { shape: expression.shape, parts }
            }
            TypedKind::Array(list) => {
                let parts = list.iter().flat_map(|f| self.expression(f).parts).collect();
                Lowered { shape: expression.shape, parts }
            }
            TypedKind::Gradient(of, source, first) => {
                let mut of = [self.expression(of).node()];
                self.spectral.close(&mut self.graph, &mut of);
                let ([of], shape) = (of, expression.shape);
                let is_turned = *source == Source::Position && self.unknowns.is_rotation(*first);
                let parts = match (self.graph.form(), source) {
                    (Form::Textbook, _) if is_turned => {
                        let by_numbers = self.textbook_gradient(of, *source, *first..*first + 4);
                        by_increments(&mut self.graph, *first, &by_numbers)
                    }
                    (Form::Textbook, _) => self.textbook_gradient(of, *source, *first..*first + shape.size()),
                    (Form::Robust, Source::Position) => self.gradient_by_unknown(of, *first),
                    (Form::Robust, _) => self.gradient_by_parameter(of, *first, shape),
                };
                Lowered { shape, parts }
            }
        }
    }

    /// Returns inputs for the derivatives, which the evaluation of the textbook form supplies.
    fn textbook_gradient(&mut self, of: NodeId, source: Source, numbers: Range<usize>) -> Vec<NodeId> {
        let derivative = |by: usize| {
            let known = self.gradients.iter().position(|&known| known == (of, source, by));
            let number = known.unwrap_or_else(|| {
                self.gradients.push((of, source, by));
                self.gradients.len() - 1
            });
            self.graph.input(Input::Precomputed(Budget::input_number(number)))
        };
        numbers.map(derivative).collect()
    }

    fn gradient_by_unknown(&mut self, of: NodeId, first: usize) -> Vec<NodeId> {
        let g = &mut self.graph;
        let coordinates = Coordinates::reduced(g, &[of], &self.unknowns, Moving::Unknowns);
        let reduced = first_derivatives(g, &[of], &coordinates, Order::FirstToDifferentiate).remove(0);
        let is_it = |unknown: &Unknown| unknown.first_number == first;
        let unknown = self.unknowns.list.iter().position(is_it).expect("compiler bug: a gradient by no unknown");
        coordinates.expand(g, &reduced, unknown)
    }

    fn gradient_by_parameter(&mut self, of: NodeId, first: usize, shape: Shape) -> Vec<NodeId> {
        let parameters = self.inputs(shape, first, Input::Parameter).parts;
        let coordinates = Coordinates::of_nodes(&mut self.graph, &parameters);
        first_derivatives(&mut self.graph, &[of], &coordinates, Order::FirstToDifferentiate).remove(0)
    }
}

/// Returns the constructor of inputs of a section.
fn input_of(source: Source) -> fn(u16) -> Input {
    match source {
        Source::Position => Input::Position,
        Source::Velocity => Input::Velocity,
        Source::Rest => Input::Rest,
        Source::Parameter => Input::Parameter,
    }
}

/// Returns the parameter numbers that a program differentiates by.
fn differentiated_parameters(program: &Program) -> BTreeSet<u16> {
    fn visit(program: &Program, typed: &Typed, found: &mut BTreeSet<u16>) {
        program.budget.spend(1, 0);
        if let TypedKind::Gradient(_, Source::Parameter, first) = &typed.kind {
            let number = |i: usize| u16::try_from(first + i).expect("fewer than 65536 inputs");
            found.extend((0..typed.shape.size()).map(number));
        }
        typed.parts().into_iter().for_each(|part| visit(program, part, found));
    }
    let mut found = BTreeSet::new();
    program
        .bindings
        .iter()
        .map(|binding| &binding.value)
        .chain([&program.result])
        .chain(&program.next)
        .for_each(|t| visit(program, t, &mut found));
    found
}
