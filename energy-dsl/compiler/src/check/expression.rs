use std::collections::{BTreeMap, BTreeSet};

use super::constant::Globals;
use super::names::CONTEXTUAL;
use super::remedy;
use super::signature::{InputName, Signature};
use super::typed::{Binding, Source, Typed, TypedKind};
use crate::budget::Budget;
use crate::diagnostic::{Diagnostic, Diagnostics, Span};
use crate::functions::{self, Shape};
use crate::syntax::{Body, Expression, ExpressionKind, Name, UserFunction, canonical, without_hat};

/// Maximum number of calls of the text's functions in a formula. Each is inlined, and nested calls multiply.
const MOST_CALLS: usize = 4096;

/// Maximum number of nested expressions, through calls of the text's functions too. Checking recurses over them.
const DEEPEST_EXPRESSION: usize = 1000;

/// Maximum number of nested operations of a value, through other values too. Later passes recurse over them.
const DEEPEST_VALUE: usize = 1600;

/// Bytes of a typed expression.
const TYPED_BYTES: u64 = 200;

/// The meaning of a name.
#[derive(Clone)]
pub(super) enum Meaning {
    Input(Source, usize, Shape, Option<usize>),
    Binding(usize, Shape),
    /// The entries of an array.
    Entries(Vec<Meaning>),
    /// The index variable of a `sum`.
    Index(usize),
}

/// Checks the expressions of one declaration. An invalid expression is reported once and yields `None`; its siblings
/// are still checked.
pub(super) struct Checker<'a> {
    pub(super) signature: &'a Signature,
    pub(super) functions: Vec<&'a UserFunction>,
    pub(super) diagnostics: &'a mut Diagnostics,
    /// Scopes: global constants, inputs, then bodies.
    pub(super) scopes: Vec<BTreeMap<String, Option<Meaning>>>,
    calls: Vec<String>,
    /// Definitions as written, by their canonical names.
    pub(super) spellings: BTreeMap<String, String>,
    /// Number of calls that were inlined.
    inlined: usize,
    used: BTreeSet<String>,
    pub(super) in_rest: bool,
    /// Number of terms that sums were unrolled to.
    pub(super) terms: usize,
    pub(super) bindings: Vec<Binding>,
    pub(super) reads_velocities: bool,
    /// New values of the state, row by row.
    pub(super) next: Option<Typed>,
    /// Values at rest that the signature gives the states.
    pub(super) initial: Vec<(&'a [Name], &'a Expression)>,
    /// The value of the state at rest, row by row; `None` if it is given with each element.
    pub(super) at_rest: Option<Typed>,
    budget: &'a Budget,
    /// Whether the budget was spent or an expression too deep, which is reported once.
    spent: bool,
    /// Number of expressions that are being checked, each within the one before.
    level: usize,
    /// Name of the declaration.
    pub(super) declaration: &'a str,
}

