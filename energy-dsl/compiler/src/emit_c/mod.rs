//! Renders plans as C, as CUDA, which is the same text with intrinsics in place of operators, and as functions of Warp,
//! which have that text inside.
//!
//! Numbers have the bits of scalars of generated Rust at the SIMD levels with fused operations. The general path runs over
//! numbers with an extended exponent. What only limits along rays can decide is flagged.

mod dialect;
mod element;
mod expansion;
mod expression;
mod folder;
mod function;
mod host;
mod mixed;
mod numbers;
mod routine;
mod tape;
mod transposition;
mod warp;

use std::fmt::Write as _;

use crate::interpreted::Interpreted;
use dialect::{Dialect, Numbers};
use element::Element;
use expression::Meanings;

pub use dialect::Precision;
pub use folder::{Origin, origin};

/// A language that plans are rendered as.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Target {
    /// C99, which is also C++17.
    C,
    /// The same as C, in files that end in `.cpp`.
    Cpp,
    /// CUDA C++, which also runs on the host.
    Cuda,
    /// A Python module of functions for kernels of Warp, on the CPU and on CUDA.
    Warp,
}

/// A generated file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SourceFile {
    /// Name without a folder.
    pub name: String,
    /// Contents of the file.
    pub text: String,
    /// Whether it is the same for all elements.
    pub is_shared: bool,
}

impl SourceFile {
    fn shared(self) -> Self {
        Self { is_shared: true, ..self }
    }
}

/// Renders elements as a folder that needs nothing else: headers, loops over elements, a `README.md` and a
/// `CMakeLists.txt`; for Warp, one Python module. Equal elements give equal bytes.
///
/// # Errors
/// When two elements have one name in C.
pub fn sources(
    elements: &[Interpreted],
    target: Target,
    precisions: &[Precision],
) -> Result<Vec<SourceFile>, SourceError> {
    let names: Vec<String> = elements.iter().map(|element| snake_case(&element.declaration().name)).collect();
    if let Some(place) = (1..names.len()).find(|&place| names[..place].contains(&names[place])) {
        return Err(SourceError::SameName { name: names[place].clone() });
    }
    if target == Target::Warp {
        return Ok(vec![warp::module(elements, &names, precisions)]);
    }
    let mut files: Vec<SourceFile> =
        precisions.iter().flat_map(|&of| of_precision(elements, &names, target, of)).collect();
    let has_mixed = elements.iter().any(|element| mixed::has_mixed_loops(element.declaration()));
    files.extend(project(&files, target, precisions, has_mixed));
    Ok(files)
}

/// Why declarations cannot be written in another language.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum SourceError {
    /// Two elements have one name in C.
    SameName {
        /// The common name in C.
        name: String,
    },
}

impl std::fmt::Display for SourceError {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::SameName { name } => write!(f, "two declarations are called `{name}` in C; rename one of them"),
        }
    }
}

impl std::error::Error for SourceError {}

fn of_precision(elements: &[Interpreted], names: &[String], target: Target, precision: Precision) -> Vec<SourceFile> {
    let suffix = precision.name();
    let shared = |part: &str, about: &str, text: String| {
        folder::stamped(&format!("energy_{suffix}{part}.h"), &[about.to_owned()], &text).shared()
    };
    let mut files = vec![
        shared("", "Numbers, rounding errors, elementary functions.", numbers::header(precision)),
        shared("_loops", "Loops over elements.", numbers::loops(precision)),
        shared("_lanes", "Vectors of numbers, and loops over vectors of elements.", numbers::lanes(precision)),
    ];
    if elements.iter().any(|element| mixed::has_mixed_loops(element.declaration())) {
        let about = "Loops over elements of mixed unknowns and with states.";
        files.push(shared("_mixed", about, numbers::mixed(precision)));
        files.push(shared("_mixed_lanes", "The same in vectors.", numbers::mixed_lanes(precision)));
    }
    let dialect = Dialect { precision, numbers: Numbers::Plain, operators: target != Target::Cuda };
    let meanings = Meanings::default();
    let source = if target == Target::Cpp { "cpp" } else { "c" };
    for (element, name) in elements.iter().zip(names) {
        let name = format!("{name}_{suffix}");
        let declaration = element.declaration();
        let about = [format!("{} {}: {}", declaration.kind.keyword(), declaration.name, declaration.formula)];
        let plan = element.plan().in_precision(precision.rounding());
        let written = Element { plan: &plan, inputs: element.inputs(), name: &name, dialect, meanings: &meanings };
        let mut add =
            |ending: &str, text: String| files.push(folder::stamped(&format!("{name}{ending}"), &about, &text));
        add(".h", header(&written));
        let text = format!("#include \"{name}.h\"\n\n{}{}", written.description(), written.loops(false));
        add(&format!(".{source}"), text);
        let operators = Element { dialect: Dialect { operators: true, ..dialect }, ..written };
        let mixed = if written.has_mixed_loops() { "_mixed" } else { "" };
        let text =
            format!("#include \"{name}.h\"\n#include \"energy_{suffix}{mixed}_lanes.h\"\n\n{}", operators.lanes());
        add(&format!("_lanes.{source}"), text);
        if target == Target::Cuda {
            add(".cu", format!("#include \"{name}.h\"\n\n{}", operators.kernels()));
        }
    }
    files
}

