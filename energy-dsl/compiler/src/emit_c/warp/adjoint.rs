//! Functions that return one result, with adjoints: derivatives times the incoming adjoint.

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

    /// Adds derivatives times the incoming adjoint: `derivative` is the place of row r and column c.
    fn chained(&self, inputs: &[Argument], rows: usize, array: &str, derivative: &str) -> String {
        let mul_add = format!("energy_code::{}mul_add", self.dialect.prefix());
        let mut text = String::new();
        for input in inputs {
            let column = if input.of_type == Type::Scalar { "0" } else { "i" };
            text.push_str(&input.each(&format!("adj_{}", input.name), |number, _| {
                format!(
                    "{{ const int c = {} + {column}; {} sum = 0; for (int r = 0; r < {rows}; r++) {{ sum = \
                     {mul_add}({array}[{derivative}], energy_adjoint[r], sum); }} {number} += sum; }}",
                    input.first,
                    self.dialect.precision.real()
                )
            }));
        }
        text
    }

    /// Returns a function that returns one result, with an adjoint.
    pub(super) fn smooth(&self, kind: RoutineKind) -> Native<'static> {
        let coordinates = self.plan.coordinates;
        let function = self.called(kind);
        let (name, docs, of_type, result) = match kind {
            RoutineKind::Value => ("value", "Returns U. The adjoint is the gradient.", Type::Scalar, "value"),
            RoutineKind::Gradient => {
                let docs = "Returns the gradient of U by the points. The adjoint is the Hessian times a vector.";
                ("gradient", docs, Type::of_points(coordinates), "gradient")
            }
            RoutineKind::HessianVector => {
                let docs = "Returns the Hessian times a vector. The adjoint is exact by the vector.";
                ("hessian_vector", docs, Type::of_points(coordinates), "product")
            }
            RoutineKind::Force => {
                let docs = "Returns the force. The adjoint is exact by points and velocities.";
                ("force", docs, Type::of_points(coordinates), "force")
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
        let (docs, returns) = (docs.to_owned(), of_type.annotation(self.dialect.precision));
        let adjoint = Some(self.adjoint(kind, of_type, &inputs));
        Native { name, docs, arguments: self.declared(&inputs, true), returns, forward, adjoint }
    }

    /// Returns the adjoint of a function that returns one result.
    fn adjoint(&self, kind: RoutineKind, of_type: Type, inputs: &[Argument]) -> Code {
        let size = self.plan.coordinates;
        let (points, vectors, parameters) =
            (self.point_arguments(), self.vector_arguments(), self.parameter_arguments());
        let by_blocks = format!("9 * (r / 3 * {} + c / 3) + 3 * (r % 3) + c % 3", size / 3);
        let (of, rest) = match kind {
            RoutineKind::Value => {
                (RoutineKind::Gradient, self.chained(&points, 1, "energy_gradient", "c") + &self.unknown(&parameters))
            }
            RoutineKind::Gradient | RoutineKind::HessianVector => {
                let (to, unknown) = match kind {
                    RoutineKind::Gradient => (&points, parameters),
                    _ => (&vectors, [&points[..], &parameters[..]].concat()),
                };
                let add = |input: &Argument| {
                    let product = |number: &str, place: &str| {
                        format!(
                            "{number} += {}",
                            place.replacen(&format!("energy_{}", input.array), "energy_product", 1)
                        )
                    };
                    input.each(&format!("adj_{}", input.name), product)
                };
                (RoutineKind::HessianVector, to.iter().map(add).collect::<String>() + &self.unknown(&unknown))
            }
            RoutineKind::Force => {
                let has = |place: usize| self.called(RoutineKind::Jacobians).results[place].size > 0;
                let mut text = String::new();
                for (place, inputs, array) in [(1, &points, "energy_by_position"), (2, &vectors, "energy_by_velocity")]
                {
                    if has(place) {
                        text.push_str(&self.chained(inputs, size, array, &by_blocks));
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
                let text = self.chained(&points, of_type.size(), "energy_jacobian", &place);
                (of, text + &self.unknown(&parameters))
            }
        };
        if !self.has(of) {
            let body = self.read_adjoint(of_type) + &self.unknown(inputs);
            return Code { routines: Vec::new(), body };
        }
        let body =
            [self.read_arguments(inputs, true), self.read_adjoint(of_type), self.call(of, "energy_adjoint"), rest];
        let body = match of {
            // These read velocities, not the adjoint.
            RoutineKind::Jacobians => body.concat().replace("(energy_x, energy_adjoint,", "(energy_x, energy_v,"),
            _ => body.concat(),
        };
        Code { routines: vec![of], body }
    }

    /// Returns the function that returns the rows of a constraint.
    pub(super) fn constraint(&self) -> Native<'static> {
        let kind = RoutineKind::ConstraintJacobian;
        let of_type = Type::of_rows(self.called(kind).results[0].size);
        let inputs = self.inputs_of(kind);
        let body = self.read_arguments(&inputs, true) + &self.call(kind, "") + &self.returned(of_type, "energy_value");
        Native {
            name: "constraint",
            docs: "Returns C. The adjoint is exact by the points.".to_owned(),
            arguments: self.declared(&inputs, true),
            returns: of_type.annotation(self.dialect.precision),
            forward: Code { routines: vec![kind], body },
            adjoint: Some(self.adjoint(kind, of_type, &inputs)),
        }
    }
}
