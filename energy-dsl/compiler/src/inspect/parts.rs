//! The subexpressions of a formula, as text and as numbers.

use std::collections::BTreeMap;

use crate::check::{Program, Source, Typed, TypedKind};
use crate::diagnostic::{Diagnostics, Span};
use crate::graph::{Interpreter, NodeId};
use crate::lower::{LoweredPart, lower_parts};
use crate::syntax::{Body, ExpressionKind, Item, parse};
use energy_runtime::{Inputs, Number};

/// A subexpression of a formula.
#[derive(Clone, Debug)]
pub struct Part {
    /// Text of the expression, with the names of `let`s in place of their values.
    pub text: String,
    /// Name of the function or operator; empty for arrays and `if`.
    pub function: &'static str,
    /// Subexpressions that it is computed from, by index.
    pub operands: Vec<usize>,
}

/// The subexpressions of a formula in its textbook form, operands before their uses. The last one is the result.
#[derive(Clone, Debug)]
pub struct Parts {
    list: Vec<Part>,
    sizes: Vec<usize>,
    interpreter: Interpreter,
}

impl Parts {
    /// Takes a program apart; `None` if it contains derivatives or is too large.
    pub(super) fn of(program: &Program) -> Option<Self> {
        let (graph, lowered) = program.budget.within(|| lower_parts(program)).ok()??;
        let names = names(program);
        let writer = Writer { program, names: &names };
        let part = |part: &LoweredPart<'_>| Part {
            text: match part.binding.and_then(|number| names.get(&number)) {
                Some(name) => format!("{name} = {}", writer.text(part.expression, 0)),
                None => writer.text(part.expression, 0),
            },
            function: if let TypedKind::Call(function, _) = &part.expression.kind { function.name } else { "" },
            operands: part.operands.clone(),
        };
        let list = lowered.iter().map(part).collect();
        let outputs: Vec<NodeId> = lowered.iter().flat_map(|part| part.outputs.iter().copied()).collect();
        let sizes = lowered.iter().map(|part| part.outputs.len()).collect();
        Some(Self { list, sizes, interpreter: Interpreter::new(&graph, &outputs) })
    }

    /// Returns the subexpressions.
    #[must_use]
    pub fn list(&self) -> &[Part] {
        &self.list
    }

    /// Evaluates all subexpressions. Returns the numbers of each.
    ///
    /// # Panics
    /// When an input slice is shorter than declared.
    pub fn evaluate<T: Number>(&self, inputs: &Inputs<'_, T>) -> Vec<Vec<T>> {
        let mut numbers = self.interpreter.evaluate(inputs, &[]).into_iter();
        self.sizes.iter().map(|&size| numbers.by_ref().take(size).collect()).collect()
    }
}

/// A place in a text, which identifies an expression: line and column of the token, and the offset within a string.
type Place = (usize, usize, Option<usize>);

fn place(span: &Span) -> Place {
    let start = span.token.start();
    (start.line, start.column, span.excerpt.as_ref().map(|excerpt| excerpt.start))
}

/// Returns the names of bindings. Programs do not keep them, so the text is parsed again.
fn names(program: &Program) -> BTreeMap<usize, String> {
    let mut diagnostics = Diagnostics::default();
    let Ok(stream) = program.source.parse() else { return BTreeMap::new() };
    let items = parse(stream, &mut diagnostics);
    let mut places = BTreeMap::new();
    for item in &items {
        if let Item::Declaration(declaration) = item {
            declaration.body.iter().for_each(|body| collect(body, &mut places));
        }
    }
    let named = |(number, binding): (usize, &crate::check::Binding)| {
        places.get(&place(&binding.value.span)).map(|name: &String| (number, name.clone()))
    };
    program.bindings.iter().enumerate().filter_map(named).collect()
}

fn collect(body: &Body, places: &mut BTreeMap<Place, String>) {
    for definition in &body.lets {
        let span = match &definition.value.kind {
            ExpressionKind::Call(name, _) => &name.span,
            _ => &definition.value.span,
        };
        places.insert(place(span), definition.name.text.clone());
    }
    if let ExpressionKind::Body(inner) = &body.result.kind {
        collect(inner, places);
    }
}

/// Longer texts are cut.
const LONGEST: usize = 100;

struct Writer<'a> {
    program: &'a Program,
    names: &'a BTreeMap<usize, String>,
}

