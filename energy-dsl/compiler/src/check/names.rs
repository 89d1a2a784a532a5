//! Names: each has one meaning where it is visible, and every `let` and `fn` is used.

use std::collections::BTreeSet;

use crate::diagnostic::{Diagnostic, Diagnostics};
use crate::functions;
use crate::syntax::{Assignment, Body, Declaration, Expression, ExpressionKind, Item, Name, UserFunction, without_hat};

/// Functions of the language that a text may define otherwise.
pub(super) const CONTEXTUAL: [&str; 1] = ["interpolate"];
/// Names that the language treats as functions although they are not in its table.
const FORMS: [&str; 3] = ["gradient", "identity", "sum"];
/// Names of numbers, with their numbers.
const NUMBERS: [(&str, &str); 4] =
    [("π", "the number π"), ("pi", "the number π"), ("PI", "the number π"), ("infinity", "an infinite value")];

/// Reports names that are declared twice, and definitions that hide another name. Returns the definitions that nothing
/// uses: they are errors only if there is no other error, which may be the reason.
pub(super) fn check_names(items: &[Item], diagnostics: &mut Diagnostics) -> Vec<Diagnostic> {
    let mut names = Names::new(diagnostics);
    let mut declarations: Vec<&Name> = Vec::new();
    // All of them are visible in the whole text.
    for item in items {
        match item {
            Item::Function(function) => names.define(&function.name, Role::Function),
            Item::Constant(constant) => names.define(&constant.name, Role::Constant),
            Item::Declaration(Declaration { name, .. }) => {
                if let Some(first) = declarations.iter().find(|first| first.text == name.text) {
                    names.report_twice(name, first);
                }
                declarations.push(name);
            }
            Item::Specialisation(_) => {}
        }
    }
    for item in items {
        match item {
            Item::Function(function) => names.function(function),
            Item::Constant(constant) => names.expression(&constant.value),
            Item::Declaration(declaration) => names.declaration(declaration),
            Item::Specialisation(_) => {}
        }
    }
    names.close();
    names.report_calls();
    names.unused
}

/// The meaning of a name.
#[derive(Clone, Copy, PartialEq)]
enum Role {
    Constant,
    Function,
    Input,
    /// A parameter of a function, or the index of a sum.
    Variable,
    Value,
}

impl Role {
    fn described(self) -> &'static str {
        match self {
            Self::Constant => "a constant",
            Self::Function => "a function",
            Self::Input => "an input",
            Self::Variable => "a parameter or an index",
            Self::Value => "a value",
        }
    }
}

struct Entry<'a> {
    name: &'a Name,
    canonical: String,
    role: Role,
    used: bool,
}

impl<'a> Entry<'a> {
    fn new(name: &'a Name, role: Role, used: bool) -> Self {
        Self { name, canonical: name.canonical(), role, used }
    }
}

struct Names<'a, 'd> {
    /// Visible names, outermost first.
    scopes: Vec<Vec<Entry<'a>>>,
    diagnostics: &'d mut Diagnostics,
    unused: Vec<Diagnostic>,
    /// Functions that the text calls.
    called: BTreeSet<&'a str>,
    /// Values that are named like functions of the language.
    like_functions: Vec<&'a Name>,
}

impl<'a, 'd> Names<'a, 'd> {
    fn new(diagnostics: &'d mut Diagnostics) -> Self {
        let (unused, called, like_functions) = (Vec::new(), BTreeSet::new(), Vec::new());
        Self { scopes: vec![Vec::new()], diagnostics, unused, called, like_functions }
    }

    /// Reports values that are named like a function of the language which the text also calls.
    fn report_calls(&mut self) {
        for name in self.like_functions.iter().filter(|name| self.called.contains(name.text.as_str())) {
            let message = format!("`{}` is a function of the language, which this text also calls", name.text);
            self.diagnostics.push(Diagnostic::new(&name.span, message).help("choose another name"));
        }
    }

    fn declaration(&mut self, declaration: &'a Declaration) {
        let inputs = declaration.inputs.iter().flat_map(|group| &group.names);
        // The signature reports inputs that are declared twice.
        self.scopes.push(inputs.map(|name| Entry::new(name, Role::Input, true)).collect());
        if let Some(body) = &declaration.body {
            let initial = declaration.inputs.iter().filter_map(|group| group.initial.as_ref());
            self.body_with(body, initial);
        }
        declaration.inputs.iter().filter_map(|group| group.length.as_ref()).for_each(|length| self.expression(length));
        self.close();
    }

    fn body(&mut self, body: &'a Body) {
        self.body_with(body, std::iter::empty());
    }

