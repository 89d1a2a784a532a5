//! Remedies: what to change where a name is unknown or shapes do not fit.

use super::expression::Checker;
use crate::diagnostic::nearest;
use crate::functions::{self, Function, Shape};
use crate::syntax::canonical;
use crate::syntax::characters::{difference, picture};
use crate::syntax::habits;

impl Checker<'_> {
    /// Returns the remedy for a name that is not declared.
    pub(super) fn remedy_for_name(&self, name: &str) -> String {
        let known = || self.scopes.iter().flat_map(|scope| scope.keys()).map(|known| self.as_written(known));
        if let Some(look_alike) = look_alike(name, known()) {
            return look_alike;
        }
        if functions::find(name).is_some() {
            return format!("`{name}` is a function: call it with its arguments in parentheses");
        }
        let near = |name: &str| {
            let canonical_names: Vec<(String, &str)> = known().map(|known| (canonical(known), known)).collect();
            let near = nearest(name, canonical_names.iter().map(|(known, _)| known.as_str()))?;
            canonical_names.iter().find(|(known, _)| known == near).map(|(_, written)| (*written).to_owned())
        };
        match (near(&canonical(name)), habits::number(name)) {
            (Some(near), _) => format!("did you mean `{near}`?"),
            (None, Some(here)) => format!("write {here}"),
            (None, None) => "declare it as an input, or define it with `let`".into(),
        }
    }

    /// Returns the remedy for a function that does not exist.
    pub(super) fn remedy_for_function(&self, name: &str) -> String {
        if self.find(name).is_some() {
            return format!("`{name}` is a value; for a product write `{name} * (…)`");
        }
        if let Some(here) = habits::function(name) {
            return format!("write {here}");
        }
        if habits::is_mathematics(name) {
            return format!("define it: fn {name}(x) {{ … }}");
        }
        let mut known: Vec<&str> = functions::all().map(|function| function.name).collect();
        known.extend(self.functions.iter().map(|function| function.name.text.as_str()));
        if let Some(look_alike) = look_alike(name, known.iter().copied()) {
            return look_alike;
        }
        habits::functions_elsewhere().for_each(|name| known.push(name));
        match nearest(name, known) {
            Some(near) => match habits::function(near) {
                Some(here) => format!("write {here}"),
                None => format!("did you mean `{near}`?"),
            },
            None => format!("define it: fn {name}(…) {{ … }}"),
        }
    }

    /// Returns a defined name as its definition writes it.
    fn as_written<'b>(&'b self, canonical: &'b str) -> &'b str {
        self.spellings.get(canonical).map_or(canonical, String::as_str)
    }
}

/// Returns the remedy for a name that looks like one of the known names.
fn look_alike<'a>(name: &str, mut known: impl Iterator<Item = &'a str>) -> Option<String> {
    let declared = known.find(|declared| picture(declared) == picture(name))?;
    let difference = difference(name, declared)?;
    Some(format!("did you mean `{declared}`? They look alike, but {difference}"))
}

/// Returns the remedy for arguments whose shapes a function does not take.
pub(super) fn for_shapes(function: &Function, shapes: &[Shape]) -> String {
    use Shape::{DualQuat, Matrix, Motion, Quat, Scalar, Vector};
    let name = function.name;
    match (name, shapes) {
        ("+" | "-", [Scalar, Matrix(n, m)] | [Matrix(n, m), Scalar]) if n == m => {
            format!("a number times the identity is a matrix: x * identity({n})")
        }
        ("+" | "-", [Scalar, Vector(_)] | [Vector(_), Scalar]) => {
            "take the length norm(v) or a component v.x of the vector".into()
        }
        ("+" | "-", [Vector(_), Vector(_)]) => "give both the same number of components, as in vector(x, y, 0)".into(),
        ("+" | "-" | "*", [Quat | DualQuat | Motion, Vector(3)]) => {
            "turn a vector by rotate(q, v), move a point by transform(a, p)".into()
        }
        ("+" | "-", _) => "bring both sides to the same shape".into(),
        ("<" | "<=" | ">" | ">=" | "==" | "!=", _) => {
            "compare numbers: lengths norm(v), components v.x, or entries M[0][1]".into()
        }
        ("&&" | "||", _) => "write a comparison on each side, as in a < b && b < c".into(),
        ("*", [Vector(_), Vector(_)]) => "write dot(a, b) for a number, cross(a, b) for a vector".into(),
        ("*", [Vector(_), Matrix(..)]) => "write the vector on the right: M * v, or transpose(M) * v".into(),
        ("*", [Matrix(..), _]) => "transpose one factor, or exchange them".into(),
        ("/", [_, Matrix(..)]) => "multiply by the inverse: inverse(M) * b".into(),
        ("/", [_, Vector(_)]) => "divide by its length norm(v) or by norm_squared(v)".into(),
        ("^", [Vector(_), _]) => "write norm_squared(v), or raise a component: v.x^2".into(),
        ("^", [Matrix(..), _]) => "write M * M for the square, inverse(M) for the inverse".into(),
        ("abs", [Vector(_)]) => "the length of a vector is ‖v‖ or norm(v)".into(),
        ("norm" | "norm_squared" | "unit", [Scalar]) => "the size of a scalar is abs(x), its square x^2".into(),
        ("cross" | "angle", [Vector(2), _] | [_, Vector(2)]) => {
            "give plane vectors a third component: vector(x, y, 0)".into()
        }
        ("det" | "inverse" | "adjugate" | "trace", [Matrix(rows, columns)]) => {
            let square = if rows > columns { "transpose(M) * M" } else { "M * transpose(M)" };
            format!("take that of a square matrix, as in {name}({square})")
        }
        (_, [Vector(_)]) if takes_a_scalar(function) => {
            format!("take its length or a component: {name}(norm(v)), {name}(v.x)")
        }
        (_, [Matrix(..)]) if takes_a_scalar(function) => format!("take an entry: {name}(M[0][1])"),
        _ => format!("write {}", function.usage),
    }
}

fn takes_a_scalar(function: &Function) -> bool {
    (function.shape)(&[Shape::Scalar]).is_ok()
}