impl<'a> Checker<'a> {
    pub(super) fn new(
        signature: &'a Signature,
        globals: &Globals,
        functions: &[&'a UserFunction],
        budget: &'a Budget,
        diagnostics: &'a mut Diagnostics,
    ) -> Self {
        let inputs = signature
            .names
            .iter()
            .map(|n| (n.name.canonical(), Some(Meaning::Input(n.source, n.first, n.shape, n.length))))
            .collect();
        let written = signature.names.iter().map(|n| (n.name.canonical(), n.name.text.clone()));
        let spellings = globals.spellings.clone().into_iter().chain(written).collect();
        Self {
            signature,
            functions: functions.to_vec(),
            diagnostics,
            scopes: vec![globals.scope.clone(), inputs],
            calls: Vec::new(),
            spellings,
            inlined: 0,
            used: BTreeSet::new(),
            in_rest: false,
            terms: 0,
            bindings: globals.bindings.clone(),
            reads_velocities: false,
            next: None,
            initial: Vec::new(),
            at_rest: None,
            budget,
            spent: false,
            level: 0,
            declaration: "the constants",
        }
    }

    pub(super) fn error(&mut self, span: &Span, message: impl Into<String>) -> Option<Typed> {
        self.diagnostics.push(Diagnostic::new(span, message));
        None
    }

    /// Reports inputs that the formula does not read.
    pub(super) fn report_unused(&mut self, declaration: &Name) {
        let is_read = |input: &InputName| self.used.contains(&input.name.canonical());
        let of_source = |source| self.signature.names.iter().filter(move |input| input.source == source);
        let velocities: Vec<_> = of_source(Source::Velocity).filter(|input| is_read(input)).collect();
        for input in &self.signature.names {
            // A velocity is that of an unknown.
            let moves = |velocity: &&InputName| {
                velocity.numbers.start < input.numbers.end && input.numbers.start < velocity.numbers.end
            };
            let is_read = is_read(input) || input.source == Source::Position && velocities.iter().any(moves);
            let name = &input.name;
            if !is_read && !name.text.starts_with('_') {
                let message = format!("the input `{}` of {} is never used", name.text, declaration.text);
                self.diagnostics.push(Diagnostic::new(&name.span, message).help("use it in the formula, or remove it"));
            }
        }
    }

    #[inline(never)]
    pub(super) fn body(&mut self, body: &'a Body, outermost: bool) -> Option<Typed> {
        let outer_functions = self.functions.len();
        self.functions.extend(&body.functions);
        self.scopes.push(BTreeMap::new());
        for constant in &body.constants {
            let meaning = self.constant(constant);
            self.enter(&constant.name, meaning);
        }
        for statement in &body.lets {
            if statement.rest && !outermost {
                self.error(&statement.name.span, "a `rest` block stands in the outermost body only");
            }
            let was = self.in_rest;
            self.in_rest |= statement.rest;
            let value = self.expression(&statement.value);
            self.in_rest = was;
            self.define(&statement.name, value, statement.rest);
        }
        let result = self.expression(&body.result);
        if outermost {
            self.at_rest = self.state_at_rest();
        }
        if let Some(next) = &body.next {
            match outermost {
                true => self.next = self.next_state(next),
                false => drop(self.error(&next.span, "a `next` block stands in the outermost body only")),
            }
        }
        self.scopes.pop();
        self.functions.truncate(outer_functions);
        result
    }

    pub(super) fn define(&mut self, name: &Name, value: Option<Typed>, rest: bool) {
        let value = value.and_then(|value| self.check_depth(value));
        let meaning = value.map(|value| self.bind(&name.text, value, rest));
        self.enter(name, meaning);
    }

    /// Makes a name known in the innermost scope.
    fn enter(&mut self, name: &Name, meaning: Option<Meaning>) {
        self.spellings.insert(name.canonical(), name.text.clone());
        self.scopes.last_mut().expect("compiler bug: no scope").insert(name.canonical(), meaning);
    }

    /// Keeps a value for its uses.
    pub(super) fn bind(&mut self, name: &str, value: Typed, rest: bool) -> Meaning {
        let shape = value.shape;
        match value.kind {
            TypedKind::Array(entries) => {
                let entries = entries.into_iter().enumerate();
                Meaning::Entries(entries.map(|(i, entry)| self.bind(&format!("{name}[{i}]"), entry, rest)).collect())
            }
            _ => {
                let constant = super::constant::evaluate(&self.bindings, &value);
                let depth = self.depth_of(&value);
                self.bindings.push(Binding { name: name.to_owned(), value, rest, unit: None, constant, depth });
                Meaning::Binding(self.bindings.len() - 1, shape)
            }
        }
    }

    pub(super) fn find(&self, name: &str) -> Option<Option<Meaning>> {
        let canonical = canonical(name);
        self.scopes.iter().rev().find_map(|scope| scope.get(&canonical).cloned())
    }

    /// Returns the number of nested expressions of a value, through bindings too.
    pub(super) fn depth_of(&self, value: &Typed) -> usize {
        1 + match &value.kind {
            TypedKind::Binding(number) => self.bindings[*number].depth,
            _ => value.parts().into_iter().map(|part| self.depth_of(part)).max().unwrap_or(0),
        }
    }

    /// Refuses a value that depends on others through too many steps.
    pub(super) fn check_depth(&mut self, value: Typed) -> Option<Typed> {
        if self.depth_of(&value) <= DEEPEST_VALUE {
            return Some(value);
        }
        self.too_deep(&value.span.clone(), DEEPEST_VALUE)
    }

    #[inline(never)]
    fn too_deep(&mut self, span: &Span, levels: usize) -> Option<Typed> {
        if !std::mem::replace(&mut self.spent, true) {
            let message = format!("this value depends on others through more than {levels} nested operations");
            let help = "sum over an index, or split the formula into several declarations";
            self.diagnostics.push(Diagnostic::new(span, message).help(help));
        }
        None
    }

    pub(super) fn expression(&mut self, expression: &'a Expression) -> Option<Typed> {
        if self.level == DEEPEST_EXPRESSION {
            return self.too_deep(&expression.span, DEEPEST_EXPRESSION);
        }
        self.level += 1;
        let typed = self.typed(expression);
        self.level -= 1;
        typed
    }

    fn typed(&mut self, expression: &'a Expression) -> Option<Typed> {
        let span = &expression.span;
        self.pay(1, span)?;
        match &expression.kind {
            ExpressionKind::Number(value) => Some(constant(*value, span)),
            ExpressionKind::Name(name) => self.name(name),
            ExpressionKind::Call(name, arguments) => self.call(name, arguments),
            ExpressionKind::Body(body) => self.body(body, self.scopes.len() == 3 && self.calls.is_empty()),
            ExpressionKind::If(condition, yes, no) => self.conditional([yes, no], condition, span),
            ExpressionKind::List(items) => self.list(items, span),
            ExpressionKind::Index(of, index) => self.index(of, index),
            ExpressionKind::Component(of, name) => self.component(of, name),
            ExpressionKind::Sum(sum) => self.sum(sum, span),
            ExpressionKind::Each(each) => self.each(each, span),
        }
    }

    /// Pays for typed expressions. `None` if the budget is spent.
    #[inline(never)]
    pub(super) fn pay(&mut self, expressions: usize, span: &Span) -> Option<()> {
        let expressions = expressions as u64;
        let Err(stop) = self.budget.try_spend(2 * expressions, TYPED_BYTES * expressions) else { return Some(()) };
        if !std::mem::replace(&mut self.spent, true) {
            self.diagnostics.push(stop.diagnostic(self.budget, span, self.declaration));
        }
        None
    }

    #[inline(never)]
    fn name(&mut self, name: &Name) -> Option<Typed> {
        if let Some(found) = self.find(&name.text) {
            self.used.insert(name.canonical());
            let meaning = found?;
            return self.meant(name, meaning);
        }
        match name.text.as_str() {
            "π" | "pi" | "PI" => {
                return Some(Typed { kind: TypedKind::Pi, shape: Shape::Scalar, span: name.span.clone() });
            }
            "infinity" => return Some(constant(f64::INFINITY, &name.span)),
            _ => {}
        }
        // `â` is the unit vector of `a`. Among Rust tokens it is one identifier.
        if let Some(plain) = without_hat(&name.text).filter(|plain| self.find(plain).is_some()) {
            let vector = self.name(&Name { text: plain, span: name.span.clone() })?;
            return self.apply("unit", &name.span, vec![vector]);
        }
        let remedy = self.remedy_for_name(&name.text);
        self.diagnostics.push(Diagnostic::new(&name.span, format!("unknown name `{}`", name.text)).help(remedy));
        None
    }

    fn meant(&mut self, name: &Name, meaning: Meaning) -> Option<Typed> {
        let span = name.span.clone();
        let entries = match meaning {
            Meaning::Binding(number, shape) => return Some(Typed { kind: TypedKind::Binding(number), shape, span }),
            Meaning::Index(number) => return Some(constant(number as f64, &span)),
            Meaning::Input(Source::Velocity, first, Shape::Twist, None) => return self.velocity_of_motion(name, first),
            Meaning::Input(source, first, shape, None) => return self.input(name, source, first, shape),
            Meaning::Input(source, first, shape, Some(length)) => {
                // Reports one error for all entries.
                if shape != Shape::Twist || source != Source::Velocity {
                    self.input(name, source, first, shape)?;
                }
                let entry = |i: usize| Meaning::Input(source, first + i * shape.size(), shape, None);
                (0..length).map(entry).collect()
            }
            Meaning::Entries(entries) => entries,
        };
        self.pay(entries.len(), &span)?;
        let entries: Vec<_> = entries.into_iter().map(|entry| self.meant(name, entry)).collect::<Option<_>>()?;
        let length = u16::try_from(entries.len()).expect("arrays are short");
        Some(Typed { kind: TypedKind::Array(entries), shape: Shape::Array(length), span })
    }

    /// Returns the velocity of a motion as a twist: its angular velocity, and the velocity of its position, which comes
    /// first among the increments.
    fn velocity_of_motion(&mut self, name: &Name, first: usize) -> Option<Typed> {
        let mut part = |first| self.input(name, Source::Velocity, first, Shape::Vector(3));
        let (linear, angular) = (part(first)?, part(first + 3)?);
        self.apply("twist", &name.span, vec![angular, linear])
    }

    fn input(&mut self, name: &Name, source: Source, first: usize, shape: Shape) -> Option<Typed> {
        let changes = self.signature.is_state(first) || self.signature.is_time_step(first);
        if self.in_rest && source == Source::Parameter && changes {
            let message = format!(
                "`{}` changes from step to step, so neither the `rest` block nor a state at rest can use it",
                name.text
            );
            let help = "they are computed once, from the rest shape and parameters";
            self.diagnostics.push(Diagnostic::new(&name.span, message).help(help));
            return None;
        }
        match (source, self.in_rest) {
            (Source::Position | Source::Velocity, true) => {
                let message = format!("`{}` moves, so the `rest` block cannot use it", name.text);
                self.diagnostics.push(
                    Diagnostic::new(&name.span, message)
                        .help("the rest block is computed once, from the rest shape and parameters"),
                );
                return None;
            }
            (Source::Rest, false) => {
                let message =
                    format!("`{}` belongs to the rest shape and is known in the `rest` block only", name.text);
                self.diagnostics.push(
                    Diagnostic::new(&name.span, message).help("compute values from it there: rest { let … = …; }"),
                );
                return None;
            }
            _ => {}
        }
        self.reads_velocities |= source == Source::Velocity;
        Some(Typed { kind: TypedKind::Input(source, first), shape, span: name.span.clone() })
    }

    fn call(&mut self, name: &Name, arguments: &'a [Expression]) -> Option<Typed> {
        match name.text.as_str() {
            "gradient" => return self.gradient(name, arguments),
            "identity" => return self.identity(name, arguments),
            "%" => return self.remainder(name, arguments),
            "interpolate" if !self.functions.iter().any(|function| function.name.text == "interpolate") => {
                return self.interpolate(name, arguments);
            }
            "len" if !self.functions.iter().any(|function| function.name.text == "len") => {
                return self.length(name, arguments);
            }
            _ => {}
        }
        let checked = self.arguments(arguments)?;
        self.called(name, checked)
    }

    /// Checks all arguments, so that each error is reported.
    fn arguments(&mut self, arguments: &'a [Expression]) -> Option<Vec<Typed>> {
        let mut checked = Some(Vec::with_capacity(arguments.len()));
        for argument in arguments {
            let typed = self.expression(argument);
            checked = checked.zip(typed).map(|(mut list, typed)| {
                list.push(typed);
                list
            });
        }
        checked
    }

    #[inline(never)]
    fn called(&mut self, name: &Name, checked: Vec<Typed>) -> Option<Typed> {
        // A function of the text with a name of the language is an error already.
        let user = self.functions.iter().rev().find(|f| f.name.text == name.text).copied();
        let user = user.filter(|_| functions::find(&name.text).is_none() || CONTEXTUAL.contains(&name.text.as_str()));
        if let Some(function) = user {
            return self.inline(name, function, checked);
        }
        // `M⁻¹` as printed.
        if let (
            "^",
            Some(Typed { shape: Shape::Matrix(..), .. }),
            Some(Typed { kind: TypedKind::Constant(-1.0), .. }),
        ) = (name.text.as_str(), checked.first(), checked.get(1))
        {
            return self.apply("inverse", &name.span, checked.into_iter().take(1).collect());
        }
        self.apply(&name.text, &name.span, checked)
    }

    #[inline(never)]
    pub(super) fn apply(&mut self, name: &str, span: &Span, arguments: Vec<Typed>) -> Option<Typed> {
        let Some(function) = functions::find(name) else {
            let remedy = self.remedy_for_function(name);
            self.diagnostics.push(Diagnostic::new(span, format!("unknown function `{name}`")).help(remedy));
            return None;
        };
        let shapes: Vec<Shape> = arguments.iter().map(|a| a.shape).collect();
        let array = shapes.iter().find(|s| matches!(s, Shape::Array(_) | Shape::Rows(_)));
        let name = if name == "neg" { "-" } else { name };
        if let Some(array) = array {
            let message = format!("`{name}` does not take {array}");
            let literal = arguments.iter().find_map(|argument| match &argument.kind {
                TypedKind::Array(entries) if argument.shape == Shape::Array(3) => Some(entries),
                _ => None,
            });
            let help = match literal {
                Some(entries) if entries.iter().all(|entry| entry.shape == Shape::Scalar) => {
                    "take its entries: a[0], a[1], …, or write a vector as vector(a, b, c)"
                }
                _ => "take its entries: a[0], a[1], …, or sum(j in 0..4, … a[j] …)",
            };
            self.diagnostics.push(Diagnostic::new(span, message).help(help));
            return None;
        }
        match (function.shape)(&shapes) {
            Ok(shape) => {
                if let Some(message) = super::constant::undefined(&self.bindings, name, &arguments) {
                    return self.error(span, message);
                }
                if let "==" | "!=" = name
                    && super::equality::is_measureless(&self.bindings, &arguments)
                {
                    let message = format!(
                        "`{name}` of numbers that move: they are equal at single inputs only, and limits count there"
                    );
                    let help =
                        "leave the comparison out, since limits are found without it; a region is abs(a - b) < c";
                    self.diagnostics.push(Diagnostic::new(span, message).help(help));
                    return None;
                }
                Some(Typed { kind: TypedKind::Call(function, arguments), shape, span: span.clone() })
            }
            Err(message) => {
                let help = remedy::for_shapes(function, &shapes);
                self.diagnostics.push(Diagnostic::new(span, format!("`{name}`: {message}")).help(help));
                None
            }
        }
    }

    /// Inlines a function of the text: its body with the arguments bound.
    #[inline(never)]
    fn inline(&mut self, name: &Name, function: &'a UserFunction, arguments: Vec<Typed>) -> Option<Typed> {
        if function.parameters.len() != arguments.len() {
            let message =
                format!("`{}` takes {} arguments, found {}", name.text, function.parameters.len(), arguments.len());
            return self.error(&name.span, message);
        }
        if self.calls.contains(&function.name.text) {
            return self.error(&name.span, format!("`{}` calls itself: a formula cannot be recursive", name.text));
        }
        self.inlined += 1;
        if self.inlined > MOST_CALLS {
            let message = format!("the functions of this formula are called more than {MOST_CALLS} times in all");
            let help = "name a repeated value with `let`, so that it is computed once";
            // One message is enough: further calls would all repeat it.
            if self.inlined == MOST_CALLS + 1 {
                self.diagnostics.push(Diagnostic::new(&name.span, message).help(help));
            }
            return None;
        }
        self.calls.push(function.name.text.clone());
        self.pay(self.scopes[0].len(), &name.span)?;
        let scopes = vec![self.scopes[0].clone(), BTreeMap::new()];
        let outer = std::mem::replace(&mut self.scopes, scopes);
        for (parameter, argument) in function.parameters.iter().zip(arguments) {
            self.define(parameter, Some(argument), false);
        }
        let result = self.body(&function.body, false);
        self.scopes = outer;
        self.calls.pop();
        result
    }

    #[inline(never)]
    fn identity(&mut self, name: &Name, arguments: &[Expression]) -> Option<Typed> {
        match arguments {
            [Expression { kind: ExpressionKind::Number(n), .. }] if [2.0, 3.0, 4.0].contains(n) => {
                self.apply("identity", &name.span, vec![constant(0.0, &name.span); *n as usize])
            }
            _ => self.error(&name.span, "`identity` takes the number 2, 3 or 4, as in identity(3)"),
        }
    }

    /// Checks `gradient(U, p)`, the derivative of a scalar with respect to an unknown or a parameter.
    #[inline(never)]
    fn gradient(&mut self, name: &Name, arguments: &'a [Expression]) -> Option<Typed> {
        let [of, by] = arguments else {
            return self
                .error(&name.span, "`gradient` takes a scalar and an unknown or parameter, as in gradient(θ, x1)");
        };
        let (of_typed, by_typed) = (self.expression(of), self.expression(by));
        let (of_typed, by_typed) = (of_typed?, by_typed?);
        if of_typed.shape != Shape::Scalar {
            return self.error(&of.span, format!("`gradient` takes a scalar, but this is {}", of_typed.shape));
        }
        match by_typed.kind {
            TypedKind::Input(source @ (Source::Position | Source::Parameter), first) => {
                let shape = match by_typed.shape {
                    // The derivative by the increment of a rotation is a torque.
                    Shape::Quat if source == Source::Position && self.signature.is_rotation(first) => Shape::Vector(3),
                    shape => shape,
                };
                if !matches!(shape, Shape::Scalar | Shape::Vector(_) | Shape::Matrix(..)) {
                    return self
                        .error(&by.span, format!("`gradient` is by a scalar, vector or matrix, not by {shape}"));
                }
                if self.rest_reads(&of_typed, (source, first), false, &mut BTreeSet::new()) {
                    let message = "the `rest` block uses this parameter, and its values are constants here";
                    self.diagnostics.push(
                        Diagnostic::new(&by.span, message)
                            .help("compute what depends on it outside of the `rest` block"),
                    );
                    return None;
                }
                let kind = TypedKind::Gradient(Box::new(of_typed), source, first);
                Some(Typed { kind, shape, span: name.span.clone() })
            }
            _ => self.error(&by.span, "`gradient` is by a declared unknown or parameter"),
        }
    }

    /// Returns whether an expression depends on an input through the `rest` block. `within` says whether the expression
    /// belongs to that block; `seen` holds the bindings of either kind that were searched.
    fn rest_reads(
        &self,
        typed: &Typed,
        input: (Source, usize),
        within: bool,
        seen: &mut BTreeSet<(usize, bool)>,
    ) -> bool {
        match &typed.kind {
            TypedKind::Input(source, first) => within && (*source, *first) == input,
            TypedKind::Binding(number) => {
                let binding = &self.bindings[*number];
                let within = within || binding.rest;
                seen.insert((*number, within)) && self.rest_reads(&binding.value, input, within, seen)
            }
            _ => typed.parts().into_iter().any(|part| self.rest_reads(part, input, within, seen)),
        }
    }
}

pub(super) fn constant(value: f64, span: &Span) -> Typed {
    Typed { kind: TypedKind::Constant(value), shape: Shape::Scalar, span: span.clone() }
}
