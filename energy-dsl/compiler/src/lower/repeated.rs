//! Recognises energies that are sums of like terms, such as sums over quadrature points. The terms differ in stored
//! numbers and constants only, so that one body in a loop computes all of them.

use std::collections::{BTreeMap, BTreeSet};

use super::Lowering;
use crate::check::{Binding, Program, Source, Typed, TypedKind};
use crate::functions::Shape;
use crate::graph::Form;
use energy_runtime::Kind;

pub use energy_runtime::tape::Repetition;

/// A sum of like terms.
pub(super) struct LikeTerms {
    /// The program of one term. It reads its differences from its own bindings.
    pub(super) term: Program,
    /// Number of terms.
    pub(super) terms: usize,
    /// Bindings of the term, each with the stored binding that it stands for in each term.
    pub(super) stored: Vec<(usize, Vec<usize>)>,
    /// Bindings of the term, each with its constant numbers in each term.
    pub(super) constants: Vec<(usize, Vec<Vec<f64>>)>,
}

/// Returns the terms of an energy that is a sum of like terms, times or divided by factors that do not move.
pub(super) fn like_terms(program: &Program) -> Option<LikeTerms> {
    if program.kind != Kind::Energy || !program.bindings.iter().any(|binding| binding.rest) {
        return None;
    }
    let mut unifier = Unifier::new(program);
    let result = unifier.sum(&program.result)?;
    let Unifier { bindings, stored, constants, terms, .. } = unifier;
    let mut term = program.clone();
    term.bindings = bindings;
    term.result = result;
    Some(LikeTerms { term, terms, stored, constants })
}

/// Finds one expression for like terms.
struct Unifier<'a> {
    program: &'a Program,
    /// Bindings of the program, then those of the term.
    bindings: Vec<Binding>,
    /// Number of terms.
    terms: usize,
    stored: Vec<(usize, Vec<usize>)>,
    constants: Vec<(usize, Vec<Vec<f64>>)>,
    /// Whether each binding is fixed, as far as it is known.
    fixed: BTreeMap<usize, bool>,
    /// The binding of the term that stands for these, one for each term.
    known: BTreeMap<Vec<usize>, usize>,
}

impl<'a> Unifier<'a> {
    fn new(program: &'a Program) -> Self {
        let bindings = program.bindings.clone();
        let (stored, constants) = (Vec::new(), Vec::new());
        Self { program, bindings, terms: 0, stored, constants, fixed: BTreeMap::new(), known: BTreeMap::new() }
    }

    /// Returns the term of a sum, with the factors of the sum.
    fn sum(&mut self, typed: &'a Typed) -> Option<Typed> {
        let within = |list: Vec<Typed>| match &typed.kind {
            TypedKind::Call(function, _) => Typed { kind: TypedKind::Call(function, list), ..typed.clone() },
            _ => unreachable!("compiler bug: a call"),
        };
        match &typed.kind {
            TypedKind::Binding(number) => self.sum(&self.program.bindings[*number].value),
            TypedKind::Call(function, list) => match (function.name, &list[..]) {
                ("+", _) => self.term(typed),
                ("*" | "/", [sum, factor]) if self.is_fixed(factor) => {
                    self.sum(sum).map(|term| within(vec![term, factor.clone()]))
                }
                ("*", [factor, sum]) if self.is_fixed(factor) => {
                    self.sum(sum).map(|term| within(vec![factor.clone(), term]))
                }
                _ => None,
            },
            _ => None,
        }
    }

    /// Returns whether an expression is a scalar that does not depend on positions.
    fn is_fixed(&mut self, typed: &Typed) -> bool {
        typed.shape == Shape::Scalar
            && match &typed.kind {
                TypedKind::Constant(_) | TypedKind::Pi => true,
                TypedKind::Input(source, _) => *source == Source::Parameter,
                TypedKind::Binding(number) => {
                    let (number, program) = (*number, self.program);
                    if let Some(&known) = self.fixed.get(&number) {
                        return known;
                    }
                    let binding = &program.bindings[number];
                    let fixed = binding.rest || self.is_fixed(&binding.value);
                    self.fixed.insert(number, fixed);
                    fixed
                }
                TypedKind::Call(_, list) => list.iter().all(|part| self.is_fixed(part)),
                _ => false,
            }
    }

    /// Returns the term that ((t₀ + t₁) + t₂) + … repeats.
    fn term(&mut self, mut typed: &'a Typed) -> Option<Typed> {
        let mut terms = Vec::new();
        while let TypedKind::Call(function, list) = &typed.kind
            && let ("+", [sum, last]) = (function.name, &list[..])
        {
            terms.insert(0, last);
            // The first term may itself be a sum.
            let (bindings, stored, constants) = (self.bindings.len(), self.stored.len(), self.constants.len());
            let all: Vec<&Typed> = std::iter::once(sum).chain(terms.iter().copied()).collect();
            if let Some(term) = self.unified(&all) {
                self.terms = all.len();
                return Some(term);
            }
            self.bindings.truncate(bindings);
            self.stored.truncate(stored);
            self.constants.truncate(constants);
            self.known.clear();
            typed = sum;
        }
        None
    }