    /// Walks a body, and expressions that see its values.
    fn body_with(&mut self, body: &'a Body, more: impl Iterator<Item = &'a Expression>) {
        self.scopes.push(Vec::new());
        body.functions.iter().for_each(|function| self.define(&function.name, Role::Function));
        for constant in &body.constants {
            self.expression(&constant.value);
            self.define(&constant.name, Role::Constant);
        }
        body.functions.iter().for_each(|function| self.function(function));
        for statement in &body.lets {
            self.expression(&statement.value);
            self.define(&statement.name, Role::Value);
        }
        self.expression(&body.result);
        more.for_each(|expression| self.expression(expression));
        if let Some(next) = &body.next {
            for statement in &next.lets {
                self.expression(&statement.value);
                self.define(&statement.name, Role::Value);
            }
            next.assignments.iter().for_each(|assignment| self.assignment(assignment));
        }
        self.close();
    }

    fn assignment(&mut self, assignment: &'a Assignment) {
        self.scopes.push(Vec::new());
        if let Some((index, first, end)) = &assignment.range {
            self.expression(first);
            self.expression(end);
            self.define(index, Role::Variable);
        }
        assignment.entry.iter().chain([&assignment.value]).for_each(|part| self.expression(part));
        self.close();
    }

    /// A function sees constants and functions, but no values of the body that it is in.
    fn function(&mut self, function: &'a UserFunction) {
        let values = |entry: &Entry<'_>| matches!(entry.role, Role::Input | Role::Variable | Role::Value);
        let hidden: Vec<Vec<Entry<'a>>> =
            self.scopes.iter_mut().map(|scope| scope.extract_if(.., |entry| values(entry)).collect()).collect();
        self.scopes.push(Vec::new());
        function.parameters.iter().for_each(|parameter| self.define(parameter, Role::Variable));
        self.body(&function.body);
        self.close();
        self.scopes.iter_mut().zip(hidden).for_each(|(scope, hidden)| scope.extend(hidden));
    }

    fn expression(&mut self, expression: &'a Expression) {
        match &expression.kind {
            ExpressionKind::Number(_) => {}
            ExpressionKind::Name(name) => self.read(name),
            ExpressionKind::Call(name, arguments) => {
                self.call(name);
                arguments.iter().for_each(|argument| self.expression(argument));
            }
            ExpressionKind::If(condition, yes, no) => {
                self.expression(condition);
                self.body(yes);
                self.body(no);
            }
            ExpressionKind::List(items) => items.iter().for_each(|item| self.expression(item)),
            ExpressionKind::Index(of, index) => {
                self.expression(of);
                self.expression(index);
            }
            ExpressionKind::Component(of, _) => self.expression(of),
            ExpressionKind::Sum(sum) | ExpressionKind::Each(sum) => {
                self.called.extend(matches!(expression.kind, ExpressionKind::Sum(_)).then_some("sum"));
                self.expression(&sum.first);
                self.expression(&sum.end);
                self.scopes.push(Vec::new());
                self.define(&sum.index, Role::Variable);
                self.expression(&sum.term);
                self.close();
            }
            ExpressionKind::Body(body) => self.body(body),
        }
    }

