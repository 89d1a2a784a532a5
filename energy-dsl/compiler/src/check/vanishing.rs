//! Finds expressions that are 0 for all inputs, such as `norm(p - p)`.

use std::collections::BTreeMap;

use super::constant::evaluate;
use super::typed::{Binding, Typed, TypedKind};

/// Searches expressions of a program. Each binding is searched once.
pub(super) struct Vanishing<'a> {
    bindings: &'a [Binding],
    known: BTreeMap<usize, bool>,
}

impl<'a> Vanishing<'a> {
    pub(super) fn new(bindings: &'a [Binding]) -> Self {
        Self { bindings, known: BTreeMap::new() }
    }

    /// Returns whether all components of an expression are 0 whatever the inputs are. `false` also if it is unknown.
    pub(super) fn is_zero(&mut self, typed: &Typed) -> bool {
        match &typed.kind {
            TypedKind::Constant(value) => *value == 0.0,
            TypedKind::Pi | TypedKind::Input(..) | TypedKind::Gradient(..) => false,
            TypedKind::Binding(number) => {
                let (number, bindings) = (*number, self.bindings);
                if let Some(&known) = self.known.get(&number) {
                    return known;
                }
                let zero = self.is_zero(&bindings[number].value);
                self.known.insert(number, zero);
                zero
            }
            TypedKind::Select(_, yes, no) => self.is_zero(yes) && self.is_zero(no),
            TypedKind::Array(list) => list.iter().all(|entry| self.is_zero(entry)),
            TypedKind::Call(function, list) => self.is_zero_call(function.name, list),
        }
    }

    fn is_zero_call(&mut self, name: &str, list: &[Typed]) -> bool {
        match (name, list) {
            ("-", [a, b]) => self.are_same(a, b) || self.is_zero(a) && self.is_zero(b),
            ("cross", [a, b]) if self.are_same(a, b) => true,
            ("*" | "dot" | "cross" | "outer" | "ddot", [a, b]) => self.is_zero(a) || self.is_zero(b),
            ("/" | "[]", [a, _]) => self.is_zero(a),
            ("^", [a, b]) => evaluate(self.bindings, b).is_some_and(|power| power > 0.0) && self.is_zero(a),
            (
                "neg" | "abs" | "norm" | "norm_squared" | "sqrt" | "transpose" | "trace" | "det" | "sin" | "tan"
                | "asin" | "atan" | "sinh" | "tanh" | "erf" | "expm1" | "log1p" | "one_minus_cos" | "x_minus_sin",
                [a],
            ) => self.is_zero(a),
            ("+" | "min" | "max" | "vector" | "columns" | "quat", all) => all.iter().all(|part| self.is_zero(part)),
            _ => false,
        }
    }

    /// Returns whether two expressions have the same text. Names of the same value count as equal.
    fn are_same(&self, a: &Typed, b: &Typed) -> bool {
        let (a, b) = (self.named(a), self.named(b));
        let same = match (&a.kind, &b.kind) {
            (TypedKind::Constant(a), TypedKind::Constant(b)) => a == b,
            (TypedKind::Pi, TypedKind::Pi) => true,
            (TypedKind::Input(a, i), TypedKind::Input(b, j)) => (a, i) == (b, j),
            (TypedKind::Binding(a), TypedKind::Binding(b)) => a == b,
            (TypedKind::Call(a, _), TypedKind::Call(b, _)) => a.name == b.name,
            (TypedKind::Select(..), TypedKind::Select(..)) | (TypedKind::Array(_), TypedKind::Array(_)) => true,
            (TypedKind::Gradient(_, a, i), TypedKind::Gradient(_, b, j)) => (a, i) == (b, j),
            _ => false,
        };
        let (a, b) = (a.parts(), b.parts());
        same && a.len() == b.len() && a.into_iter().zip(b).all(|(a, b)| self.are_same(a, b))
    }

    /// Returns the value of a name if it is an input, a constant or another name.
    fn named<'b>(&'b self, mut typed: &'b Typed) -> &'b Typed {
        while let TypedKind::Binding(number) = typed.kind {
            let value = &self.bindings[number].value;
            if !matches!(value.kind, TypedKind::Binding(_) | TypedKind::Input(..) | TypedKind::Constant(_)) {
                break;
            }
            typed = value;
        }
        typed
    }
}
