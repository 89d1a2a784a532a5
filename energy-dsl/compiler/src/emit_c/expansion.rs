//! The Hessian of points: the reduced one, expanded.

use std::fmt::Write as _;

use super::dialect::Numbers;
use super::element::Element;
use super::function::Function;
use super::routine::Written;
use crate::graph::Input;
use crate::plan::RoutinePlan;
use energy_runtime::RoutineKind;

impl Element<'_> {
    /// Writes the expansion of the reduced Hessian to points, and the Hessian; nothing without them.
    pub(super) fn expansion(&self) -> String {
        let (Some(expansion), Some(reduced)) = (&self.plan.expansion, self.plan.find(RoutineKind::ReducedHessian))
        else {
            return String::new();
        };
        let (real, is_scalar) = (self.dialect.of_type(false), self.dialect.numbers == Numbers::Plain);
        let returned = if is_scalar { "unsigned" } else { "uint32_t" };
        let first = reduced.sizes()[1];
        let hessian = self.functions().pop().expect("compiler bug: the Hessian comes last");
        let inlined = if self.is_merged() { "ENERGY_FN" } else { "ENERGY_ROUTINE" };
        let mut text = format!(
            "/* Expands derivatives by reduced coordinates to points: signed sums. */\n{inlined} void \
             {}(const {real} *ENERGY_RESTRICT reduced_gradient, const {real} *ENERGY_RESTRICT reduced_hessian, \
             {real} *ENERGY_RESTRICT gradient, {real} *ENERGY_RESTRICT hessian) {{\n",
            self.named("expand")
        );
        let read = |input: Input| match input {
            Input::Precomputed(number) if usize::from(number) < first => format!("reduced_gradient[{number}]"),
            Input::Precomputed(number) => format!("reduced_hessian[{}]", usize::from(number) - first),
            _ => unreachable!("compiler bug: an expansion reads derivatives"),
        };
        let mut written = Written::default();
        self.statements(self.dialect, &expansion.statements, &read, &mut written, &mut text);
        for name in ["reduced_gradient", "reduced_hessian"] {
            if !expansion.inputs().iter().any(|&input| read(input).starts_with(&format!("{name}["))) {
                let _ = writeln!(text, "    (void){name};");
            }
        }
        for (result, group) in ["gradient", "hessian"].iter().zip(&expansion.groups) {
            for (place, &number) in group.iter().enumerate() {
                let _ = writeln!(text, "    {result}[{place}] = {};", written.name(number));
            }
        }
        text.push_str("}\n\n");
        let is_split = is_scalar && self.is_merged();
        let in_general = reduced.general.as_ref().filter(|_| is_split).map(|_| "hessian_in_general");
        if let Some(name) = in_general {
            text.push_str("/* The general path of hessian. */\n");
            let reduced = self.named("reduced_hessian_in_general");
            text.push_str(&self.expanded(
                &hessian,
                &format!("ENERGY_RARE {returned} {}", self.named(name)),
                &reduced,
                "",
            ));
        }
        text.push_str(&if is_scalar { self.comment(&hessian) } else { String::new() });
        let otherwise = in_general.map(|name| {
            format!(
                "    if (flags == ENERGY_GENERAL) {{\n        return {}({});\n    }}\n",
                self.named(name),
                self.arguments(&hessian, false)
            )
        });
        let reduced = self.named(if is_split { "reduced_hessian_if_ordinary" } else { "reduced_hessian" });
        let begin = format!("ENERGY_ROUTINE {returned} {}", self.named("hessian"));
        text.push_str(&self.expanded(&hessian, &begin, &reduced, &otherwise.unwrap_or_default()));
        if is_scalar {
            text.push_str(&self.projected(&hessian));
        }
        text
    }

    /// Writes a function that expands the results of another one, unless `otherwise` returns before.
    fn expanded(&self, hessian: &Function, begin: &str, reduced: &str, otherwise: &str) -> String {
        let (real, is_scalar) = (self.dialect.of_type(false), self.dialect.numbers == Numbers::Plain);
        let sizes = self.plan.find(RoutineKind::ReducedHessian).map(RoutinePlan::sizes).unwrap_or_default();
        let returned = if is_scalar { "unsigned" } else { "uint32_t" };
        let inputs: Vec<&str> = hessian.arguments.iter().map(|argument| argument.name).collect();
        format!(
            "{begin}({}) {{\n    {real} reduced_gradient[{}], reduced_hessian[{}];\n    const {returned} flags = \
             {reduced}({}, value, reduced_gradient, reduced_hessian);\n{otherwise}    {}(reduced_gradient, \
             reduced_hessian, gradient, hessian);\n    return flags;\n}}\n\n",
            self.signature(hessian, false),
            sizes[1],
            sizes[2],
            inputs.join(", "),
            self.named("expand")
        )
    }

    /// Writes the function of the positive semi-definite Hessian.
    fn projected(&self, hessian: &Function) -> String {
        let (real, coordinates) = (self.dialect.precision.real(), self.plan.coordinates);
        let (numbers, points) = (hessian.results[2].size, coordinates / 3);
        let signature = self.signature(hessian, false);
        let inputs: Vec<&str> = hessian.arguments.iter().map(|argument| argument.name).collect();
        format!(
            "/* As {name}_hessian, but the Hessian is a full matrix, row by row, whose negative eigenvalues are 0. \
             */\nENERGY_ROUTINE unsigned {name}_projected_hessian({signature}) {{\n    {real} triangle[{numbers}], \
             work[{work}];\n    const unsigned flags = {name}_hessian({inputs}, value, gradient, triangle);\n    \
             {full};\n    (void){project};\n    return flags;\n}}\n\n",
            name = self.name,
            work = 2 * coordinates * coordinates,
            inputs = inputs.join(", "),
            full = self.dialect.call("full_matrix", &[&points.to_string(), "triangle", "hessian"]),
            project = self.dialect.call("project", &["hessian", "work", &coordinates.to_string()]),
        )
    }
}