    /// Returns one expression for expressions that differ in stored and constant numbers only.
    fn unified(&mut self, terms: &[&Typed]) -> Option<Typed> {
        let first = terms[0];
        self.program.budget.spend(terms.len() as u64, 0);
        if terms.iter().any(|term| term.shape != first.shape) {
            return None;
        }
        if let Some(numbers) = terms.iter().map(|term| self.literal(term)).collect::<Option<Vec<_>>>() {
            return Some(self.constant(first, numbers));
        }
        let part = |number: usize| -> Vec<&Typed> { terms.iter().map(|term| term.parts()[number]).collect() };
        if terms.iter().any(|term| term.parts().len() != first.parts().len()) {
            return None;
        }
        let same = |known: fn(&TypedKind, &TypedKind) -> bool| terms.iter().all(|term| known(&first.kind, &term.kind));
        let alike = match &first.kind {
            TypedKind::Binding(_) => return self.binding(terms),
            TypedKind::Constant(_) | TypedKind::Pi => false,
            TypedKind::Input(..) => same(|a, b| match (a, b) {
                (TypedKind::Input(a, i), TypedKind::Input(b, j)) => (a, i) == (b, j),
                _ => false,
            }),
            TypedKind::Call(..) => same(|a, b| match (a, b) {
                (TypedKind::Call(a, _), TypedKind::Call(b, _)) => a.name == b.name,
                _ => false,
            }),
            TypedKind::Gradient(..) => same(|a, b| match (a, b) {
                (TypedKind::Gradient(_, a, i), TypedKind::Gradient(_, b, j)) => (a, i) == (b, j),
                _ => false,
            }),
            TypedKind::Select(..) => same(|_, b| matches!(b, TypedKind::Select(..))),
            TypedKind::Array(..) => same(|_, b| matches!(b, TypedKind::Array(..))),
        };
        if !alike {
            return None;
        }
        let count = first.parts().len();
        let unified: Vec<Typed> = (0..count)
            .map(|number| match &first.kind {
                TypedKind::Call(function, _) if function.is_decided_by(number) => self.decisive(&part(number)),
                _ => self.unified(&part(number)),
            })
            .collect::<Option<_>>()?;
        let mut unified = unified.into_iter();
        Some(first.map_parts(|_| unified.next().expect("compiler bug: as many parts")))
    }

    /// Returns an argument that decides the operations of the call. If it is constant in one term, it must be the same
    /// constant in all.
    fn decisive(&mut self, terms: &[&Typed]) -> Option<Typed> {
        let numbers: Vec<_> = terms.iter().map(|term| self.literal(term)).collect();
        match &numbers[0] {
            Some(_) => numbers.iter().all(|other| *other == numbers[0]).then(|| terms[0].clone()),
            None if numbers.iter().any(Option::is_some) => None,
            None => self.unified(terms),
        }
    }

    /// Returns the numbers of an expression without inputs.
    fn literal(&self, typed: &Typed) -> Option<Vec<f64>> {
        let (mut stack, mut seen) = (vec![typed], BTreeSet::new());
        while let Some(part) = stack.pop() {
            self.program.budget.spend(1, 0);
            match &part.kind {
                TypedKind::Input(..) | TypedKind::Gradient(..) => return None,
                TypedKind::Binding(number) => {
                    let binding = &self.program.bindings[*number];
                    if binding.rest {
                        return None;
                    }
                    if seen.insert(*number) {
                        stack.push(&binding.value);
                    }
                }
                _ => stack.extend(part.parts()),
            }
        }
        let mut lowering = Lowering::new(self.program, Form::Robust, None);
        let nodes = lowering.expression(typed).parts;
        nodes.into_iter().map(|node| lowering.graph.as_constant(node)).collect()
    }

    /// Returns a constant of all terms, or a binding that stands for those of each term.
    fn constant(&mut self, first: &Typed, numbers: Vec<Vec<f64>>) -> Typed {
        if numbers.iter().all(|row| *row == numbers[0]) {
            return first.clone();
        }
        // A vector and a quaternion may have the same numbers.
        let shape = |binding: usize| self.bindings[binding].value.shape;
        let mut known = self.constants.iter().filter(|(number, _)| shape(*number) == first.shape);
        let known = known.find(|(_, rows)| *rows == numbers).map(|(number, _)| *number);
        let number = known.unwrap_or_else(|| {
            let number = self.add(first.clone(), true);
            self.constants.push((number, numbers));
            number
        });
        Typed { kind: TypedKind::Binding(number), ..first.clone() }
    }

    fn binding(&mut self, terms: &[&Typed]) -> Option<Typed> {
        let number = |term: &Typed| if let TypedKind::Binding(number) = term.kind { Some(number) } else { None };
        let numbers: Vec<usize> = terms.iter().map(|term| number(term)).collect::<Option<_>>()?;
        let first = numbers[0];
        if numbers.iter().all(|&number| number == first) {
            return Some(terms[0].clone());
        }
        let stands = match self.known.get(&numbers) {
            Some(&known) => known,
            None => {
                let program = self.program;
                let bindings: Vec<&Binding> = numbers.iter().map(|&number| &program.bindings[number]).collect();
                let number = if bindings.iter().all(|binding| binding.rest) {
                    let number = self.add(bindings[0].value.clone(), true);
                    self.stored.push((number, numbers.clone()));
                    number
                } else if bindings.iter().all(|binding| !binding.rest) {
                    let value = self.unified(&bindings.iter().map(|binding| &binding.value).collect::<Vec<_>>())?;
                    self.add(value, false)
                } else {
                    return None;
                };
                self.known.insert(numbers, number);
                number
            }
        };
        Some(Typed { kind: TypedKind::Binding(stands), ..terms[0].clone() })
    }

    fn add(&mut self, value: Typed, rest: bool) -> usize {
        self.bindings.push(Binding { name: String::new(), value, rest, unit: None, constant: None, depth: 0 });
        self.bindings.len() - 1
    }
}