/// Returns the files that describe a folder and build it.
fn project(files: &[SourceFile], target: Target, precisions: &[Precision], has_mixed: bool) -> [SourceFile; 2] {
    let is_source = |name: &str| [".c", ".cpp", ".cu"].iter().any(|ending| name.ends_with(ending));
    let sources: Vec<String> =
        files.iter().filter(|file| is_source(&file.name)).map(|file| format!("  {}", file.name)).collect();
    let language = match target {
        Target::C | Target::Warp => "C",
        Target::Cpp => "CXX",
        Target::Cuda => "C CUDA",
    };
    let cmake =
        include_str!("CMakeLists.txt.in").replace("@LANGUAGE@", language).replace("@FILES@", &sources.join("\n"));
    let described: Vec<&str> = precisions.iter().map(|precision| precision.described()).collect();
    let mut readme = include_str!("README.md.in").replace("@PRECISIONS@", &described.join(" and "));
    readme.push_str(if has_mixed { include_str!("mixed.md.in") } else { "" });
    [("CMakeLists.txt", cmake), ("README.md", readme)].map(|(name, text)| folder::stamped(name, &[], &text).shared())
}

/// Returns the header of an element.
fn header(element: &Element<'_>) -> String {
    let (name, suffix) = (element.name, element.dialect.precision.name());
    let guard = format!("{}_H", name.to_uppercase());
    let (included, batch, layout) = match element.has_mixed_loops() {
        true => ("mixed", "mixed_batch", element.at_rest() + &element.layout()),
        false => ("loops", "batch", String::new()),
    };
    format!(
        "#ifndef {guard}\n#define {guard}\n\n#include \"energy_{suffix}_{included}.h\"\n\n#ifdef __cplusplus\nextern \"C\" \
         {{\n#endif\n\n{}{layout}/* The element, for hosts that do not know it. */\nextern const energy_{suffix}_element \
         {name};\n\n/* Runs a routine on many elements: one at a time, and vectors of them with the same results. \
         */\nvoid {name}_evaluate(int32_t routine, energy_{suffix}_{batch} *batch);\nvoid {name}_evaluate_lanes(int32_t \
         routine, energy_{suffix}_{batch} *batch);\n\n#ifdef __cplusplus\n}}\n#endif\n\n#endif\n",
        element.routines()
    )
}

/// Returns a name in the spelling of C: `HookeSpring` becomes `hooke_spring`.
fn snake_case(name: &str) -> String {
    let letters: Vec<char> = name.chars().collect();
    let mut snake = String::with_capacity(name.len() + 4);
    for (place, &letter) in letters.iter().enumerate() {
        let before = place.checked_sub(1).map(|before| letters[before]);
        let after = letters.get(place + 1);
        // A capital begins a word after a small letter, and before one.
        let begins = before.is_some_and(|before| {
            before != '_' && (!before.is_uppercase() || after.is_some_and(|after| after.is_lowercase()))
        });
        if letter.is_uppercase() && begins {
            snake.push('_');
        }
        match letter {
            _ if letter.is_ascii_alphanumeric() || letter == '_' => snake.push(letter.to_ascii_lowercase()),
            _ => {
                let _ = write!(snake, "u{:04x}", u32::from(letter));
            }
        }
    }
    snake
}

#[cfg(test)]
mod tests {
    use super::snake_case;

    #[test]
    fn names_are_those_of_c() {
        let names = ["HookeSpring", "StVK", "TetStVK", "Spring2", "ARAP", "x_y", "Δ"].map(snake_case);
        assert_eq!(names, ["hooke_spring", "st_vk", "tet_st_vk", "spring2", "arap", "x_y", "u0394"]);
    }
}
