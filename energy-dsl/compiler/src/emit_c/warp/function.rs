//! Native functions of Warp: read arguments, call the C function, return or write results.

use std::fmt::Write as _;

use super::signature::{Argument, Type, arguments};
use super::{constant, kinds, raw};
use crate::emit_c::element::Element;
use crate::emit_c::function::Function;
use crate::interpreted::InputKind;
use crate::plan::{Shape, groups};
use energy_runtime::{FieldKind, RoutineKind};

/// Code of a native function: routines whose C text it needs, and its body.
pub(super) struct Code {
    pub(super) routines: Vec<RoutineKind>,
    pub(super) body: String,
}

/// A function of the module.
pub(super) struct Native<'a> {
    /// Name without that of the element: `gradient`.
    pub(super) name: &'a str,
    pub(super) docs: String,
    /// Name, type and documentation.
    pub(super) arguments: Vec<(String, String, String)>,
    pub(super) returns: String,
    pub(super) forward: Code,
    pub(super) adjoint: Option<Code>,
}

/// Writes all functions of an element.
pub(super) fn functions(element: &Element<'_>) -> String {
    let mut text = String::new();
    for kind in kinds(element) {
        let native = match kind {
            RoutineKind::Value | RoutineKind::Gradient | RoutineKind::HessianVector => element.smooth(kind),
            RoutineKind::Force | RoutineKind::Residual => element.smooth(kind),
            RoutineKind::ReducedHessian => continue,
            RoutineKind::Vertex(0) => element.of_vertex(),
            RoutineKind::Vertex(_) => continue,
            RoutineKind::Rest if element.plan.stored() == 0 => continue,
            _ => element.to_arrays(kind),
        };
        text.push_str(&element.native(&native));
        if kind == RoutineKind::ConstraintJacobian {
            text.push_str(&element.native(&element.constraint()));
        }
        if matches!(kind, RoutineKind::Gradient | RoutineKind::Force | RoutineKind::Residual) {
            text.push_str(&element.native(&element.flags(kind)));
        }
    }
    text
}

