//! Renders plans as C, and as CUDA, which is the same text with intrinsics in place of operators.
//!
//! Numbers have the bits of scalars of generated Rust at the SIMD levels with fused operations. The general path runs over
//! numbers with an extended exponent. What only limits along rays can decide is flagged.

mod dialect;
mod element;
mod expression;
mod numbers;

use std::fmt::Write as _;

use crate::interpreted::Interpreted;
use dialect::{Dialect, Numbers};
use element::Element;
use expression::Meanings;

pub use dialect::Precision;

/// A language that plans are rendered as.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Target {
    /// C99, which is also C++17.
    C,
    /// CUDA C++, which also runs on the host.
    Cuda,
}

/// A generated file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct SourceFile {
    /// Name without a folder.
    pub name: String,
    /// Text.
    pub text: String,
}

/// Renders elements.
#[must_use]
pub fn sources(elements: &[Interpreted], target: Target, precision: Precision) -> Vec<SourceFile> {
    let mut files = vec![SourceFile { name: format!("energy_{}.h", precision.name()), text: numbers::header(precision) }];
    let dialect = Dialect { precision, numbers: Numbers::Plain, operators: target == Target::C };
    let meanings = Meanings::default();
    for element in elements {
        let name = format!("{}_{}", snake_case(&element.declaration().name), precision.name());
        let written =
            Element { plan: element.plan(), inputs: element.inputs(), name: &name, dialect, meanings: &meanings };
        let guard = format!("{}_H", name.to_uppercase());
        let mut text = format!("#ifndef {guard}\n#define {guard}\n\n#include \"energy_{}.h\"\n\n", precision.name());
        text.push_str(&written.routines());
        let _ = writeln!(text, "/* The element, for hosts that do not know it. */");
        let _ = writeln!(text, "extern const energy_{}_element {name};\n\n#endif", precision.name());
        files.push(SourceFile { name: format!("{name}.h"), text });
        let text = format!("#include \"{name}.h\"\n\n{}", written.description());
        files.push(SourceFile { name: format!("{name}.c"), text });
    }
    files
}

/// Returns a name in the spelling of C: `HookeSpring` becomes `hooke_spring`.
fn snake_case(name: &str) -> String {
    let letters: Vec<char> = name.chars().collect();
    let mut snake = String::with_capacity(name.len() + 4);
    for (place, &letter) in letters.iter().enumerate() {
        let before = place.checked_sub(1).map(|before| letters[before]);
        let after = letters.get(place + 1);
        let begins = before.is_some_and(|before| {
            !before.is_uppercase() && before != '_' || after.is_some_and(|after| after.is_lowercase()) && before != '_'
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
