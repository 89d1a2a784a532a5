//! Remedies for what other languages and other keyboards write.

/// Names of functions elsewhere, and those of this language.
const FUNCTIONS: &[(&str, &str)] = &[
    ("length", "norm(v)"),
    ("len", "norm(v)"),
    ("magnitude", "norm(v)"),
    ("mag", "norm(v)"),
    ("length_squared", "norm_squared(v)"),
    ("squared_norm", "norm_squared(v)"),
    ("norm2", "norm_squared(v)"),
    ("sqr", "x^2"),
    ("square", "x^2"),
    ("squared", "x^2"),
    ("ln", "log(x)"),
    ("log10", "log(x) / log(10)"),
    ("log2", "log(x) / log(2)"),
    ("exp2", "2^x"),
    ("cbrt", "x^(1/3)"),
    ("normalize", "unit(v)"),
    ("normalized", "unit(v)"),
    ("normalise", "unit(v)"),
    ("hat", "unit(v)"),
    ("pow", "x^y"),
    ("powf", "x^y"),
    ("powi", "x^2"),
    ("power", "x^y"),
    ("fabs", "abs(x)"),
    ("arccos", "acos(x)"),
    ("arcsin", "asin(x)"),
    ("arctan", "atan(x)"),
    ("arctan2", "atan2(y, x)"),
    ("determinant", "det(M)"),
    ("inv", "inverse(M)"),
    ("tr", "trace(M)"),
    ("transposed", "transpose(M)"),
    ("T", "transpose(M)"),
    ("outer_product", "outer(a, b)"),
    ("cross_product", "cross(a, b)"),
    ("inner", "dot(a, b)"),
    ("dot_product", "dot(a, b)"),
    ("vec2", "vector(x, y)"),
    ("vec3", "vector(x, y, z)"),
    ("grad", "gradient(U, p)"),
    ("nabla", "gradient(U, p)"),
    ("derivative", "gradient(U, p)"),
    ("distance", "norm(p - q)"),
    ("dist", "norm(p - q)"),
    ("unit_vector", "unit(v)"),
    ("normed", "unit(v)"),
    ("exponential", "exp(x)"),
    ("logarithm", "log(x)"),
    ("root", "sqrt(x)"),
    ("absolute", "abs(x)"),
    ("minimum", "min(a, b)"),
    ("maximum", "max(a, b)"),
    ("relu", "max(x, 0)"),
    ("saturate", "clamp(x, 0, 1)"),
    ("sgn", "sign(x)"),
    ("signum", "sign(x)"),
    ("invert", "inverse(M)"),
    ("eye", "identity(3)"),
    ("double_dot", "ddot(A, B)"),
    ("contract", "ddot(A, B)"),
    ("tensor_product", "outer(a, b)"),
    ("svd", "singular_values(F)"),
    ("polar", "rotation_of(F)"),
    ("vec4", "vector(x, y, z, w)"),
    ("mat2", "columns(a, b)"),
    ("mat3", "columns(a, b, c)"),
    ("matrix", "columns(a, b, c)"),
    ("dihedral_angle", "dihedral(x1, x2, x3, x4)"),
];

/// Names of numbers elsewhere, and their spelling here.
const NUMBERS: &[(&str, &str)] = &[
    ("e", "exp(x) for eˣ, as in exp(-r^2), and exp(1) for the number e"),
    ("tau", "2 * π"),
    ("τ", "2 * π"),
    ("inf", "infinity"),
    ("Inf", "infinity"),
    ("INF", "infinity"),
    ("Infinity", "infinity"),
    ("INFINITY", "infinity"),
    ("oo", "infinity"),
    ("Pi", "π or pi"),
    ("true", "a comparison, as in a < b"),
    ("false", "a comparison, as in a < b"),
];

/// Functions of mathematics whose names must not be taken for misspellings of others.
const MATHEMATICS: &[&str] =
    &["asinh", "acosh", "atanh", "sec", "csc", "cot", "erfc", "gamma", "floor", "ceil", "round", "modulo", "hypot"];

/// Returns what is written here for a function of another language.
pub(crate) fn function(name: &str) -> Option<&'static str> {
    FUNCTIONS.iter().find(|(elsewhere, _)| *elsewhere == name).map(|(_, here)| *here)
}

/// Returns what is written here for a number of another language.
pub(crate) fn number(name: &str) -> Option<&'static str> {
    NUMBERS.iter().find(|(elsewhere, _)| *elsewhere == name).map(|(_, here)| *here)
}

/// Returns the names of functions in other languages.
pub(crate) fn functions_elsewhere() -> impl Iterator<Item = &'static str> {
    FUNCTIONS.iter().map(|(elsewhere, _)| *elsewhere).filter(|name| name.len() > 3)
}

/// Whether a name means something in mathematics, so that it is not a misspelling.
pub(crate) fn is_mathematics(name: &str) -> bool {
    MATHEMATICS.contains(&name)
}

/// Returns the message and the remedy for a statement of another language.
pub(super) fn statement(word: &str) -> Option<(&'static str, &'static str)> {
    match word {
        "for" | "while" | "loop" => Some((
            "a formula has no loops",
            "sum over indices, as in sum(j in 0..4, w[j] * x[j]), or list values: [2 * x[j] for j in 0..4]",
        )),
        "return" => Some((
            "a formula has no `return`",
            "end the body with its result, an expression without `return` and without `;`",
        )),
        "match" | "switch" => Some(("a formula has no `match`", "write if a < b { … } else { … }")),
        _ => None,
    }
}

/// Returns the remedy for a symbol where no value or operator can be.
pub(super) fn symbol(symbol: &str) -> Option<&'static str> {
    match symbol {
        "?" => Some("write if c { a } else { b } for c ? a : b"),
        "*" => Some("a power is written x^2"),
        "#" => Some("comments begin with `//`"),
        "=" => Some("compare with `==`, and define a name with `let name = …;`"),
        "!" => Some("write the opposite comparison, as in a >= b for !(a < b)"),
        "&" => Some("formulas have + - * / ^, comparisons, && and ||"),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::functions;

    #[test]
    fn remedies_name_functions_that_exist() {
        for (elsewhere, here) in FUNCTIONS {
            let name = here.split('(').next().unwrap();
            let known = functions::find(name).is_some() || name == "gradient" || here.contains('^');
            assert!(known, "{elsewhere} → {here}");
            assert!(functions::find(elsewhere).is_none(), "{elsewhere} exists");
        }
    }
}
