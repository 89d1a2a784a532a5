//! Text descriptions of the declared elements.

use std::fmt::Write as _;

use energy_dsl::{Declaration, Field, OperationCount};

/// Describes every declared element: name, kind, formula, inputs with units, and operations per routine.
#[must_use]
pub fn listing() -> String {
    let entries: Vec<String> = energy_elements::catalogue().iter().map(|entry| describe(entry.declaration)).collect();
    entries.join("\n")
}

/// Describes one declared element.
///
/// ```
/// let spring = energy_elements::find("HookeSpring").unwrap();
/// let text = cloth_core::materials::describe(spring.declaration);
/// assert!(text.starts_with("HookeSpring (energy)") && text.contains("K [N/m]"));
/// ```
#[must_use]
pub fn describe(declaration: &Declaration) -> String {
    let mut text = format!("{} ({})\n", declaration.name, declaration.kind.keyword());
    let first_paragraph = declaration.docs.trim().split("\n\n").next().unwrap_or_default();
    let row = |text: &mut String, name: &str, value: &str| {
        if !value.is_empty() {
            writeln!(text, "  {name:<11} {value}").expect("writing to a string succeeds");
        }
    };
    row(&mut text, "", &first_paragraph.split_whitespace().collect::<Vec<_>>().join(" "));
    row(&mut text, "formula", declaration.formula);
    row(&mut text, "points", &names(declaration.points));
    row(&mut text, "rest", &names(declaration.rest));
    row(&mut text, "parameters", &names(declaration.parameters));
    for routine in declaration.routines {
        let value = format!("{:<10} {}", routine.name, operations(&routine.full, &routine.reduced));
        row(&mut text, "operations", &value);
    }
    text
}

fn operations(full: &OperationCount, reduced: &OperationCount) -> String {
    let parts = [
        (full.basic, "basic"),
        (2 * full.fused, "in fused multiply-adds"),
        (full.divisions_and_roots, "divisions and roots"),
        (full.transcendental, "transcendental"),
        (full.error_terms, "error terms"),
    ];
    let parts: Vec<String> =
        parts.iter().filter(|(count, _)| *count > 0).map(|(count, name)| format!("{count} {name}")).collect();
    let before = if reduced == full { String::new() } else { format!("; {} in reduced coordinates", reduced.total()) };
    format!("{:>5}  ({}{before})", full.total(), parts.join(", "))
}

fn names(fields: &[Field]) -> String {
    let one = |field: &Field| {
        if field.unit.is_empty() { field.name.to_owned() } else { format!("{} [{}]", field.name, field.unit) }
    };
    fields.iter().map(one).collect::<Vec<_>>().join(", ")
}
