//! Fuzzing targets of the language.

use std::path::PathBuf;

use clap::ValueEnum;
use energy_compiler::{Interpreted, Listing, compile};

/// A reader of inputs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Target {
    /// A formula in both notations: as Rust tokens, and as a string in mathematical notation.
    Parser,
    /// A file of declarations, compiled and listed.
    File,
}

impl Target {
    /// Returns the folder of the target's inputs.
    #[must_use]
    pub fn corpus(self) -> PathBuf {
        let folder = match self {
            Self::Parser => "formulas",
            Self::File => "files",
        };
        std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("corpus").join(folder)
    }

    /// Returns pieces of text that are meaningful to the target.
    #[must_use]
    pub fn words(self) -> &'static [&'static str] {
        WORDS
    }

    /// Runs an input and returns its outcome.
    #[must_use]
    pub fn run(self, text: &str) -> String {
        match self {
            Self::Parser => formula(text),
            Self::File => file(text),
        }
    }
}

const BEFORE: &str = "energy E(p, q: Point; k: Scalar, L: Scalar[m])";

fn formula(text: &str) -> String {
    let quoted = format!("{BEFORE} = {text:?};");
    let plain = format!("{BEFORE} {{ {text} }}");
    [quoted, plain]
        .iter()
        .map(|declaration| match declaration.parse() {
            Ok(tokens) => {
                let code = compile(tokens).to_string();
                code.split("compile_error").nth(1).unwrap_or("compiles").to_owned()
            }
            Err(_) => "no tokens".to_owned(),
        })
        .collect()
}

fn file(text: &str) -> String {
    let _ = Listing::from_source(text);
    match Interpreted::from_file(text, "fuzz.energy") {
        Ok(declared) => format!("{} declarations", declared.len().min(3)),
        Err(errors) => errors.to_string(),
    }
}

const WORDS: &[&str] = &[
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
