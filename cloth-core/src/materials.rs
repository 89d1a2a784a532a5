//! The elements that simulations are made of, and text descriptions of all declared elements.

use std::fmt::Write as _;

use energy_dsl::{AnyElement, Declaration, Field, OperationCount};

macro_rules! entries {
    ($($name:ident),* $(,)?) => { &[$(AnyElement::of::<energy_elements::$name<f64>>()),*] };
}

/// The elements of the library that terms of a simulation evaluate, in alphabetical order. Audits of simulations read
/// this table; the whole catalogue would compile elements that no simulation has.
// A static: each crate that uses a constant compiles its functions again.
pub static ELEMENTS: &[AnyElement] = entries![
    ArcAngle,
    AsRigidAsPossible,
    BaraffWitkinShear,
    BaraffWitkinStretch,
    BoxContact,
    BridsonBending,
    BridsonForce,
    BridsonForceDamped,
    CapsuleContact,
    CurledHair,
    DistanceBarrier,
    FlatBending,
    Gravity,
    HairBend,
    HingeRateDissipation,
    HookeSpring,
    NeoHookean,
    OrthotropicStVK,
    PlaneContact,
    Pressure,
    SlidingFriction,
    SphereContact,
    Spring,
    StVK,
    StableNeoHookean,
    StableNeoHookeanLog,
    StrainRateDissipation,
    ThreadLimit,
    ViscousDrag,
    WindDrag,
    YarnMembrane,
    ZeroLengthSpring,
];

/// Returns the element of [`ELEMENTS`] with this name.
#[must_use]
pub fn element(name: &str) -> Option<&'static AnyElement> {
    ELEMENTS.iter().find(|entry| entry.declaration.name == name)
}

/// Describes every declared element: name, kind, formula, inputs with units, and operations per routine.
#[must_use]
pub fn listing() -> String {
    let entries: Vec<String> = energy_elements::DECLARATIONS.iter().map(|declaration| describe(declaration)).collect();
    entries.join("\n")
}

/// Describes one declared element.
///
/// ```
/// let spring = cloth_core::materials::element("HookeSpring").unwrap();
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
    row(&mut text, "formula", &declaration.formula);
    row(&mut text, "points", &names(&declaration.points));
    row(&mut text, "rest", &names(&declaration.rest));
    row(&mut text, "parameters", &names(&declaration.parameters));
    for routine in &*declaration.routines {
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
        if field.unit.is_empty() { field.name.to_string() } else { format!("{} [{}]", field.name, field.unit) }
    };
    fields.iter().map(one).collect::<Vec<_>>().join(", ")
}