impl Element<'_> {
    pub(super) fn called(&self, kind: RoutineKind) -> Function {
        let found = self.functions().into_iter().find(|function| function.kind == kind);
        found.expect("compiler bug: only routines of the element are called")
    }

    pub(super) fn has(&self, kind: RoutineKind) -> bool {
        kinds(self).contains(&kind)
    }

    pub(super) fn point_arguments(&self) -> Vec<Argument> {
        arguments(self.inputs, &[InputKind::Point, InputKind::Unknown], "x")
    }

    /// Returns the vectors or velocities of the unknowns: numbers for their increments.
    pub(super) fn vector_arguments(&self) -> Vec<Argument> {
        let mut first = 0;
        let points = self.point_arguments();
        let fields = &self.plan.declaration.points;
        let vector = |(place, point): (usize, &Argument)| {
            // Arrays of points are an argument for each; other unknowns are an argument for each field.
            let is_turned = fields.len() == points.len() && fields[place].kind == FieldKind::Rotation;
            let increments = if is_turned { 3 } else { point.of_type.size() };
            let vector = point.moved(increments, first, "v", "v_");
            first += increments;
            vector
        };
        points.iter().enumerate().map(vector).collect()
    }

    /// Returns the type of a vector of all increments.
    pub(super) fn type_of_vectors(&self) -> Type {
        match self.is_flat() {
            true => Type::of_rows(self.plan.declaration.increments()),
            false => Type::of_points(self.plan.coordinates),
        }
    }

    pub(super) fn parameter_arguments(&self) -> Vec<Argument> {
        arguments(self.inputs, &[InputKind::Parameter], "parameters")
    }

    /// Returns the arguments of a routine, in the order of its C function.
    pub(super) fn inputs_of(&self, kind: RoutineKind) -> Vec<Argument> {
        let mut list = match kind {
            RoutineKind::Rest => arguments(self.inputs, &[InputKind::Rest], "rest"),
            _ => self.point_arguments(),
        };
        if matches!(kind, RoutineKind::HessianVector | RoutineKind::Force | RoutineKind::Jacobians) {
            list.extend(self.vector_arguments());
        }
        list.extend(self.parameter_arguments());
        list
    }

    /// Returns the declarations of Python's arguments.
    pub(super) fn declared(&self, inputs: &[Argument], has_stored: bool) -> Vec<(String, String, String)> {
        let precision = self.dialect.precision;
        let declare = |input: &Argument| (input.name.clone(), input.of_type.annotation(precision), input.docs.clone());
        let mut list: Vec<_> = inputs.iter().map(declare).collect();
        if has_stored && self.plan.stored() > 0 {
            let real = Type::Scalar.annotation(precision);
            let docs = format!("array of {}: what the rest shape determines", self.plan.stored());
            list.push(("stored".to_owned(), format!("wp.array(dtype={real})"), docs));
        }
        list
    }

    /// Reads arguments into the arrays of C.
    pub(super) fn read_arguments(&self, inputs: &[Argument], has_stored: bool) -> String {
        let real = self.dialect.precision.real();
        let mut text = String::new();
        let mut sizes: Vec<(&str, usize)> = vec![("parameters", 0)];
        for input in inputs {
            let size = input.first + input.of_type.size();
            match sizes.iter_mut().find(|known| known.0 == input.array) {
                Some(known) => known.1 = size,
                None => sizes.push((input.array, size)),
            }
        }
        if has_stored {
            sizes.push(("stored", self.plan.stored()));
        }
        for (array, size) in sizes {
            let _ = writeln!(text, "{real} energy_{array}[{}];", size.max(1));
        }
        for input in inputs {
            text.push_str(&input.each(&input.name, |number, place| format!("{place} = {number}")));
        }
        if has_stored && self.plan.stored() > 0 {
            let count = self.plan.stored();
            let _ = writeln!(text, "for (int i = 0; i < {count}; i++) {{ energy_stored[i] = wp::index(stored, i); }}");
        }
        text
    }

    /// Calls the C function of a routine. `vector` is the array that it reads as `v`.
    pub(super) fn call(&self, kind: RoutineKind, vector: &str) -> String {
        let function = self.called(kind);
        let mut text = String::new();
        for result in &function.results {
            let real = self.dialect.precision.real();
            let _ = writeln!(text, "{real} energy_{}[{}];", result.name, result.size.max(1));
        }
        let array = |name: &str| match name {
            "u" => "energy_x".to_owned(),
            "v" => vector.to_owned(),
            _ => format!("energy_{name}"),
        };
        let list: Vec<String> = function.arguments.iter().chain(&function.results).map(|one| array(one.name)).collect();
        let _ = writeln!(
            text,
            "const int energy_flags = (int)energy_code::{}_{}({});\n(void)energy_flags;",
            self.name,
            function.name,
            list.join(", ")
        );
        text
    }

    /// Returns a value of some type from an array of C.
    pub(super) fn returned(&self, of_type: Type, array: &str) -> String {
        if of_type == Type::Scalar {
            return format!("return {array}[0];\n");
        }
        format!(
            "{} energy_result;\nfor (int i = 0; i < {}; i++) {{ {} = {array}[i]; }}\nreturn energy_result;\n",
            of_type.in_cpp(self.dialect.precision),
            of_type.size(),
            of_type.number("energy_result")
        )
    }

    /// Returns the function that returns flags alone.
    fn flags(&self, kind: RoutineKind) -> Native<'static> {
        let inputs = self.inputs_of(kind);
        let routines = match kind {
            RoutineKind::Gradient if self.has(RoutineKind::Value) => vec![RoutineKind::Value, kind],
            _ => vec![kind],
        };
        let mut body = self.read_arguments(&inputs, true) + "int energy_all = 0;\n";
        for &kind in &routines {
            let _ = write!(body, "{{\n{}energy_all |= energy_flags;\n}}\n", self.call(kind, "energy_v"));
        }
        body.push_str("return energy_all;\n");
        let names: Vec<String> = routines.iter().map(|kind| format!("`{}_{}`", self.name, kind.name())).collect();
        Native {
            name: "flags",
            docs: format!("Returns the flags of {}.", names.join(" and ")),
            arguments: self.declared(&inputs, true),
            returns: "wp.int32".to_owned(),
            forward: Code { routines, body },
            adjoint: None,
        }
    }

    /// Returns the function of derivatives by one point.
    fn of_vertex(&self) -> Native<'static> {
        let inputs = self.point_arguments().into_iter().chain(self.parameter_arguments()).collect::<Vec<_>>();
        let routines: Vec<RoutineKind> =
            kinds(self).into_iter().filter(|kind| matches!(kind, RoutineKind::Vertex(_))).collect();
        let real = self.dialect.precision.real();
        let mut body = self.read_arguments(&inputs, true);
        let _ = write!(body, "{real} energy_value[1], energy_found[12];\nswitch (point) {{\n");
        for (place, &kind) in routines.iter().enumerate() {
            let _ = writeln!(
                body,
                "case {place}:\n    (void)energy_code::{}_{}(energy_x, energy_parameters, energy_stored, energy_value, \
                 energy_found, energy_found + 3);\n    break;",
                self.name,
                kind.name()
            );
        }
        let nan = format!("energy_code::{}", self.dialect.constant(f64::NAN));
        let of_type = Type::Matrix(4, 3);
        let _ = writeln!(body, "default:\n    for (int i = 0; i < 12; i++) {{ energy_found[i] = {nan}; }}\n}}");
        body.push_str(&self.returned(of_type, "energy_found"));
        let mut arguments = vec![("point".to_owned(), "wp.int32".to_owned(), "number of the point, from 0".to_owned())];
        arguments.extend(self.declared(&inputs, true));
        let docs = "Returns the derivatives of U by one point: the gradient in row 0, the block in rows 1 to 3. The \
                    adjoint is not known.";
        let adjoint = Code { routines: Vec::new(), body: self.read_adjoint(of_type) + &self.unknown(&inputs) };
        Native {
            name: "vertex",
            docs: docs.to_owned(),
            arguments,
            returns: of_type.annotation(self.dialect.precision),
            forward: Code { routines, body },
            adjoint: Some(adjoint),
        }
    }

    /// Returns a function that writes all results but U to arrays, and returns flags.
    fn to_arrays(&self, kind: RoutineKind) -> Native<'static> {
        let function = self.called(kind);
        let (inputs, has_stored) = (self.inputs_of(kind), kind != RoutineKind::Rest);
        let mut arguments = self.declared(&inputs, has_stored);
        let mut body = self.read_arguments(&inputs, has_stored) + &self.call(kind, "energy_v");
        let is_full = matches!(kind, RoutineKind::Hessian | RoutineKind::GaussNewton);
        let is_skipped = |name: &str| name == "value" && is_full;
        let (points, is_flat) = (self.plan.coordinates / 3, self.is_flat());
        for (result, &(_, shape)) in function.results.iter().zip(groups(kind)) {
            if result.size == 0 || is_skipped(result.name) {
                continue;
            }
            if is_flat && is_full && result.name == "hessian" {
                body.push_str(&self.flat_hessian(&mut arguments));
                continue;
            }
            let (of_type, number) = match if is_flat { shape.flat() } else { shape } {
                Shape::Vectors => (Type::Vector(3), "i / 3)[i % 3]"),
                Shape::Blocks => (Type::Matrix(3, 3), "i / 9).data[i % 9 / 3][i % 3]"),
                _ => (Type::Scalar, "i)"),
            };
            let is_triangle = is_full && of_type == Type::Matrix(3, 3);
            let name = if is_triangle { "blocks" } else { result.name };
            let docs = if is_triangle { "3x3 blocks (i, j), row by row" } else { &*result.docs };
            let count = if is_triangle { points * points } else { result.size / of_type.size() };
            let (annotation, docs) = (of_type.annotation(self.dialect.precision), format!("array of {count}: {docs}"));
            arguments.push((name.to_owned(), format!("wp.array(dtype={annotation})"), docs));
            let _ = match is_triangle {
                true => writeln!(body, "{}", EXPANDED.replace("POINTS", &points.to_string())),
                false => writeln!(
                    body,
                    "for (int i = 0; i < {}; i++) {{ wp::index({name}, {number} = energy_{}[i]; }}",
                    result.size, result.name
                ),
            };
        }
        body.push_str("return energy_flags;\n");
        Native {
            name: kind.name(),
            docs: self.docs_of_arrays(kind).to_owned(),
            arguments,
            returns: "wp.int32".to_owned(),
            forward: Code { routines: vec![kind], body },
            adjoint: None,
        }
    }

    /// Adds the whole Hessian of mixed unknowns to the arguments. Returns the code that writes it.
    fn flat_hessian(&self, arguments: &mut Vec<(String, String, String)>) -> String {
        let n = self.plan.declaration.increments();
        let annotation = Type::Scalar.annotation(self.dialect.precision);
        let docs = format!("array of {}: the whole matrix, row by row", n * n);
        arguments.push(("hessian".to_owned(), format!("wp.array(dtype={annotation})"), docs));
        FLAT.replace("SIZE", &n.to_string())
    }

    fn docs_of_arrays(&self, kind: RoutineKind) -> &'static str {
        match kind {
            RoutineKind::Rest => "Computes the numbers that the rest shape determines. Returns DEGENERATE, or 0.",
            RoutineKind::Hessian => "Computes the gradient and the Hessian of U. Returns flags.",
            RoutineKind::GaussNewton => "Computes the gradient of U and ks J^T J. Returns flags.",
            RoutineKind::Jacobians => "Computes the force and its derivatives. Returns flags.",
            RoutineKind::Jacobian => "Computes the residual and its Jacobian. Returns flags.",
            RoutineKind::Next => "Computes the state after a step. Returns flags.",
            RoutineKind::NextJacobians => "Computes the state after a step and its derivatives. Returns flags.",
            RoutineKind::StateJacobian => {
                "Computes the gradient, or the residual, and its derivatives by the state. Returns flags."
            }
            _ => "Computes C and its derivatives. Returns flags.",
        }
    }

    /// Writes a function.
    fn native(&self, native: &Native<'_>) -> String {
        let code = |code: &Code| {
            let parts: Vec<String> = code.routines.iter().map(|&kind| format!(" + {}", constant(self, kind))).collect();
            let numbers = self.dialect.precision.name().to_uppercase();
            format!("    _native(_{numbers}{}, \"\"\"\n{}\"\"\"),\n", parts.concat(), raw(&code.body))
        };
        let list = |(name, of_type, _): &(String, String, String)| format!("    {name}: {of_type},\n");
        let docs = |(name, _, docs): &(String, String, String)| format!("    {name}: {}\n", escaped(docs));
        format!(
            "\n\n@wp.func_native(\n{}{})\ndef {}_{}(\n{}) -> {}:\n    \"\"\"{}\n\n{}    \"\"\"\n    ...\n",
            code(&native.forward),
            native.adjoint.as_ref().map(code).unwrap_or_default(),
            self.name,
            native.name,
            native.arguments.iter().map(list).collect::<String>(),
            native.returns,
            native.docs,
            native.arguments.iter().map(docs).collect::<String>()
        )
    }
}

/// Writes the triangle of blocks of a symmetric matrix as all blocks.
const EXPANDED: &str = r"for (int i = 0; i < POINTS; i++) {
    for (int j = i; j < POINTS; j++) {
        for (int k = 0; k < 9; k++) {
            const auto energy_number = energy_hessian[9 * (i * POINTS - i * (i + 1) / 2 + j) + k];
            wp::index(blocks, i * POINTS + j).data[k / 3][k % 3] = energy_number;
            wp::index(blocks, j * POINTS + i).data[k % 3][k / 3] = energy_number;
        }
    }
}";

/// Writes the upper triangle of a symmetric matrix as a whole matrix.
const FLAT: &str = r"for (int i = 0; i < SIZE; i++) {
    for (int j = i; j < SIZE; j++) {
        const auto energy_number = energy_hessian[i * SIZE - i * (i + 1) / 2 + j];
        wp::index(hessian, i * SIZE + j) = energy_number;
        wp::index(hessian, j * SIZE + i) = energy_number;
    }
}
";

/// Returns a text that can stand in a docstring.
fn escaped(text: &str) -> String {
    text.replace('\\', "\\\\").replace("\"\"\"", "'''")
}
