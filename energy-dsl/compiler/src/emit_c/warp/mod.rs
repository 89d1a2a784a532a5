//! Renders plans as a Python module for Warp: native functions around the text of C, with adjoints.

mod adjoint;
mod function;
mod signature;

use std::fmt::Write as _;

use super::dialect::{Dialect, Numbers, Precision};
use super::element::Element;
use super::expression::Meanings;
use super::mixed::has_mixed_loops;
use super::{SourceFile, folder, numbers};
use crate::interpreted::Interpreted;
use energy_runtime::RoutineKind;

/// Renders elements as one module.
pub(super) fn module(elements: &[Interpreted], names: &[String], precisions: &[Precision]) -> SourceFile {
    let meanings = Meanings::default();
    let mut text = include_str!("module.py.in").to_owned();
    if elements.iter().any(|element| has_mixed_loops(element.declaration())) {
        let before = "Some derivatives are not known";
        text = text.replacen(before, &format!("{}{before}", include_str!("mixed.txt.in")), 1);
    }
    let (mut table, mut code) = (String::new(), String::new());
    for &precision in precisions {
        let _ =
            writeln!(code, "\n_{} = r\"\"\"{}\"\"\"", precision.name().to_uppercase(), raw(&numbers::bare(precision)));
        for (element, name) in elements.iter().zip(names) {
            let name = format!("{name}_{}", precision.name());
            let dialect = Dialect { precision, numbers: Numbers::Plain, operators: false };
            let plan = element.plan().in_precision(precision.rounding());
            let written = Element { plan: &plan, inputs: element.inputs(), name: &name, dialect, meanings: &meanings };
            table.push_str(&row(&written));
            code.push_str(&texts(&written));
            code.push_str(&function::functions(&written));
        }
    }
    let _ = writeln!(
        text,
        "\n#: What each element is: its declaration, and the numbers of its inputs.\nELEMENTS = {{\n{table}}}"
    );
    text.push_str(&code);
    folder::stamped("energies.py", &["Energies for kernels of Warp; ELEMENTS lists their formulas.".to_owned()], &text)
}

/// Returns the entry of an element in the table of elements.
fn row(element: &Element<'_>) -> String {
    let plan = element.plan;
    format!(
        "    \"{}\": {{\n        \"declaration\": \"{}\",\n        \"formula\": \"{}\",\n        \"coordinates\": {},\n        \
         \"parameters\": {},\n        \"rest\": {},\n        \"stored\": {},\n    }},\n",
        element.name,
        plan.declaration.name,
        quoted(&plan.declaration.formula),
        plan.coordinates,
        plan.parameters,
        plan.shape,
        plan.stored()
    )
}

/// Returns the name of the constant that has the C text of a routine.
fn constant(element: &Element<'_>, kind: RoutineKind) -> String {
    format!("_{}_{}", element.name, kind.name()).to_uppercase()
}

/// Returns the routines of an element: those of its plan, and the Hessian, which may be an expansion.
fn kinds(element: &Element<'_>) -> Vec<RoutineKind> {
    element.functions().iter().map(|function| function.kind).collect()
}

/// Writes the C text of all routines as constants.
fn texts(element: &Element<'_>) -> String {
    let mut text = String::new();
    for kind in kinds(element).into_iter().filter(|kind| *kind != RoutineKind::ReducedHessian) {
        let _ = writeln!(text, "\n{} = r\"\"\"\n{}\"\"\"", constant(element, kind), raw(&element.alone(kind)));
    }
    text
}

/// Returns a text that can stand in a string of Python.
fn quoted(text: &str) -> String {
    text.replace('\\', "\\\\").replace('"', "\\\"").replace('\n', "\\n")
}

/// Returns a text that can stand in a raw string of Python.
fn raw(text: &str) -> String {
    text.replace("\"\"\"", "'''")
}

impl Element<'_> {
    /// Writes a routine, and the routines that it calls, for a function that needs no others.
    fn alone(&self, kind: RoutineKind) -> String {
        let is_repeated = self.plan.repetition.is_some();
        let of_moving = |kind: RoutineKind| {
            let routine = self.plan.find(kind).expect("compiler bug: routines of the element are written");
            let sum = if is_repeated { self.sum(routine) } else { String::new() };
            self.routine(routine, is_repeated) + &sum
        };
        match kind {
            RoutineKind::Rest => self.routine(&self.plan.rest, false),
            RoutineKind::Hessian if self.plan.find(kind).is_none() => {
                of_moving(RoutineKind::ReducedHessian) + &self.expansion()
            }
            _ => of_moving(kind),
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::{Budget, Interpreted, Origin, Precision, Target, origin, sources};

    fn module(text: &str) -> String {
        let elements = Interpreted::from_file_with_vertices(text, "text", &Budget::default()).expect("it compiles");
        let files = sources(&elements, Target::Warp, &[Precision::Double, Precision::Single]).expect("names differ");
        assert_eq!(files.iter().map(|file| &*file.name).collect::<Vec<_>>(), ["energies.py"]);
        files[0].text.clone()
    }

    #[test]
    fn modules_know_whether_they_were_changed() {
        let text: String = (0..60).map(|i| format!("energy Weight{i}(p: Point; w: Scalar) {{ w * p.z }}\n")).collect();
        let text = module(&text);
        assert_eq!(origin(&text), Origin::Generated);
        assert_eq!(origin(&text.replace("weight7_f64", "weight8_f64")), Origin::Changed);
    }

    #[test]
    fn every_kind_has_its_functions() {
        let text = "energy Spring(p, q: Point; rest X, Y: Vec3; k: Scalar) {
                rest { let L = norm(X - Y); }
                k * (norm(p - q) - L)^2
            }
            force Drag(_p: Point, v: Velocity; c: Scalar) { -c * v }
            constraint Middle(p, q, m: Point) { (p + q) / 2 - m }
            residual Circle(a, b: Scalar; r: Scalar) { [a^2 + b^2 - r^2] }";
        let text = module(text);
        let energy = ["rest", "value", "gradient", "hessian", "hessian_vector", "vertex", "flags"];
        let constraint = ["constraint", "constraint_jacobian", "constraint_hessian", "gauss_newton", "value", "force"];
        let all = [
            ("spring", &energy[..]),
            ("drag", &["force", "jacobians", "flags"]),
            ("middle", &constraint),
            ("circle", &["residual", "jacobian", "flags"]),
        ];
        for (element, functions) in all {
            for function in functions {
                for suffix in ["f64", "f32"] {
                    assert!(text.contains(&format!("\ndef {element}_{suffix}_{function}(\n")), "{element} {function}");
                }
            }
        }
        // Code for C hosts, and statements that Warp cannot read inside of a function, are left out.
        assert!(!text.contains("_element") && !text.contains("#include") && text.contains("energy_f64_run_tape"));
        let (_, single) = text.split_once("_F32 = ").expect("it is in single precision, too");
        let code = single.lines().filter(|line| line.contains("energy_") && !line.trim_start().starts_with("/*"));
        assert!(code.clone().count() > 100 && code.clone().all(|line| !line.contains("double ")));
    }
}
