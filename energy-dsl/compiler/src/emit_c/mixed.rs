//! Elements with other unknowns than points of their own, or with a state: their unknowns, loops over elements, kernels
//! of CUDA.

use std::fmt::Write as _;

use super::element::Element;
use super::function::Function;
use super::routine::Written;
use energy_runtime::{Declaration, Field, FieldKind, RoutineKind};

/// Returns whether the loops over elements are those of mixed unknowns and states.
pub(super) fn has_mixed_loops(declaration: &Declaration) -> bool {
    let turns = |field: &Field| field.kind == FieldKind::Rotation;
    declaration.is_mixed() || !declaration.state.is_empty() || declaration.points.iter().any(turns)
}

/// Returns the kinds of unknowns that an input holds. Matrices and twists count as numbers.
fn kinds(field: &Field) -> Vec<String> {
    let (kind, count) = match (field.kind, field.size) {
        (FieldKind::Rotation, _) => ("ENERGY_ROTATION", 1),
        (FieldKind::Point, 2) => ("ENERGY_POINT2", 1),
        (FieldKind::Point, _) => ("ENERGY_POINT", 1),
        (FieldKind::Numbers, 2) => ("ENERGY_VEC2", 1),
        (FieldKind::Numbers, 3) => ("ENERGY_VEC3", 1),
        (FieldKind::Numbers, 4) => ("ENERGY_VEC4", 1),
        (FieldKind::Numbers | FieldKind::Motion | FieldKind::TimeStep, size) => ("ENERGY_SCALAR", size),
    };
    let shared = if field.shared { " + ENERGY_SHARED" } else { "" };
    vec![format!("{kind}{shared}"); count]
}

impl Element<'_> {
    /// Returns whether the loops over elements are those of mixed unknowns and states.
    pub(super) fn has_mixed_loops(&self) -> bool {
        has_mixed_loops(&self.plan.declaration)
    }

    /// Writes the function that describes the unknowns and the state.
    pub(super) fn layout(&self) -> String {
        let declaration = &self.plan.declaration;
        let kinds: Vec<String> = declaration.points.iter().flat_map(kinds).collect();
        let of_type = format!("energy_{}_layout", self.dialect.precision.name());
        format!(
            "/* The unknowns, and the numbers of the state. */\nENERGY_FN {of_type} {}_layout(void) {{\n    static const \
             unsigned char kinds[{count}] = {{\n        {}}};\n    const {of_type} layout = {{{count}, {}, {}, {}, \
             kinds}};\n    return layout;\n}}\n\n",
            self.name,
            kinds.chunks(4).map(|line| line.join(", ")).collect::<Vec<_>>().join(",\n        "),
            declaration.increments(),
            self.states(),
            u8::from(!self.is_flat()),
            count = kinds.len(),
        )
    }

    /// Writes the function of the state at rest; nothing if the state is given with each element.
    pub(super) fn at_rest(&self) -> String {
        let Some(code) = &self.plan.at_rest else { return String::new() };
        let (name, real) = (self.name, self.dialect.precision.real());
        let mut text = format!(
            "/* The state at rest, {} numbers. The state among the parameters is not read. */\nENERGY_ROUTINE void \
             {name}_state_at_rest(const {real} *rest, const {real} *parameters, {real} *ENERGY_RESTRICT state) {{\n",
            self.states()
        );
        let mut written = Written::default();
        let read = |input| self.read(input, false);
        self.statements(self.dialect, &code.statements, &read, &mut written, &mut text);
        for array in ["rest", "parameters"] {
            if !code.inputs().into_iter().any(|input| read(input).starts_with(&format!("{array}["))) {
                let _ = writeln!(text, "    (void){array};");
            }
        }
        for (place, &number) in code.groups[0].iter().enumerate() {
            let _ = writeln!(text, "    state[{place}] = {};", written.name(number));
        }
        text + "}\n\n"
    }

    /// Writes the loop over elements of mixed unknowns: one at a time, or vectors of them.
    pub(super) fn mixed_loops(&self, in_lanes: bool) -> String {
        let (name, suffix, real) = (self.name, self.dialect.precision.name(), self.dialect.precision.real());
        let room = self.room();
        let (ending, work, run) = match in_lanes {
            false => (
                "",
                format!("    {real} work[{room}];\n"),
                format!("mixed_run_each(&{name}, &layout, routine, batch, 0U, batch->batch.count, work)"),
            ),
            true => (
                "_lanes",
                format!("    energy_{suffix}_lanes work[{}];\n    {real} single[{room}];\n", 2 * room),
                format!(
                    "mixed_run_lanes(&{name}, &layout, {name}_lanes_run, routine, batch, work, ({real} *)(void \
                     *)(work + {room}), single)"
                ),
            ),
        };
        format!(
            "void {name}_evaluate{ending}(int32_t routine, energy_{suffix}_mixed_batch *batch) {{\n    const \
             energy_{suffix}_layout layout = {name}_layout();\n{work}    batch->batch.flagged = 0U;\n    \
             batch->batch.unsettled_count = 0U;\n    energy_{suffix}_{run};\n}}\n"
        )
    }

    /// Writes the kernel of a routine for elements of mixed unknowns.
    pub(super) fn mixed_kernel(&self, function: &Function) -> String {
        let Function { kind, name: routine, arguments, results } = function;
        let (name, suffix, real) = (self.name, self.dialect.precision.name(), self.dialect.precision.real());
        let mut text = format!(
            "__global__ void {name}_{routine}_kernel(energy_{suffix}_mixed_batch all) {{\n    const size_t i = \
             (size_t)blockIdx.x * blockDim.x + threadIdx.x;\n    const energy_{suffix}_layout layout = \
             {name}_layout();\n"
        );
        for array in arguments.iter().chain(results) {
            let _ = writeln!(text, "    {real} {}[{}];", array.name, array.size.max(1));
        }
        text.push_str("    unsigned flags;\n    if (i >= all.batch.count) {\n        return;\n    }\n");
        for argument in arguments {
            let (array, size) = (argument.name, argument.size);
            let read = match array {
                "x" | "u" => format!("read_unknowns(&layout, &all, 0, i, {array})"),
                "v" => "read_unknowns(&layout, &all, 1, i, v)".to_owned(),
                "rest" => format!("read(&all.batch.x, i, {size}, rest)"),
                "parameters" if *kind == RoutineKind::Rest => {
                    format!("read(&all.batch.parameters, i, {}, parameters)", size - self.states())
                }
                "parameters" => format!("read_parameters(&layout, &all, i, {size}, parameters)"),
                _ => format!("read(&all.batch.stored, i, {size}, stored)"),
            };
            let _ = writeln!(text, "    energy_{suffix}_{read};");
        }
        let list: Vec<&str> = arguments.iter().chain(results).map(|array| array.name).collect();
        let _ = writeln!(text, "    flags = {name}_{routine}({});", list.join(", "));
        for (place, result) in results.iter().enumerate() {
            let _ = writeln!(
                text,
                "    energy_{suffix}_mixed_write(&layout, &all.batch.results[{place}], ENERGY_{}, {place}, i, {}, {});",
                routine.to_uppercase(),
                result.size,
                result.name
            );
        }
        let _ = writeln!(text, "    energy_{suffix}_device_note(&all.batch, i, flags);\n}}\n");
        text
    }

    /// Returns the count of numbers of the state.
    fn states(&self) -> usize {
        self.plan.declaration.state.iter().map(|field| field.size).sum()
    }
}

