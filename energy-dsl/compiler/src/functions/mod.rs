//! The functions of the language, one row each: name, description, shape rule, effect on units, lowering and
//! accuracy. Operators are functions, too. The derivatives of a robust primitive are next to its lowering.

mod angle;
mod arithmetic;
mod computed_as;
mod decisive;
mod dihedral;
mod elementary;
mod error_function;
mod exponential;
mod hyperbolic;
mod inner_product;
mod inverse;
mod length;
mod lengths;
mod linear_algebra;
mod logic;
mod loss;
mod parallelogram;
mod polar;
mod power_series;
mod quaternion;
mod remainder;
mod rotated;
mod rotation_vector;
mod shape;
mod sinc;
mod singular;
mod spatial_polar;
mod spline;
mod trigonometric;
mod turned;
mod units;

pub use shape::{Lowered, Shape};
pub use units::Units;

use crate::graph::{Ending, Graph, Recogniser};

/// A function of the language.
pub struct Function {
    /// Name, or symbol of the operator.
    pub name: &'static str,
    /// Form of a call, for messages and documentation.
    pub usage: &'static str,
    /// Formula, domain and behaviour at singularities, for the language reference.
    pub docs: &'static str,
    /// Returns the shape of the result, or a message that names the expected shapes.
    pub shape: fn(&[Shape]) -> Result<Shape, String>,
    /// The effect on units.
    pub units: Units,
    /// Returns the nodes of the result.
    pub lower: fn(&mut Graph, &[Lowered]) -> Lowered,
    /// Bound on the relative rounding error of value, first and second derivatives in units of roundoff, for exact
    /// arguments. Empty if the ordinary rules apply.
    pub accuracy: &'static str,
}

impl std::fmt::Debug for Function {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name)
    }
}

/// Returns all functions and operators.
pub fn all() -> impl Iterator<Item = &'static Function> {
    [
        arithmetic::FUNCTIONS,
        elementary::FUNCTIONS,
        computed_as::FUNCTIONS,
        exponential::FUNCTIONS,
        trigonometric::FUNCTIONS,
        hyperbolic::FUNCTIONS,
        error_function::FUNCTIONS,
        sinc::FUNCTIONS,
        loss::FUNCTIONS,
        spline::FUNCTIONS,
        linear_algebra::FUNCTIONS,
        polar::FUNCTIONS,
        singular::FUNCTIONS,
        length::FUNCTIONS,
        angle::FUNCTIONS,
        dihedral::FUNCTIONS,
        quaternion::FUNCTIONS,
        logic::FUNCTIONS,
    ]
    .into_iter()
    .flatten()
}

/// Returns the function of this name.
#[must_use]
pub fn find(name: &str) -> Option<&'static Function> {
    all().find(|f| f.name == name)
}

/// Returns a number of arguments for a message: `1 argument`, `3 arguments`.
fn arguments(count: usize) -> String {
    format!("{count} argument{}", if count == 1 { "" } else { "s" })
}

/// Returns each naive spelling that compiles to a robust form, with a description of that form.
pub fn robust_spellings() -> impl Iterator<Item = (&'static str, &'static str)> {
    RECOGNISERS.iter().map(|recogniser| (recogniser.spelling, recogniser.form))
}

