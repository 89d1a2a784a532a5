//! Checks units. Every input has a dimension, known or unknown, and every operator gives equations between dimensions.
//! This finds wrong formulas, which finite differences cannot.

mod dimension;
mod infer;
mod rules;
mod solver;

use super::typed::{Binding, Input, Program, Typed, TypedKind};
use crate::diagnostic::{Diagnostic, Diagnostics, Span};
use crate::syntax::ElementType;
use dimension::{Dimension, ENERGY, LENGTH, VELOCITY};
use energy_runtime::Kind;
use infer::Inference;

/// Checks the units of a declaration with correct shapes. If no input has the unit of a quantity, there is nothing to
/// check: all inputs may be plain numbers.
pub(super) fn check(program: &Program, diagnostics: &mut Diagnostics) {
    let inputs = program.moving.iter().chain(&program.rest).chain(&program.parameters);
    let mut annotated = false;
    for input in inputs {
        annotated |= read(&input.unit, &input.span, diagnostics);
    }
    for Binding { unit, .. } in &program.bindings {
        if let Some((text, span)) = unit.as_ref().and_then(|u| Some((&u.text, u.span.as_ref()?))) {
            annotated |= read(text, span, diagnostics);
        }
    }
    if !annotated || !diagnostics.0.is_empty() {
        return;
    }
    let mut inference = Inference::new(program, diagnostics);
    let results: &[Typed] = match &program.result.kind {
        TypedKind::Array(rows) => rows,
        // Rows may have different units.
        TypedKind::Call(f, rows) if f.name == "vector" && program.kind != Kind::Energy => rows,
        _ => std::slice::from_ref(&program.result),
    };
    for (number, result) in results.iter().enumerate() {
        let found = inference.expression(result).main();
        match program.kind {
            Kind::Energy => {
                inference.result(&found, &Dimension::of(ENERGY), &result.span, "an energy must come out in J");
            }
            Kind::Force => {
                let unknown = &program.moving[number];
                let wanted = Dimension::of(ENERGY).over(&inference.unknown(unknown));
                let what = match unknown.input_type.element {
                    ElementType::Rotation => "a torque must come out in N m".into(),
                    ElementType::Point | ElementType::Point2 => "a force must come out in N".into(),
                    _ => format!("the force on `{}` must come out in J over its unit", unknown.name),
                };
                inference.result(&found, &wanted, &result.span, &what);
            }
            Kind::Constraint | Kind::Residual => {}
        }
    }
    for (values, which) in [(&program.next, "new value"), (&program.at_rest, "value at rest")] {
        let values = values.as_ref().map_or_else(Vec::new, Typed::parts);
        let states = program.state().iter().flat_map(|state| vec![state; state.input_type.length.unwrap_or(1)]);
        for (value, state) in values.into_iter().zip(states) {
            let found = inference.expression(value).main();
            let wanted = inference.parameter(state);
            let what = format!("the {which} of `{}` must have the unit of the state", state.name);
            inference.result(&found, &wanted, &value.span, &what);
        }
    }
}

/// Returns the exponents of kg, m, s and K of a unit such as `N/m`; `None` if the text is not a unit.
///
/// ```
/// assert_eq!(energy_compiler::unit_exponents("N/m"), Some([1.0, 0.0, -2.0, 0.0]));
/// assert_eq!(energy_compiler::unit_exponents("stone"), None);
/// ```
#[must_use]
pub fn unit_exponents(unit: &str) -> Option<[f64; 4]> {
    dimension::parse(unit).ok().map(|dimension| dimension.base)
}

/// Returns whether a unit is that of a quantity rather than a plain number. Reports invalid units.
fn read(unit: &str, span: &Span, diagnostics: &mut Diagnostics) -> bool {
    if unit.is_empty() {
        return false;
    }
    match dimension::parse(unit) {
        Ok(dimension) => !dimension.is_number(),
        Err(message) => {
            let known = dimension::known();
            let help = format!("units are products, quotients and powers of {known}, as in N/m, kg m^2/s^2");
            let repeated = diagnostics.0.iter().any(|d| d.message == message);
            if !repeated {
                diagnostics.push(Diagnostic::new(span, message).help(help));
            }
            false
        }
    }
}

/// Returns the dimension of an input that is known without an equation. Points are in metres.
fn declared(input: &Input) -> Option<Dimension> {
    if !input.unit.is_empty() {
        return dimension::parse(&input.unit).ok();
    }
    match input.input_type.element {
        ElementType::Point | ElementType::Point2 | ElementType::Twist => Some(Dimension::of(LENGTH)),
        ElementType::Rotation => Some(Dimension::default()),
        ElementType::Velocity => Some(Dimension::of(VELOCITY)),
        _ => None,
    }
}
