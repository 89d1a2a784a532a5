//! The language of formulas.

use std::path::Path;

use energy_compiler::{Budget, Interpreted, Limits, Listing, compile};

use crate::target::{Target, text};

/// A formula in both notations: as Rust tokens, and as a string in mathematical notation.
pub(crate) const FORMULA: Target =
    Target { name: "formula", words: WORDS, shared: &[], made: Vec::new, read: read_formula };

/// A file of declarations, compiled to tapes and listed.
pub(crate) const DECLARATIONS: Target = Target {
    name: "declarations",
    words: WORDS,
    shared: &["verify/data/errata.energy", "scenes/own.energy"],
    made: Vec::new,
    read: |input, _| compiled(input).map(|_| ()),
};

/// A hundredth of the usual budget, so that thousands of inputs take a minute.
const LIMITS: Limits = Limits::new(200_000, 40_000_000);

const BEFORE: &str = "#[limits(steps = 2e5, bytes = 4e7)] energy E(p, q: Point; k: Scalar, L: Scalar[m])";

fn read_formula(input: &[u8], _: &Path) -> Result<(), String> {
    let text = text(input)?;
    let quoted = format!("{BEFORE} = {text:?};");
    let plain = format!("{BEFORE} {{ {text} }}");
    let read = |declaration: &String| -> Result<(), String> {
        let tokens = declaration.parse().map_err(|_| "no tokens".to_owned())?;
        let code = compile(tokens).to_string();
        // The message of the first error.
        code.split_once("compile_error").map_or(Ok(()), |(_, rest)| Err(rest.chars().take(500).collect()))
    };
    let [quoted, plain] = [&quoted, &plain].map(read);
    quoted.or_else(|quoted| plain.map_err(|plain| quoted + &plain))
}

/// Compiles a file within a small budget.
pub(crate) fn compiled(input: &[u8]) -> Result<Vec<Interpreted>, String> {
    let text = text(input)?;
    let budget = || Budget::new(LIMITS);
    let listed = Listing::from_file_within(text, "fuzzed.energy", &budget()).map(drop);
    let declared = Interpreted::from_file_within(text, "fuzzed.energy", &budget());
    // A hundred errors with their lines are long, but each is short.
    let short = |errors: energy_compiler::Diagnostics| -> String { errors.to_string().chars().take(900).collect() };
    listed.map_err(short)?;
    declared.map_err(short)
}

pub(crate) const WORDS: &[&str] = &[
    "energy ",
    "constraint ",
    "force ",
    "residual ",
    "fn ",
    "rest ",
    "let ",
    "if ",
    "else ",
    "const ",
    "sum(",
    "in ",
    "Point",
    "Velocity",
    "Scalar",
    "Scalar[N/m]",
    "Vec3",
    "Twist",
    "Quat",
    "DualQuat",
    "p",
    "q",
    "k",
    "θ",
    "dot(",
    "norm(",
    "unit(",
    "cross(",
    "exp(",
    "log(",
    "dihedral(",
    "gradient(",
    "identity(3)",
    "columns(",
    "det(",
    "inverse(",
    "angle(",
    "power_of_two(",
    "0..4",
    "+",
    "-",
    "*",
    "/",
    "^",
    "<",
    "=",
    ";",
    ",",
    ":",
    "(",
    ")",
    "{",
    "}",
    "[",
    "]",
    "#[audit]",
    "‖",
    "‖p − q‖",
    "½",
    "²",
    "√",
    "·",
    "×",
    "ᵀ",
    "â",
    "₀",
    "\\frac{",
    "|",
    "&&",
    "!",
    "->",
    "..",
    "'a",
    "\"",
    "//",
    "/*",
    "*/",
];