/// Naive spellings that compile to robust forms. If several end in the same operation, the first match counts.
pub const RECOGNISERS: &[Recogniser] = &[
    Recogniser {
        spelling: "1 - dot(unit(a), unit(b))",
        form: "2 sin²(φ/2) of the angle φ between a and b",
        ending: Ending::Difference,
        recognise: angle::recognise_one_minus_cosine,
    },
    Recogniser {
        spelling: "1 + dot(unit(a), unit(b))",
        form: "2 cos²(φ/2) of the angle φ between a and b",
        ending: Ending::Sum,
        recognise: angle::recognise_one_plus_cosine,
    },
    Recogniser {
        spelling: "norm(a) * norm(b) + dot(a, b)",
        form: "2 ‖a‖‖b‖ cos²(φ/2) of the angle φ between a and b",
        ending: Ending::WrittenSum,
        recognise: lengths::recognise_lengths_plus_dot,
    },
    Recogniser {
        spelling: "norm(a) * norm(b) - dot(a, b)",
        form: "2 ‖a‖‖b‖ sin²(φ/2) of the angle φ between a and b",
        ending: Ending::WrittenDifference,
        recognise: lengths::recognise_lengths_minus_dot,
    },
    Recogniser {
        spelling: "1 + dot(a, b) / (norm(a) * norm(b))",
        form: "2 cos²(φ/2) of the angle φ between a and b",
        ending: Ending::WrittenSum,
        recognise: lengths::recognise_one_plus_quotient,
    },
    Recogniser {
        spelling: "1 - dot(a, b) / (norm(a) * norm(b))",
        form: "2 sin²(φ/2) of the angle φ between a and b",
        ending: Ending::WrittenDifference,
        recognise: lengths::recognise_one_minus_quotient,
    },
    Recogniser {
        spelling: "norm(d) - L",
        form: "the elongation, accurate near rest; so is its \
        square",
        ending: Ending::Difference,
        recognise: length::recognise_elongation,
    },
    Recogniser {
        spelling: "trace(stretch_of(F)) - 3",
        form: "the trace of the strain of a 3×3 matrix, accurate near rest",
        ending: Ending::Difference,
        recognise: spatial_polar::recognise_stretch_difference,
    },
    Recogniser {
        spelling: "sin(dihedral(a, b, c, d) / 2) - sin(y / 2)",
        form: "the difference of half-angle sines, accurate \
            near θ = y",
        ending: Ending::Difference,
        recognise: dihedral::recognise_sine_difference,
    },
    Recogniser {
        spelling: "1 - \
        cos(x)",
        form: "`one_minus_cos(x)`",
        ending: Ending::Difference,
        recognise: elementary::recognise_versine,
    },
    Recogniser {
        spelling: "1 + cos(x)",
        form: "2 cos(x/2)², accurate near x = π",
        ending: Ending::Sum,
        recognise: elementary::recognise_vercosine,
    },
    Recogniser {
        spelling: "exp(x) - \
        1",
        form: "`expm1(x)`",
        ending: Ending::Difference,
        recognise: exponential::recognise_expm1,
    },
    Recogniser {
        spelling: "sqrt(c * (1 - dot(unit(a), unit(b))))",
        form: "√(2c) sin(φ/2) of the angle φ between a and b",
        ending: Ending::Root,
        recognise: angle::recognise_root,
    },
    Recogniser {
        spelling: "cos(angle(a, b))",
        form: "the cosine of the vectors, without the angle",
        ending: Ending::Cosine,
        recognise: angle::recognise_cosine_of_angle,
    },
    Recogniser {
        spelling: "sin(dihedral(a, b, c, d)), and of half the angle",
        form: "the sine from the triangles' normals, \
            without the angle",
        ending: Ending::Sine,
        recognise: dihedral::recognise_sine,
    },
    Recogniser {
        spelling: "cos(dihedral(a, b, c, d)), and of half the angle",
        form: "the cosine from the triangles' normals, \
            without the angle",
        ending: Ending::Cosine,
        recognise: dihedral::recognise_cosine,
    },
    Recogniser {
        spelling: "exp(x) - 1 - x, sin(x) - x, x - log(1 + x), …",
        form: "the rest of the Taylor series at 0",
        ending: Ending::WrittenDifference,
        recognise: remainder::recognise_difference,
    },
    Recogniser {
        spelling: "1 - exp(-x) * (1 + x), 1 - exp(-x) - x * exp(-x), …",
        form: "the regularised incomplete gamma function of an integer",
        ending: Ending::WrittenDifference,
        recognise: remainder::recognise_damped_difference,
    },
    Recogniser {
        spelling: "exp(-x) * (1 + x + x^2/2) - 1, …",
        form: "the regularised incomplete gamma function of an integer",
        ending: Ending::WrittenSum,
        recognise: remainder::recognise_damped_sum,
    },
    Recogniser {
        spelling: "cos(x) - 1 + x^2/2, -sin(x) + x, …",
        form: "the rest of the Taylor series at 0",
        ending: Ending::WrittenSum,
        recognise: remainder::recognise_sum,
    },
    Recogniser {
        spelling: "(exp(x) - 1 - x) / x^2, sin(x) / x, log(1 + x) / x, x * y / x, …",
        form: "the rest of the Taylor series over a power of x, regular at 0; without common factors",
        ending: Ending::WrittenQuotient,
        recognise: remainder::recognise_quotient,
    },
    Recogniser {
        spelling: "norm(d)^α",
        form: "a power of the length with its own derivatives at \
        0",
        ending: Ending::Power,
        recognise: length::recognise_norm_power,
    },
];
