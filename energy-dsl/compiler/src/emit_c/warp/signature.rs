//! Arguments of functions in Warp: points as vectors, parameters as scalars, vectors and matrices.

use std::fmt::Write as _;

use crate::emit_c::dialect::Precision;
use crate::interpreted::{InputKind, InputNumbers};
use crate::syntax::canonical;

/// Words that Python, C++, Warp or the generated code use.
const RESERVED: &str = "alignas alignof and and_eq as asm assert async auto await bitand bitor blocks bool break \
    by_position by_state by_unknowns by_velocity \
    case catch char class compl const constexpr continue decltype def default del delete do double elif else enum \
    except explicit export extern finally float for force friend from global goto gradient hessian hessians if import in \
    inline int is jacobian lambda long mutable namespace new noexcept nonlocal not not_eq nullptr operator or or_eq \
    pass point private protected public raise register result ret return short signed sizeof state static stored struct \
    switch template this throw true try typedef typeid typename union unsigned using value virtual void volatile \
    while with wp xor xor_eq yield";

/// The type of an argument or a result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Type {
    Scalar,
    Vector(usize),
    Matrix(usize, usize),
}

impl Type {
    /// Returns the type of vectors of several points: one vector if there is one point.
    pub(super) fn of_points(coordinates: usize) -> Self {
        if coordinates == 3 { Self::Vector(3) } else { Self::Matrix(coordinates / 3, 3) }
    }

    /// Returns the type of rows of numbers.
    pub(super) fn of_rows(rows: usize) -> Self {
        if rows == 1 { Self::Scalar } else { Self::Vector(rows) }
    }

    pub(super) fn size(self) -> usize {
        match self {
            Self::Scalar => 1,
            Self::Vector(size) => size,
            Self::Matrix(rows, columns) => rows * columns,
        }
    }

    /// Returns the type in Python.
    pub(super) fn annotation(self, precision: Precision) -> String {
        let (real, letter) = match precision {
            Precision::Double => ("wp.float64", 'd'),
            Precision::Single => ("wp.float32", 'f'),
        };
        match self {
            Self::Scalar => real.to_owned(),
            Self::Vector(size @ 2..=4) => format!("wp.vec{size}{letter}"),
            Self::Vector(size) => format!("wp.types.vector(length={size}, dtype={real})"),
            Self::Matrix(rows @ 2..=4, columns) if rows == columns => format!("wp.mat{rows}{rows}{letter}"),
            Self::Matrix(rows, columns) => format!("wp.types.matrix(shape=({rows}, {columns}), dtype={real})"),
        }
    }

    /// Returns the type in C++.
    pub(super) fn in_cpp(self, precision: Precision) -> String {
        let real = match precision {
            Precision::Double => "wp::float64",
            Precision::Single => "wp::float32",
        };
        match self {
            Self::Scalar => real.to_owned(),
            Self::Vector(size) => format!("wp::vec_t<{size}, {real}>"),
            Self::Matrix(rows, columns) => format!("wp::mat_t<{rows}, {columns}, {real}>"),
        }
    }

    /// Returns number `i` of a value.
    pub(super) fn number(self, name: &str) -> String {
        match self {
            Self::Scalar => name.to_owned(),
            Self::Vector(_) => format!("{name}[i]"),
            Self::Matrix(_, columns) => format!("{name}.data[i / {columns}][i % {columns}]"),
        }
    }
}

/// An argument: some numbers of an array of the C function.
#[derive(Clone, Debug)]
pub(super) struct Argument {
    pub(super) name: String,
    pub(super) of_type: Type,
    /// The array of the C function, and the first number there.
    pub(super) array: &'static str,
    pub(super) first: usize,
    /// Name and unit, as declared.
    pub(super) docs: String,
}

impl Argument {
    /// Returns the argument as a vector of increments, which begins at `first`, under a name with a prefix.
    pub(super) fn moved(&self, increments: usize, first: usize, array: &'static str, prefix: &str) -> Self {
        let of_type = if increments == self.of_type.size() { self.of_type } else { Type::of_rows(increments) };
        let name = format!("{prefix}{}", self.name);
        Self { name, of_type, array, first, docs: format!("vector or velocity at {}", self.docs) }
    }

    /// Writes a statement for each number, which gets the number and its place in the array.
    pub(super) fn each(&self, name: &str, statement: impl Fn(&str, &str) -> String) -> String {
        let first = self.first;
        if self.of_type == Type::Scalar {
            return format!("{};\n", statement(name, &format!("energy_{}[{first}]", self.array)));
        }
        let place = if first == 0 { "i".to_owned() } else { format!("{first} + i") };
        let body = statement(&self.of_type.number(name), &format!("energy_{}[{place}]", self.array));
        format!("for (int i = 0; i < {}; i++) {{ {body}; }}\n", self.of_type.size())
    }
}

/// The arguments that are the inputs of some kinds.
pub(super) fn arguments(inputs: &[InputNumbers], kinds: &[InputKind], array: &'static str) -> Vec<Argument> {
    let mut all: Vec<(InputKind, String, Type, String)> = Vec::new();
    for input in inputs {
        let unit = if input.unit.is_empty() { String::new() } else { format!(" in {}", input.unit) };
        let docs = format!("{}{unit}", input.name);
        let name = identifier(&input.name);
        match (input.kind, &input.shape[..]) {
            (InputKind::Point, [points, 3]) => {
                all.extend((0..*points).map(|i| (input.kind, format!("{name}{i}"), Type::Vector(3), docs.clone())));
            }
            (kind, []) => all.push((kind, name, Type::Scalar, docs)),
            (kind, [size]) => all.push((kind, name, Type::Vector(*size), docs)),
            (kind, [rows @ .., columns]) => {
                all.push((kind, name, Type::Matrix(rows.iter().product(), *columns), docs));
            }
        }
    }
    // Names are made unique among all inputs, so that an input has one name in all functions.
    for place in 0..all.len() {
        while all[..place].iter().any(|before| before.1 == all[place].1) {
            all[place].1.push('_');
        }
    }
    let (mut list, mut first) = (Vec::new(), 0);
    for (_, name, of_type, docs) in all.into_iter().filter(|input| kinds.contains(&input.0)) {
        list.push(Argument { name, of_type, array, first, docs });
        first += of_type.size();
    }
    list
}

/// Returns a name that Python and C++ can read.
fn identifier(name: &str) -> String {
    let parts: Vec<String> = name.split('_').map(canonical).collect();
    let mut plain = String::new();
    for letter in parts.join("_").chars() {
        match letter {
            _ if letter.is_ascii_alphanumeric() || letter == '_' => plain.push(letter),
            '[' | ']' => {}
            _ => {
                let _ = write!(plain, "u{:04x}", u32::from(letter));
            }
        }
    }
    if RESERVED.split_whitespace().any(|word| word == plain)
        || plain.starts_with(|c: char| c.is_ascii_digit())
        || plain.starts_with("v_")
    {
        plain.push('_');
    }
    plain
}

#[cfg(test)]
mod tests {
    use super::identifier;

    #[test]
    fn names_are_those_of_python_and_cpp() {
        let names = ["p_k", "λ", "θ₀", "ξ[0]", "K_prime", "x̃", "stored"].map(identifier);
        assert_eq!(names, ["p_k", "lambda_", "theta0", "xi0", "K_prime", "xu0303", "stored_"]);
    }
}
