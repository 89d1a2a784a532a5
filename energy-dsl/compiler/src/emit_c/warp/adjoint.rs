//! Functions that return one result, with adjoints: derivatives times the incoming adjoint.

use std::fmt::Write as _;

use super::function::{Code, Native};
use super::signature::{Argument, Type};
use crate::emit_c::element::Element;
use energy_runtime::RoutineKind;

impl Element<'_> {
    /// Reads the adjoint of the returned value into an array.
    pub(super) fn read_adjoint(&self, of_type: Type) -> String {
        let real = self.dialect.precision.real();
        let (size, number) = (of_type.size(), of_type.number("adj_ret"));
        format!(
            "{real} energy_adjoint[{size}];\nint energy_is_asked = 0;\nfor (int i = 0; i < {size}; i++) {{\n    \
             energy_adjoint[i] = {number};\n    energy_is_asked |= energy_adjoint[i] != 0;\n}}\n"
        )
    }

    /// Adds an adjoint that is not a number where derivatives are asked for that nobody knows.
    pub(super) fn unknown(&self, inputs: &[Argument]) -> String {
        let dialect = self.dialect;
        if inputs.is_empty() {
            return String::new();
        }
        let nan = format!("energy_code::{}", dialect.constant(f64::NAN));
        let mut text = format!("const {} energy_unknown = energy_is_asked ? {nan} : 0;\n", dialect.precision.real());
        for input in inputs {
            text.push_str(
                &input.each(&format!("adj_{}", input.name), |number, _| format!("{number} += energy_unknown")),
            );
        }
        text
    }

    /// Adds derivatives times the incoming adjoint: `derivative` is the place of row r and column c. Increments of each
    /// input are those of a vector.
    fn chained(&self, inputs: &[Argument], vectors: &[Argument], rows: usize, array: &str, derivative: &str) -> String {
        let mul_add = format!("energy_code::{}mul_add", self.dialect.prefix());
        let real = self.dialect.precision.real();
        let product = |number: &str, first: usize, of_type: Type| {
            let column = if of_type == Type::Scalar { "0" } else { "i" };
            format!(
                "{{ const int c = {first} + {column}; {real} sum = 0; for (int r = 0; r < {rows}; r++) {{ sum = \
                 {mul_add}({array}[{derivative}], energy_adjoint[r], sum); }} {number} += sum; }}"
            )
        };
        let mut text = String::new();
        for (input, vector) in inputs.iter().zip(vectors) {
            text.push_str(&match turns(input, vector) {
                true => self.turned(input, |number| product(number, vector.first, vector.of_type)),
                false => input
                    .each(&format!("adj_{}", input.name), |number, _| product(number, vector.first, vector.of_type)),
            });
        }
        text
    }

    /// Adds to the adjoint of a rotation q, from derivatives t by its three increments: `add` adds number i of t. The
    /// adjoint is tangent to unit quaternions, 2 (0, t) q: it has the inner product t·δ with any change ½ (0, δ) q.
    fn turned(&self, input: &Argument, add: impl Fn(&str) -> String) -> String {
        let (real, name, first) = (self.dialect.precision.real(), &input.name, input.first);
        let sum = add("energy_turn[i]");
        let mut text = format!("{{\n{real} energy_turn[3] = {{0, 0, 0}};\nfor (int i = 0; i < 3; i++) {{ {sum}; }}\n");
        for (number, [a, b, c]) in TURNED.iter().enumerate() {
            let term = |&(sign, turn, part): &(char, usize, usize)| {
                format!("{sign} energy_turn[{turn}] * energy_x[{}]", first + part)
            };
            let _ = writeln!(text, "adj_{name}[{number}] += 2 * ({} {} {});", term(a), term(b), term(c));
        }
        text + "}\n"
    }

    /// Returns a function that returns one result, with an adjoint.
    pub(super) fn smooth(&self, kind: RoutineKind) -> Native<'static> {
        let function = self.called(kind);
        let (name, docs, of_type, result) = match kind {
            RoutineKind::Value => ("value", "Returns U. The adjoint is the gradient.", Type::Scalar, "value"),
            RoutineKind::Gradient => {
                let docs = "Returns the gradient of U by the points. The adjoint is the Hessian times a vector.";
                ("gradient", docs, self.type_of_vectors(), "gradient")
            }
            RoutineKind::HessianVector => {
                let docs = "Returns the Hessian times a vector. The adjoint is exact by the vector.";
                ("hessian_vector", docs, self.type_of_vectors(), "product")
            }
            RoutineKind::Force => {
                let docs = "Returns the force. The adjoint is exact by points and velocities.";
                ("force", docs, self.type_of_vectors(), "force")
            }
            _ => {
                let docs = "Returns the residual. The adjoint is exact by the unknowns.";
                ("residual", docs, Type::of_rows(function.results[0].size), "value")
            }
        };
        let inputs = self.inputs_of(kind);
        let body = [
            self.read_arguments(&inputs, true),
            self.call(kind, "energy_v"),
            self.returned(of_type, &format!("energy_{result}")),
        ];
        let forward = Code { routines: vec![kind], body: body.concat() };
        let (docs, returns) = (self.of_unknowns(docs), of_type.annotation(self.dialect.precision));
        let adjoint = Some(self.adjoint(kind, of_type, &inputs));
        Native { name, docs, arguments: self.declared(&inputs, true), returns, forward, adjoint }
    }

    /// Returns the adjoint of a function that returns one result.
    fn adjoint(&self, kind: RoutineKind, of_type: Type, inputs: &[Argument]) -> Code {
        let size = self.plan.declaration.increments();
        let (points, vectors, parameters) =
            (self.point_arguments(), self.vector_arguments(), self.parameter_arguments());
        let square = match self.is_flat() {
            true => format!("r * {size} + c"),
            false => format!("9 * (r / 3 * {} + c / 3) + 3 * (r % 3) + c % 3", size / 3),
        };
        let (of, rest) = match kind {
            RoutineKind::Value => {
                let text = self.chained(&points, &vectors, 1, "energy_gradient", "c");
                (RoutineKind::Gradient, text + &self.unknown(&parameters))
            }
            RoutineKind::Gradient | RoutineKind::HessianVector => {
                let (to, unknown) = match kind {
                    RoutineKind::Gradient => (&points, parameters),
                    _ => (&vectors, [&points[..], &parameters[..]].concat()),
                };
                let text: String = to.iter().zip(&vectors).map(|(to, vector)| self.product(to, vector)).collect();
                (RoutineKind::HessianVector, text + &self.unknown(&unknown))
            }
            RoutineKind::Force => {
                let has = |place: usize| self.called(RoutineKind::Jacobians).results[place].size > 0;
                let mut text = String::new();
                for (place, inputs, array) in [(1, &points, "energy_by_position"), (2, &vectors, "energy_by_velocity")]
                {
                    if has(place) {
                        text.push_str(&self.chained(inputs, &vectors, size, array, &square));
                    }
                }
                (RoutineKind::Jacobians, text + &self.unknown(&parameters))
            }
            _ => {
                let of = match kind {
                    RoutineKind::Residual => RoutineKind::Jacobian,
                    _ => RoutineKind::ConstraintJacobian,
                };
                let place = format!("r * {size} + c");
                let text = self.chained(&points, &vectors, of_type.size(), "energy_jacobian", &place);
                (of, text + &self.unknown(&parameters))
            }
        };
        if !self.has(of) {
            let body = self.read_adjoint(of_type) + &self.unknown(inputs);
            return Code { routines: Vec::new(), body };
        }
        let has_slopes = kind == RoutineKind::Gradient && points.iter().zip(&vectors).any(|(x, v)| turns(x, v));
        let slopes = if has_slopes { self.slopes() } else { String::new() };
        let body = [
            self.read_arguments(inputs, true),
            self.read_adjoint(of_type),
            slopes,
            self.call(of, "energy_adjoint"),
            rest,
        ];
        let body = match of {
            // These read velocities, not the adjoint.
            RoutineKind::Jacobians => body.concat().replace("(energy_x, energy_adjoint,", "(energy_x, energy_v,"),
            _ => body.concat(),
        };
        let routines = std::iter::once(of).chain(has_slopes.then_some(RoutineKind::Gradient)).collect();
        Code { routines, body }
    }

    /// Adds numbers of the Hessian times the incoming adjoint. The derivative of the gradient g along exp(δ) has half
    /// of the cross product of g with the adjoint besides.
    fn product(&self, to: &Argument, vector: &Argument) -> String {
        let first = vector.first;
        if turns(to, vector) {
            let number = |of: &str, shift: usize| format!("energy_{of}[{first} + (i + {shift}) % 3]");
            let (slope, weight) = (|shift| number("slopes", shift), |shift| number("adjoint", shift));
            let cross = format!("{} * {} - {} * {}", slope(1), weight(2), slope(2), weight(1));
            return self.turned(to, |number| format!("{number} += energy_product[{first} + i] + ({cross}) / 2"));
        }
        let add = |number: &str, place: &str| {
            format!("{number} += {}", place.replacen(&format!("energy_{}", vector.array), "energy_product", 1))
        };
        Argument { of_type: to.of_type, ..vector.clone() }.each(&format!("adj_{}", to.name), add)
    }

    /// Writes the gradient to a separate array.
    fn slopes(&self) -> String {
        let (real, size) = (self.dialect.precision.real(), self.plan.declaration.increments());
        format!(
            "{real} energy_slopes[{size}];\n{{\n{}for (int i = 0; i < {size}; i++) {{ energy_slopes[i] = \
             energy_gradient[i]; }}\n}}\n",
            self.call(RoutineKind::Gradient, "energy_v")
        )
    }

    /// Returns words about points as words about unknowns, if some are not points.
    fn of_unknowns(&self, docs: &str) -> String {
        if self.plan.declaration.is_mixed() { docs.replace("points", "unknowns") } else { docs.to_owned() }
    }

    /// Returns the function that returns the rows of a constraint.
    pub(super) fn constraint(&self) -> Native<'static> {
        let kind = RoutineKind::ConstraintJacobian;
        let of_type = Type::of_rows(self.called(kind).results[0].size);
        let inputs = self.inputs_of(kind);
        let body = self.read_arguments(&inputs, true) + &self.call(kind, "") + &self.returned(of_type, "energy_value");
        Native {
            name: "constraint",
            docs: self.of_unknowns("Returns C. The adjoint is exact by the points."),
            arguments: self.declared(&inputs, true),
            returns: of_type.annotation(self.dialect.precision),
            forward: Code { routines: vec![kind], body },
            adjoint: Some(self.adjoint(kind, of_type, &inputs)),
        }
    }
}

/// The numbers of the quaternion (0, t) q: sign, number of t, number of q.
const TURNED: [[(char, usize, usize); 3]; 4] = [
    [('-', 0, 1), ('-', 1, 2), ('-', 2, 3)],
    [('+', 0, 0), ('+', 1, 3), ('-', 2, 2)],
    [('+', 1, 0), ('+', 2, 1), ('-', 0, 3)],
    [('+', 2, 0), ('+', 0, 2), ('-', 1, 1)],
];

/// Returns whether an input is a rotation, which has more numbers than increments.
fn turns(input: &Argument, vector: &Argument) -> bool {
    input.of_type != vector.of_type
}
