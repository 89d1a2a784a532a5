//! The body of a declaration as MathML, for reports.

use std::fmt::Write as _;

use crate::diagnostic::Diagnostics;
use crate::syntax::{Body, Expression, ExpressionKind, Item, Sum, parse};

/// Returns the body of the last declaration of a text as presentation MathML, one row per `let` and one for the result;
/// `None` if the text does not parse.
///
/// ```
/// let spring = "energy Spring(p, q: Point; k, L: Scalar) = \"k/2 (‖p − q‖ − L)²\";";
/// let formula = energy_compiler::mathml(spring).unwrap();
/// assert!(formula.starts_with("<math") && formula.contains("<mfrac><mi>k</mi><mn>2</mn></mfrac>"));
/// ```
#[must_use]
pub fn mathml(source: &str) -> Option<String> {
    let mut diagnostics = Diagnostics::default();
    let items = parse(source.parse().ok()?, &mut diagnostics);
    let body = items.iter().rev().find_map(|item| match item {
        Item::Declaration(declaration) => declaration.body.as_ref(),
        _ => None,
    })?;
    if !diagnostics.0.is_empty() {
        return None;
    }
    let mut rows = String::new();
    lines(body, &mut rows);
    Some(format!("<math display=\"block\"><mtable columnalign=\"left\">{rows}</mtable></math>"))
}

/// Writes the definitions and the result of a body, one row each.
fn lines(body: &Body, rows: &mut String) {
    for definition in &body.lets {
        let (name, value) = (identifier(&definition.name.text), expression(&definition.value, 0));
        row(rows, &format!("{name}<mo>=</mo>{value}"));
    }
    match &body.result.kind {
        ExpressionKind::Body(inner) => lines(inner, rows),
        _ => row(rows, &expression(&body.result, 0)),
    }
}

fn row(rows: &mut String, content: &str) {
    let _ = write!(rows, "<mtr><mtd><mrow>{content}</mrow></mtd></mtr>");
}

/// Writes an expression, in parentheses if it binds less than `least`. Precedence: sums 1, products 2, signs 3, powers
/// 4, all else 5.
fn expression(of: &Expression, least: u8) -> String {
    let (text, strength) = parts(of);
    if strength < least { format!("<mrow><mo>(</mo>{text}<mo>)</mo></mrow>") } else { text }
}

fn parts(of: &Expression) -> (String, u8) {
    match &of.kind {
        ExpressionKind::Number(value) => (format!("<mn>{value}</mn>"), 5),
        ExpressionKind::Name(name) if name.text == "infinity" => ("<mn>∞</mn>".into(), 5),
        ExpressionKind::Name(name) => (identifier(&name.text), 5),
        ExpressionKind::Call(name, arguments) => call(&name.text, arguments),
        ExpressionKind::If(condition, yes, no) => {
            let case = |body: &Body, when: &str| {
                format!("<mtr><mtd>{}</mtd><mtd>{when}</mtd></mtr>", expression(&body.result, 0))
            };
            let when = format!("<mtext>if </mtext>{}", expression(condition, 0));
            let cases = format!("{}{}", case(yes, &when), case(no, "<mtext>otherwise</mtext>"));
            (format!("<mrow><mo>{{</mo><mtable columnalign=\"left\">{cases}</mtable></mrow>"), 5)
        }
        ExpressionKind::List(entries) => (bracketed("[", entries, "]"), 5),
        ExpressionKind::Index(of, at) => (format!("<msub>{}{}</msub>", expression(of, 5), expression(at, 0)), 5),
        ExpressionKind::Component(of, name) => {
            (format!("<msub>{}{}</msub>", expression(of, 5), identifier(&name.text)), 5)
        }
        ExpressionKind::Each(each) => {
            (format!("<mo>[</mo>{}<mo>]</mo><msub><mrow/>{}</msub>", expression(&each.term, 0), range(each)), 5)
        }
        ExpressionKind::Sum(sum) => {
            (format!("<munder><mo>∑</mo>{}</munder>{}", range(sum), expression(&sum.term, 2)), 2)
        }
        ExpressionKind::Body(body) => parts(&body.result),
    }
}

/// Returns `first ≤ j < end`.
fn range(sum: &Sum) -> String {
    let (first, end) = (expression(&sum.first, 0), expression(&sum.end, 0));
    format!("<mrow>{first}<mo>≤</mo>{}<mo>&lt;</mo>{end}</mrow>", identifier(&sum.index.text))
}