#[cfg(test)]
mod tests {
    use crate::{Interpreted, Precision, Target, sources};

    fn header(text: &str) -> String {
        let elements = Interpreted::from_file(text, "text").expect("it compiles");
        let files = sources(&elements, Target::C, &[Precision::Double]).expect("it is written");
        let own = |name: &str| name.ends_with("_f64.h") && !name.starts_with("energy_");
        files.into_iter().find(|file| own(&file.name)).expect("the element has a header").text
    }

    #[test]
    fn every_type_of_unknowns_has_a_kind() {
        let text = header(
            "residual All(s: Scalar, a: Vec2, b: Vec3, c: Vec4, p: Point2, x: Point, m: Motion, F: Mat2x3) {
                s * (a.x + b.x + c.x + p.x + x.x + F[1][2]) * transform(m, x)
            }",
        );
        let kinds = "{\n        ENERGY_SCALAR, ENERGY_VEC2, ENERGY_VEC3, ENERGY_VEC4,\n        ENERGY_POINT2, ENERGY_POINT, \
                     ENERGY_POINT, ENERGY_ROTATION,\n        ENERGY_SCALAR, ENERGY_SCALAR, ENERGY_SCALAR, \
                     ENERGY_SCALAR,\n        ENERGY_SCALAR, ENERGY_SCALAR};";
        assert!(text.contains(kinds), "{text}");
        let text = header("energy Gas(x: Point, shared p: Scalar) { p * x.z }");
        assert!(text.contains("{\n        ENERGY_POINT, ENERGY_SCALAR + ENERGY_SHARED};"), "{text}");
        assert!(text.contains("u[4]: x (3), p, shared by all"), "{text}");
    }

    #[test]
    fn states_at_rest_are_functions_of_rest_shapes_and_parameters() {
        let text = header(
            "energy Bar(x, y: Point; rest X, Y: Vec3; state e: Scalar = 0, l: Scalar = 2 * L; k, L: Scalar) {
                rest { let R = norm(X - Y); }
                next { e = e + R; l = l + e; }
                k * (norm(x - y) - R - e * l - L)^2
            }",
        );
        let (_, function) = text.split_once("bar_f64_state_at_rest(").expect("it has the function");
        let (function, _) = function.split_once("\n}\n").expect("it ends");
        assert!(function.contains("state[0] = 0.0;") && function.contains("2.0 * parameters[1]"), "{function}");
        assert!(text.contains("k, L, then the state: e, l"), "{text}");
    }
}
