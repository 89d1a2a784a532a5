//! Constants, and constant values of expressions.

use std::collections::BTreeMap;

use super::expression::{Checker, Meaning};
use super::signature::Signature;
use super::typed::{Binding, Typed, TypedKind};
use super::vanishing::Vanishing;
use crate::budget::Budget;
use crate::diagnostic::{Diagnostic, Diagnostics};
use crate::functions::Shape;
use crate::syntax::{Constant, Expression, Name};

/// Constants outside declarations, visible in all of them.
pub(super) struct Globals {
    pub(super) bindings: Vec<Binding>,
    pub(super) scope: BTreeMap<String, Option<Meaning>>,
    /// Names as written, by their canonical names.
    pub(super) spellings: BTreeMap<String, String>,
    /// Pays for checking.
    pub(super) budget: Budget,
}

impl Globals {
    /// Checks the constants in order. Each one sees those before it.
    pub(super) fn of<'a>(
        constants: impl Iterator<Item = &'a Constant>,
        budget: &Budget,
        diagnostics: &mut Diagnostics,
    ) -> Self {
        let signature = Signature::empty();
        let mut globals =
            Self { bindings: Vec::new(), scope: BTreeMap::new(), spellings: BTreeMap::new(), budget: budget.clone() };
        for constant in constants {
            let canonical = constant.name.canonical();
            let mut checker = Checker::new(&signature, &globals, &[], budget, diagnostics);
            let meaning = checker.constant(constant);
            globals.bindings = checker.bindings;
            globals.spellings.insert(canonical.clone(), constant.name.text.clone());
            globals.scope.insert(canonical, meaning);
        }
        globals
    }
}

impl<'a> Checker<'a> {
    /// Checks a constant. It is a binding whose value needs no input.
    pub(super) fn constant(&mut self, constant: &'a Constant) -> Option<Meaning> {
        let value = self.expression(&constant.value)?;
        if value.shape != Shape::Scalar || evaluate(&self.bindings, &value).is_none() {
            let message = format!("the value of the constant `{}` is not a number", constant.name.text);
            let help = "use numbers and other constants only; name other values with `let`";
            self.diagnostics.push(Diagnostic::new(&constant.value.span, message).help(help));
            return None;
        }
        let number = evaluate(&self.bindings, &value);
        self.bindings.push(Binding {
            name: constant.name.text.clone(),
            value,
            rest: false,
            unit: Some(constant.unit.clone()),
            constant: number,
            depth: 1,
        });
        Some(Meaning::Binding(self.bindings.len() - 1, Shape::Scalar))
    }

    /// Returns the constant whole number that an expression equals.
    pub(super) fn whole_number(&mut self, expression: &'a Expression, what: &str) -> Option<usize> {
        let typed = self.expression(expression)?;
        match evaluate(&self.bindings, &typed) {
            Some(value) if value >= 0.0 && value.fract() == 0.0 && value <= f64::from(u16::MAX) => Some(value as usize),
            found => {
                let found = found.map_or_else(|| "this depends on inputs".into(), |value| format!("this is {value}"));
                let message = format!("{what} must be a constant whole number, but {found}");
                let help = "use an integer, an index of `sum`, or a `const`";
                self.diagnostics.push(Diagnostic::new(&expression.span, message).help(help));
                None
            }
        }
    }

    /// Returns the length of an array.
    pub(super) fn array_length(&mut self, name: &Name, expression: &'a Expression) -> Option<usize> {
        let length = self.whole_number(expression, &format!("the length of `{}`", name.text))?;
        if (1..=MOST_ENTRIES).contains(&length) {
            return Some(length);
        }
        let message = format!("an array has 1 to {MOST_ENTRIES} entries, but this has {length}");
        self.diagnostics.push(Diagnostic::new(&expression.span, message));
        None
    }
}

/// Maximum length of an array. Formulas are unrolled; longer arrays are data.
const MOST_ENTRIES: usize = 256;

