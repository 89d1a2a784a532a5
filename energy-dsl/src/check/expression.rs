use std::collections::{BTreeMap, BTreeSet};

use super::signature::Signature;
use super::typed::{Binding, Source, Typed, TypedKind};
use crate::diagnostic::{Diagnostic, Diagnostics, Span, nearest};
use crate::functions::{self, Shape};
use crate::syntax::{Body, Expression, ExpressionKind, Name, UserFunction, canonical};

/// What a name stands for.
#[derive(Clone, Copy)]
enum Meaning {
    Input(Source, usize, Shape),
    Binding(usize, Shape),
}

/// Checks the expressions of one declaration. An erroneous expression is reported once and yields `None`; its neighbours are
/// still checked.
pub(super) struct Checker<'a> {
    signature: &'a Signature,
    functions: Vec<&'a UserFunction>,
    diagnostics: &'a mut Diagnostics,
    scopes: Vec<BTreeMap<String, Option<Meaning>>>,
    calls: Vec<String>,
    used: BTreeSet<String>,
    in_rest: bool,
    pub(super) bindings: Vec<Binding>,
    pub(super) reads_velocities: bool,
}

impl<'a> Checker<'a> {
    pub(super) fn new(
        signature: &'a Signature,
        functions: &[&'a UserFunction],
        diagnostics: &'a mut Diagnostics,
    ) -> Self {
        let inputs = signature
            .names
            .iter()
            .map(|n| (n.name.canonical(), Some(Meaning::Input(n.source, n.first, n.shape))))
            .collect();
        Self {
            signature,
            functions: functions.to_vec(),
            diagnostics,
            scopes: vec![inputs],
            calls: Vec::new(),
            used: BTreeSet::new(),
            in_rest: false,
            bindings: Vec::new(),
            reads_velocities: false,
        }
    }

    fn error(&mut self, span: &Span, message: impl Into<String>) -> Option<Typed> {
        self.diagnostics.push(Diagnostic::new(span, message));
        None
    }

    /// Reports inputs that the formula never reads.
    pub(super) fn report_unused(&mut self, declaration: &Name) {
        for input in &self.signature.names {
            let name = &input.name;
            if !self.used.contains(&name.canonical()) && !name.text.starts_with('_') {
                let message = format!("the input `{}` of {} is never used", name.text, declaration.text);
                self.diagnostics.push(Diagnostic::new(&name.span, message).help("use it in the formula, or remove it"));
            }
        }
    }

    pub(super) fn body(&mut self, body: &'a Body, outermost: bool) -> Option<Typed> {
        let outer_functions = self.functions.len();
        self.functions.extend(&body.functions);
        self.scopes.push(BTreeMap::new());
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
        self.scopes.pop();
        self.functions.truncate(outer_functions);
        result
    }

    fn define(&mut self, name: &Name, value: Option<Typed>, rest: bool) {
        let meaning = value.map(|value| {
            let shape = value.shape;
            self.bindings.push(Binding { value, rest });
            Meaning::Binding(self.bindings.len() - 1, shape)
        });
        self.scopes.last_mut().expect("compiler bug: no scope").insert(name.canonical(), meaning);
    }

    fn find(&self, name: &str) -> Option<Option<Meaning>> {
        let canonical = canonical(name);
        self.scopes.iter().rev().find_map(|scope| scope.get(&canonical).copied())
    }

    fn expression(&mut self, expression: &'a Expression) -> Option<Typed> {
        let span = &expression.span;
        match &expression.kind {
            ExpressionKind::Number(value) => Some(constant(*value)),
            ExpressionKind::Name(name) => self.name(name),
            ExpressionKind::Call(name, arguments) => self.call(name, arguments),
            ExpressionKind::Body(body) => self.body(body, self.scopes.len() == 2),
            ExpressionKind::If(condition, yes, no) => {
                let checked = self.expression(condition);
                let (yes, no) = (self.body(yes, false), self.body(no, false));
                let (condition_shape, yes, no) = (checked?, yes?, no?);
                if condition_shape.shape != Shape::Truth {
                    return self.error(
                        &condition.span,
                        format!("expected a comparison after `if`, found {}", condition_shape.shape),
                    );
                }
                if yes.shape != no.shape {
                    return self.error(
                        span,
                        format!("both branches must have the same shape, but they are {} and {}", yes.shape, no.shape),
                    );
                }
                let shape = yes.shape;
                Some(Typed { kind: TypedKind::Select(Box::new(condition_shape), Box::new(yes), Box::new(no)), shape })
            }
            ExpressionKind::List(items) => {
                let checked: Vec<_> = items.iter().map(|item| self.expression(item)).collect();
                let checked: Vec<_> = checked.into_iter().collect::<Option<_>>()?;
                if let Some((item, _)) = items.iter().zip(&checked).find(|(_, c)| c.shape != Shape::Vector(3)) {
                    return self.error(&item.span, "each force in the list must be a 3-vector");
                }
                let shape = Shape::Forces(u8::try_from(checked.len()).unwrap_or(u8::MAX));
                Some(Typed { kind: TypedKind::Forces(checked), shape })
            }
        }
    }

    fn name(&mut self, name: &Name) -> Option<Typed> {
        if let Some(found) = self.find(&name.text) {
            self.used.insert(name.canonical());
            return match found? {
                Meaning::Binding(number, shape) => Some(Typed { kind: TypedKind::Binding(number), shape }),
                Meaning::Input(source, first, shape) => self.input(name, source, first, shape),
            };
        }
        if matches!(name.text.as_str(), "π" | "pi" | "PI") {
            return Some(Typed { kind: TypedKind::Pi, shape: Shape::Scalar });
        }
        // â is the unit vector of a, also among Rust tokens, where it is one identifier.
        if let Some(plain) = without_hat(&name.text).filter(|plain| self.find(plain).is_some()) {
            let vector = self.name(&Name { text: plain, span: name.span.clone() })?;
            return self.apply("unit", &name.span, vec![vector]);
        }
        let known: Vec<String> = self.scopes.iter().flat_map(|s| s.keys().cloned()).collect();
        let mut diagnostic = Diagnostic::new(&name.span, format!("unknown name `{}`", name.text));
        let canonical = name.canonical();
        diagnostic = if functions::find(&name.text).is_some() {
            diagnostic.help(format!("`{}` is a function: call it with its arguments in parentheses", name.text))
        } else if let Some(near) = nearest(&canonical, known.iter().map(String::as_str)) {
            diagnostic.help(format!("did you mean `{}`?", self.as_declared(near)))
        } else {
            diagnostic.help("declare it as an input, or define it with `let`")
        };
        self.diagnostics.push(diagnostic);
        None
    }

    fn as_declared(&self, canonical: &str) -> String {
        let declared = self.signature.names.iter().find(|n| n.name.canonical() == canonical);
        declared.map_or_else(|| canonical.to_owned(), |n| n.name.text.clone())
    }

    fn input(&mut self, name: &Name, source: Source, first: usize, shape: Shape) -> Option<Typed> {
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
                    Diagnostic::new(&name.span, message).help("compute what you need of it: rest { let … = …; }"),
                );
                return None;
            }
            _ => {}
        }
        self.reads_velocities |= source == Source::Velocity;
        Some(Typed { kind: TypedKind::Input(source, first), shape })
    }

    fn call(&mut self, name: &Name, arguments: &'a [Expression]) -> Option<Typed> {
        match name.text.as_str() {
            "gradient" => return self.gradient(name, arguments),
            "identity" => return self.identity(name, arguments),
            _ => {}
        }
        let user = self.functions.iter().rev().find(|f| f.name.text == name.text).copied();
        let checked: Vec<_> = arguments.iter().map(|a| self.expression(a)).collect();
        let checked: Vec<_> = checked.into_iter().collect::<Option<_>>()?;
        if let Some(function) = user {
            return self.inline(name, function, checked);
        }
        // M⁻¹, as printed.
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

    fn apply(&mut self, name: &str, span: &Span, arguments: Vec<Typed>) -> Option<Typed> {
        let Some(function) = functions::find(name) else {
            let mut diagnostic = Diagnostic::new(span, format!("unknown function `{name}`"));
            diagnostic = if self.find(name).is_some() {
                diagnostic.help(format!("`{name}` is a value; for a product write `{name} * (…)`"))
            } else {
                let names = functions::all().map(|f| f.name).chain(self.functions.iter().map(|f| f.name.text.as_str()));
                match nearest(name, names) {
                    Some(near) => diagnostic.help(format!("did you mean `{near}`?")),
                    None => diagnostic.help(format!("define it: fn {name}(…) {{ … }}")),
                }
            };
            self.diagnostics.push(diagnostic);
            return None;
        };
        let shapes: Vec<Shape> = arguments.iter().map(|a| a.shape).collect();
        match (function.shape)(&shapes) {
            Ok(shape) => Some(Typed { kind: TypedKind::Call(function, arguments), shape }),
            Err(message) => {
                let name = if name == "neg" { "-" } else { name };
                self.diagnostics.push(
                    Diagnostic::new(span, format!("`{name}`: {message}")).help(format!("usage: {}", function.usage)),
                );
                None
            }
        }
    }

    /// A user's function is its body with the arguments bound.
    fn inline(&mut self, name: &Name, function: &'a UserFunction, arguments: Vec<Typed>) -> Option<Typed> {
        if function.parameters.len() != arguments.len() {
            let message =
                format!("`{}` takes {} arguments, found {}", name.text, function.parameters.len(), arguments.len());
            return self.error(&name.span, message);
        }
        if self.calls.contains(&function.name.text) {
            return self.error(&name.span, format!("`{}` calls itself: a formula cannot be recursive", name.text));
        }
        self.calls.push(function.name.text.clone());
        let outer = std::mem::replace(&mut self.scopes, vec![BTreeMap::new()]);
        for (parameter, argument) in function.parameters.iter().zip(arguments) {
            self.define(parameter, Some(argument), false);
        }
        let result = self.body(&function.body, false);
        self.scopes = outer;
        self.calls.pop();
        result
    }

    fn identity(&mut self, name: &Name, arguments: &[Expression]) -> Option<Typed> {
        match arguments {
            [Expression { kind: ExpressionKind::Number(n), .. }] if *n == 2.0 || *n == 3.0 => {
                self.apply("identity", &name.span, vec![constant(0.0); *n as usize])
            }
            _ => self.error(&name.span, "`identity` takes the number 2 or 3, as in identity(3)"),
        }
    }

    /// `gradient(U, p)`, the derivative of a scalar by a point.
    fn gradient(&mut self, name: &Name, arguments: &'a [Expression]) -> Option<Typed> {
        let [of, by] = arguments else {
            return self.error(&name.span, "`gradient` takes a scalar and a point, as in gradient(θ, x1)");
        };
        let (of_typed, by_typed) = (self.expression(of), self.expression(by));
        let (of_typed, by_typed) = (of_typed?, by_typed?);
        if of_typed.shape != Shape::Scalar {
            return self.error(&of.span, format!("`gradient` is of a scalar, but this is {}", of_typed.shape));
        }
        match by_typed.kind {
            TypedKind::Input(Source::Position, first) => {
                Some(Typed { kind: TypedKind::Gradient(Box::new(of_typed), first / 3), shape: Shape::Vector(3) })
            }
            _ => self.error(&by.span, "`gradient` is by a declared point"),
        }
    }
}

fn constant(value: f64) -> Typed {
    Typed { kind: TypedKind::Constant(value), shape: Shape::Scalar }
}

fn without_hat(name: &str) -> Option<String> {
    let mut plain = String::new();
    let mut hat = false;
    for c in name.chars() {
        match crate::syntax::unhatted(c) {
            _ if c == '\u{302}' => hat = true,
            Some(letter) => {
                hat = true;
                plain.push(letter);
            }
            None => plain.push(c),
        }
    }
    hat.then_some(plain)
}