    fn find(&mut self, matches: impl Fn(&Entry<'_>) -> bool) -> Option<&mut Entry<'a>> {
        self.scopes.iter_mut().rev().find_map(|scope| scope.iter_mut().rev().find(|entry| matches(entry)))
    }

    fn read(&mut self, name: &Name) {
        let mut canonical = name.canonical();
        if self.find(|entry| entry.canonical == canonical).is_none()
            && let Some(plain) = without_hat(&name.text)
        {
            canonical = Name { text: plain, span: name.span.clone() }.canonical();
        }
        if let Some(entry) = self.find(|e| e.role != Role::Function && e.canonical == canonical) {
            entry.used = true;
        }
    }

    fn call(&mut self, name: &'a Name) {
        self.called.insert(&name.text);
        if let Some(entry) = self.find(|entry| entry.role == Role::Function && entry.name.text == name.text) {
            entry.used = true;
        }
    }

    fn define(&mut self, name: &'a Name, role: Role) {
        self.report_hidden(name, role);
        self.scopes.last_mut().expect("compiler bug: no scope").push(Entry::new(name, role, false));
    }

    /// Reports a definition that hides another name. Only a value may replace an earlier value.
    fn report_hidden(&mut self, name: &'a Name, role: Role) {
        let text = &name.text;
        let function = functions::find(text).is_some() || FORMS.contains(&text.as_str());
        let function = function && !CONTEXTUAL.contains(&text.as_str());
        let number = NUMBERS.iter().find(|(number, _)| number == text).map(|(_, meaning)| *meaning);
        let built_in = if function { Some("a function of the language") } else { number };
        if function && matches!(role, Role::Value | Role::Constant) {
            self.like_functions.push(name);
        } else if let Some(built_in) = built_in.filter(|_| role != Role::Variable) {
            let message = format!("`{text}` is {built_in} and cannot be defined again");
            self.diagnostics.push(Diagnostic::new(&name.span, message).help("choose another name"));
            return;
        }
        let canonical = name.canonical();
        let same = self.scopes.last().and_then(|own| own.iter().find(|e| e.role == role && e.canonical == canonical));
        if let Some(first) = same.map(|entry| entry.name)
            && role != Role::Value
        {
            return self.report_twice(name, first);
        }
        let Some(hidden) = self.find(|entry| entry.canonical == canonical) else { return };
        if (role, hidden.role) == (Role::Value, Role::Value) || (role, hidden.role) == (Role::Variable, Role::Value) {
            return;
        }
        let message = format!("`{text}` is already the name of {}", hidden.role.described());
        let first = (format!("`{}` is first declared", hidden.name.text), hidden.name.span.clone());
        self.diagnostics.push(Diagnostic::new(&name.span, message).see(first).help("choose another name"));
    }

    fn report_twice(&mut self, name: &Name, first: &Name) {
        let message = format!("the name `{}` is declared twice", name.text);
        let first = (format!("`{}` is first declared", first.text), first.span.clone());
        self.diagnostics.push(Diagnostic::new(&name.span, message).see(first).help("rename one of them"));
    }

    /// Leaves a scope, and notes what nothing has used there.
    fn close(&mut self) {
        for Entry { name, role, used, .. } in self.scopes.pop().unwrap_or_default() {
            if used || !matches!(role, Role::Function | Role::Value) || name.text.starts_with('_') {
                continue;
            }
            let what = if role == Role::Function { "the function" } else { "the value" };
            let message = format!("{what} `{}` is never used", name.text);
            let help = "use it, remove it, or let its name begin with `_`";
            self.unused.push(Diagnostic::new(&name.span, message).help(help));
        }
    }
}

/// Returns the canonical names of values, and the names of functions, that a declaration or function mentions.
pub(super) fn mentioned(item: &Item) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    match item {
        Item::Function(function) => mentioned_in_body(&function.body, &mut found),
        Item::Constant(constant) => mentioned_in(&constant.value, &mut found),
        Item::Declaration(declaration) => {
            declaration.body.iter().for_each(|body| mentioned_in_body(body, &mut found));
            let lengths = declaration.inputs.iter().flat_map(|group| group.length.iter().chain(&group.initial));
            lengths.for_each(|length| mentioned_in(length, &mut found));
        }
        Item::Specialisation(_) => {}
    }
    found
}

fn mentioned_in_body(body: &Body, found: &mut BTreeSet<String>) {
    body.constants.iter().for_each(|constant| mentioned_in(&constant.value, found));
    body.functions.iter().for_each(|function| mentioned_in_body(&function.body, found));
    let of_next = body.next.iter().flat_map(|next| &next.lets);
    body.lets.iter().chain(of_next).for_each(|statement| mentioned_in(&statement.value, found));
    for assignment in body.next.iter().flat_map(|next| &next.assignments) {
        let range = assignment.range.iter().flat_map(|(_, first, end)| [first, end]);
        range.chain(&assignment.entry).chain([&assignment.value]).for_each(|part| mentioned_in(part, found));
    }
    mentioned_in(&body.result, found);
}

fn mentioned_in(expression: &Expression, found: &mut BTreeSet<String>) {
    match &expression.kind {
        ExpressionKind::Number(_) => {}
        ExpressionKind::Name(name) => {
            found.insert(name.canonical());
            found.extend(without_hat(&name.text).map(|plain| crate::syntax::canonical(&plain)));
        }
        ExpressionKind::Call(name, arguments) => {
            found.insert(name.text.clone());
            arguments.iter().for_each(|argument| mentioned_in(argument, found));
        }
        ExpressionKind::If(condition, yes, no) => {
            mentioned_in(condition, found);
            mentioned_in_body(yes, found);
            mentioned_in_body(no, found);
        }
        ExpressionKind::List(items) => items.iter().for_each(|item| mentioned_in(item, found)),
        ExpressionKind::Index(of, index) => [of, index].into_iter().for_each(|part| mentioned_in(part, found)),
        ExpressionKind::Component(of, _) => mentioned_in(of, found),
        ExpressionKind::Sum(sum) | ExpressionKind::Each(sum) => {
            [&sum.first, &sum.end, &sum.term].into_iter().for_each(|part| mentioned_in(part, found));
        }
        ExpressionKind::Body(body) => mentioned_in_body(body, found),
    }
}