/// Returns the constant that a value equals; `None` if it is not constant.
pub(super) fn evaluate(bindings: &[Binding], typed: &Typed) -> Option<f64> {
    match &typed.kind {
        TypedKind::Constant(value) => Some(*value),
        TypedKind::Pi => Some(std::f64::consts::PI),
        TypedKind::Binding(number) => bindings[*number].constant,
        TypedKind::Call(function, arguments) => {
            let numbers: Vec<f64> = arguments.iter().map(|a| evaluate(bindings, a)).collect::<Option<_>>()?;
            Some(match (function.name, numbers.as_slice()) {
                ("+", [a, b]) => a + b,
                ("-", [a, b]) => a - b,
                ("*", [a, b]) => a * b,
                ("/", [a, b]) => a / b,
                ("^", [a, b]) => a.powf(*b),
                ("neg", [a]) => -a,
                ("sqrt", [a]) => a.sqrt(),
                ("min", [a, b]) => a.min(*b),
                ("max", [a, b]) => a.max(*b),
                _ => return None,
            })
        }
        _ => None,
    }
}

/// Largest whole or broken exponent: a larger one overflows at almost every base.
const LARGEST_EXPONENT: f64 = 1000.0;

/// Describes why a function is undefined for constant arguments; `None` if it is defined or the arguments vary.
pub(super) fn undefined(bindings: &[Binding], function: &str, arguments: &[Typed]) -> Option<String> {
    let mut vanishing = Vanishing::new(bindings);
    let written: Vec<_> = arguments.iter().map(|argument| evaluate(bindings, argument)).collect();
    let mut number = |(argument, written): (&Typed, &Option<f64>)| {
        let zero = matches!(function, "/" | "^" | "log") && vanishing.is_zero(argument);
        written.or(zero.then_some(0.0))
    };
    let numbers: Vec<_> = arguments.iter().zip(&written).map(&mut number).collect();
    match (function, numbers.as_slice()) {
        ("*", [Some(x), None] | [None, Some(x)]) | ("/", [Some(x), None]) if x.is_infinite() => {
            Some(format!("`{function}` with `infinity` has no value where the other number is 0"))
        }
        ("+" | "-" | "*" | "/", [Some(a), Some(b)]) if is_indeterminate(function, *a, *b) => {
            let shown = |x: f64| x.to_string().replace("inf", "∞");
            Some(format!("`{} {function} {}` is not a number", shown(*a), shown(*b)))
        }
        ("/", [_, Some(0.0)]) if written[1].is_none() => {
            Some("a division by 0: the divisor is 0 for all inputs".into())
        }
        ("/", [_, Some(0.0)]) => Some("a division by 0".into()),
        ("sqrt", [Some(x)]) if *x < 0.0 => Some(format!("the root of {x}, which is negative")),
        ("log", [Some(x)]) if *x <= 0.0 => Some(format!("the logarithm of {x}, which is not positive")),
        ("acos" | "asin", [Some(x)]) if x.abs() > 1.0 => {
            Some(format!("`{function}` of {x}, which is outside of −1 to 1"))
        }
        ("^", [_, Some(n)]) if n.abs() > LARGEST_EXPONENT => {
            Some(format!("the exponent {n} is out of range: exponents are at most {LARGEST_EXPONENT} in size"))
        }
        ("^", [Some(0.0), Some(n)]) if *n < 0.0 => Some("a division by 0".into()),
        ("^", [Some(x), Some(n)]) if *x < 0.0 && n.fract() != 0.0 => {
            Some(format!("the power {n} of {x}, which is negative"))
        }
        _ => None,
    }
}

/// Returns whether an operation on numbers, one of them infinite, has no value.
fn is_indeterminate(function: &str, a: f64, b: f64) -> bool {
    let result = match function {
        "+" => a + b,
        "-" => a - b,
        "*" => a * b,
        _ => a / b,
    };
    (a.is_infinite() || b.is_infinite()) && result.is_nan()
}

/// Returns the constant outcome of a comparison; `None` if it is not constant.
pub(super) fn truth(bindings: &[Binding], typed: &Typed) -> Option<bool> {
    let TypedKind::Call(function, arguments) = &typed.kind else { return None };
    let [a, b] = arguments.as_slice() else { return None };
    if let "&&" | "||" = function.name {
        let (a, b) = (truth(bindings, a)?, truth(bindings, b)?);
        return Some(if function.name == "&&" { a && b } else { a || b });
    }
    let (a, b) = (evaluate(bindings, a)?, evaluate(bindings, b)?);
    Some(match function.name {
        "<" => a < b,
        "<=" => a <= b,
        ">" => a > b,
        ">=" => a >= b,
        "==" => a == b,
        "!=" => a != b,
        _ => return None,
    })
}