impl Writer<'_> {
    /// Writes an expression, in parentheses if it binds less than `least`. Precedence: sums 1, products 2, signs 3,
    /// powers 4, all else 5.
    fn text(&self, of: &Typed, least: u8) -> String {
        let (text, strength) = self.parts(of);
        let text = if text.chars().count() > LONGEST {
            format!("{}…", text.chars().take(LONGEST).collect::<String>())
        } else {
            text
        };
        if strength < least { format!("({text})") } else { text }
    }

    fn parts(&self, of: &Typed) -> (String, u8) {
        let list = |parts: &[Typed]| parts.iter().map(|part| self.text(part, 0)).collect::<Vec<_>>().join(", ");
        match &of.kind {
            TypedKind::Constant(value) => (value.to_string(), 5),
            TypedKind::Pi => ("π".into(), 5),
            TypedKind::Input(source, first) => (self.input(*source, *first), 5),
            TypedKind::Binding(number) => match self.names.get(number) {
                Some(name) => (name.clone(), 5),
                None => self.parts(&self.program.bindings[*number].value),
            },
            TypedKind::Call(function, arguments) => match (function.name, arguments.as_slice()) {
                ("neg", [a]) => (format!("-{}", self.text(a, 3)), 3),
                ("[]", [a, at]) => (format!("{}[{}]", self.text(a, 5), self.text(at, 0)), 5),
                (sign @ ("+" | "-"), [a, b]) => (format!("{} {sign} {}", self.text(a, 1), self.text(b, 2)), 1),
                (sign @ ("*" | "/"), [a, b]) => (format!("{} {sign} {}", self.text(a, 2), self.text(b, 3)), 2),
                ("^", [a, b]) => (format!("{}^{}", self.text(a, 5), self.text(b, 5)), 4),
                (name, _) if name.starts_with(char::is_alphabetic) => (format!("{name}({})", list(arguments)), 5),
                (name, [a, b]) => (format!("{} {name} {}", self.text(a, 1), self.text(b, 1)), 0),
                (name, _) => (format!("{name}({})", list(arguments)), 5),
            },
            TypedKind::Select(condition, yes, no) => {
                let [condition, yes, no] = [condition, yes, no].map(|part| self.text(part, 0));
                (format!("if {condition} {{ {yes} }} else {{ {no} }}"), 0)
            }
            TypedKind::Array(entries) => (format!("[{}]", list(entries)), 5),
            TypedKind::Gradient(of, ..) => (format!("gradient({}, …)", self.text(of, 0)), 5),
        }
    }

    fn input(&self, source: Source, first: usize) -> String {
        let Program { moving, rest, parameters, .. } = self.program;
        let section = match source {
            Source::Position | Source::Velocity => moving,
            Source::Rest => rest,
            Source::Parameter => parameters,
        };
        let found = section.iter().find(|input| (input.first..input.first + input.input_type.size()).contains(&first));
        let name = found.map_or("…", |input| input.name.as_str());
        if source == Source::Velocity { format!("velocity of {name}") } else { name.to_owned() }
    }
}

#[cfg(test)]
mod tests {
    use crate::Textbook;
    use energy_runtime::Inputs;

    #[test]
    fn subexpressions_have_their_text_and_their_numbers() {
        let source = "energy Pull(p, q: Point; k, L: Scalar) { let r = norm(p - q); k / 2 * (r - L)^2 }";
        let parts = Textbook::from_source(source).unwrap().parts().unwrap();
        let texts: Vec<&str> = parts.list().iter().map(|part| part.text.as_str()).collect();
        assert_eq!(texts, ["k / 2", "p - q", "r = norm(p - q)", "r - L", "(r - L)^2", "k / 2 * (r - L)^2"]);
        assert_eq!(parts.list()[3].operands, [2]);
        let x = [0.0, 0.0, 0.0, 3.0, 0.0, 4.0];
        let inputs = Inputs { parameters: &[8.0, 1.0], rest: &[], positions: &x, velocities: &[] };
        let numbers = parts.evaluate(&inputs);
        assert_eq!((numbers[1].as_slice(), numbers[3].as_slice()), ([-3.0, 0.0, -4.0].as_slice(), [4.0].as_slice()));
    }

    #[test]
    fn formulas_with_derivatives_are_not_taken_apart() {
        let source = "force Pull(p: Point; k: Scalar) { [-gradient(k * norm_squared(p), p)] }";
        assert!(Textbook::from_source(source).unwrap().parts().is_none());
    }
}