fn call(name: &str, arguments: &[Expression]) -> (String, u8) {
    let at = |number: usize, least: u8| expression(&arguments[number], least);
    let infix = |sign: &str, own: u8| (format!("{}<mo>{sign}</mo>{}", at(0, own), at(1, own + 1)), own);
    match (name, arguments.len()) {
        ("+", 2) => infix("+", 1),
        ("-", 2) => infix("−", 1),
        ("*", 2) => infix("&#x2062;", 2),
        ("dot" | "·", 2) => infix("·", 2),
        ("cross" | "×", 2) => infix("×", 2),
        ("outer" | "⊗", 2) => infix("⊗", 2),
        ("/", 2) => (format!("<mfrac>{}{}</mfrac>", at(0, 0), at(1, 0)), 5),
        ("^", 2) => (format!("<msup>{}{}</msup>", at(0, 5), at(1, 0)), 4),
        ("neg", 1) => (format!("<mo>−</mo>{}", at(0, 2)), 1),
        ("<" | ">", 2) => infix(if name == "<" { "&lt;" } else { "&gt;" }, 0),
        ("<=" | ">=" | "==" | "!=", 2) => infix(
            match name {
                "<=" => "≤",
                ">=" => "≥",
                "==" => "=",
                _ => "≠",
            },
            0,
        ),
        ("norm", 1) => (format!("<mrow><mo>‖</mo>{}<mo>‖</mo></mrow>", at(0, 0)), 5),
        ("norm_squared", 1) => (format!("<msup><mrow><mo>‖</mo>{}<mo>‖</mo></mrow><mn>2</mn></msup>", at(0, 0)), 4),
        ("abs", 1) => (format!("<mrow><mo>|</mo>{}<mo>|</mo></mrow>", at(0, 0)), 5),
        ("unit", 1) => (format!("<mover>{}<mo>^</mo></mover>", at(0, 5)), 5),
        ("sqrt", 1) => (format!("<msqrt>{}</msqrt>", at(0, 0)), 5),
        ("transpose", 1) => (format!("<msup>{}<mi>T</mi></msup>", at(0, 5)), 4),
        ("inverse", 1) => (format!("<msup>{}<mn>−1</mn></msup>", at(0, 5)), 4),
        _ => (format!("<mi mathvariant=\"normal\">{}</mi>{}", escaped(name), bracketed("(", arguments, ")")), 5),
    }
}

fn bracketed(open: &str, list: &[Expression], close: &str) -> String {
    let entries: Vec<String> = list.iter().map(|entry| expression(entry, 0)).collect();
    format!("<mrow><mo>{open}</mo>{}<mo>{close}</mo></mrow>", entries.join("<mo>,</mo>"))
}

/// Writes a name. Text after an underscore, and final digits, are its index.
fn identifier(name: &str) -> String {
    let stem = name.trim_end_matches(|c: char| c.is_ascii_digit());
    let (stem, index) = match name.split_once('_') {
        Some((stem, index)) if !stem.is_empty() => (stem, index),
        _ if !stem.is_empty() => name.split_at(stem.len()),
        _ => (name, ""),
    };
    if index.is_empty() {
        return format!("<mi>{}</mi>", escaped(stem));
    }
    format!("<msub><mi>{}</mi><mi>{}</mi></msub>", escaped(stem), escaped(index))
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use super::mathml;

    #[test]
    fn definitions_indices_and_parentheses() {
        let text =
            mathml("energy E(x0, x1: Point; k, L_0: Scalar) { let d = x1 - x0; k * (norm(d) - L_0)^2 }").unwrap();
        for part in [
            "<mi>d</mi><mo>=</mo><msub><mi>x</mi><mi>1</mi></msub><mo>−</mo>",
            "<msup><mrow><mo>(</mo><mrow><mo>‖</mo><mi>d</mi><mo>‖</mo></mrow><mo>−</mo>",
            "<msub><mi>L</mi><mi>0</mi></msub>",
        ] {
            assert!(text.contains(part), "no {part} in {text}");
        }
        assert_eq!(text.matches("<mtr>").count(), 2);
        assert!(mathml("energy E(p: Point) { max(p.x, infinity) }").unwrap().contains("<mn>∞</mn>"));
        assert!(mathml("energy E(").is_none());
    }
}
