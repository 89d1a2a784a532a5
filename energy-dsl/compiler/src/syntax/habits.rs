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
];

/// Functions of mathematics whose names must not be taken for misspellings of others.
const MATHEMATICS: &[&str] =
    &["asinh", "acosh", "atanh", "sec", "csc", "cot", "erfc", "gamma", "floor", "ceil", "round", "modulo", "hypot"];

/// Returns what is written here for a function of another language.
pub(crate) fn function(name: &str) -> Option<&'static str> {
    FUNCTIONS.iter().find(|(elsewhere, _)| *elsewhere == name).map(|(_, here)| *here)
}

/// Whether a name means something in mathematics, so that it is not a misspelling.
pub(crate) fn is_mathematics(name: &str) -> bool {
    MATHEMATICS.contains(&name)
}

/// Returns the message and the remedy for a statement of another language.
pub(super) fn statement(word: &str) -> Option<(&'static str, &'static str)> {
    match word {
        "for" | "while" | "loop" => {
            Some(("a formula has no loops", "sum over indices, as in sum(j in 0..4, w[j] * x[j])"))
        }
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
        "!" => Some("write the opposite comparison, as in a >= b for !(a < b)"),
        "&" | "%" => Some("formulas have + - * / ^, comparisons, && and ||"),
        _ => None,
    }
}

/// Returns the Latin letters that look like the letters of a name, if some are not Latin: `p` for the Cyrillic `р`.
pub(crate) fn latin(name: &str) -> Option<String> {
    const PAIRS: &str = "аaеeоoрpсcуyхxіiјjѕsкkоoԁdһhԛqԝwАAВBЕEКKМMНHОOРPСCТTХXУYІIЈJЅSοoΟOΑAΒBΕEΖZΗHΙIΚKΜMΝNΡPΤTΥYΧX";
    let letters: Vec<char> = PAIRS.chars().collect();
    let look_alike = |c: char| letters.chunks_exact(2).find(|pair| pair[0] == c).map(|pair| pair[1]);
    let latin: String = name.chars().map(|c| look_alike(c).unwrap_or(c)).collect();
    (latin != name).then_some(latin)
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

    #[test]
    fn look_alikes_are_recognised() {
        assert_eq!(latin("р_k").as_deref(), Some("p_k"));
        assert_eq!(latin("p_k"), None);
    }
}
