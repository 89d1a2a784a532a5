//! Second derivatives of each element of the library take little more than those of its printed formula without
//! compensation of rounding errors.

use energy_compiler::Interpreted;
use energy_dsl::Declaration;

use crate::catalogue::ELEMENTS;

/// Printed formulas of the elements that are computed differently.
const PRINTED: &str = include_str!("data/printed.energy");

/// The operations of an element over those of its printed formula.
const MOST: f64 = 1.3;

/// Elements that take more, how much, and why.
const EXCUSED: [(&str, f64, &str); 7] = [
    ("HookeSpring", 1.7, "nine error terms beside 35 operations keep the last digits of a strain of 1e-12"),
    ("Spring", 1.7, "as HookeSpring"),
    ("SphereContact", 1.4, "the same nine terms, of the distance"),
    ("AsRigidAsPossible", 1.55, "the gradient of (s₁ − 1)² + (s₂ − 1)² that does not cancel at rest"),
    ("StableNeoHookeanLog", 1.45, "the gradient of (s₁ − s₂)², and ln(1 + x) − x"),
    ("NeoHookean", 1.6, "the same, near rest and far from it"),
    ("TetStableNeoHookean", 1.55, "the gradient of the invariants of FᵀF − 1, near rest and far from it"),
];

/// Returns the operations of the Hessian in reduced coordinates, or of the Jacobians of a force.
fn operations(declaration: &Declaration) -> Option<usize> {
    let is_last = |name: &str| matches!(name, "hessian" | "constraint_hessian" | "jacobians");
    declaration.routines.iter().find(|routine| is_last(routine.name)).map(|routine| routine.reduced.total())
}

fn uncompensated(source: &str) -> Declaration {
    let kinds = ["energy", "constraint", "force"].map(|kind| format!("{kind} "));
    let start = kinds.iter().filter_map(|kind| source.find(kind)).min().expect("a declaration");
    let source = format!("#[uncompensated]\n{}", &source[start..]);
    let elements = Interpreted::from_source(&source).unwrap_or_else(|e| panic!("{source}\n{e}"));
    Declaration::clone(elements[0].declaration())
}

#[test]
fn elements_take_little_more_than_their_printed_formulas() {
    let printed = Interpreted::from_source(PRINTED).expect("sound formulas");
    let mut wrong = Vec::new();
    for entry in ELEMENTS {
        let declaration = entry.declaration;
        let Some(count) = operations(declaration) else { continue };
        let other = printed.iter().map(Interpreted::declaration).find(|other| other.name == declaration.name);
        let formula = uncompensated(other.map_or(&declaration.source, |other| &other.source));
        let least = operations(&formula).expect("the same kind");
        let ratio = count as f64 / least as f64;
        println!("{:24} {count:5} {least:5} {ratio:.2}", declaration.name);
        let excuse = EXCUSED.iter().find(|(name, ..)| *name == declaration.name);
        match excuse {
            Some((name, most, _)) if ratio > *most => wrong.push(format!("{name}: {ratio:.2}, more than {most}")),
            Some((name, ..)) if ratio <= MOST => wrong.push(format!("{name}: {ratio:.2} needs no excuse")),
            None if ratio > MOST => wrong.push(format!("{}: {ratio:.2}, more than {MOST}", declaration.name)),
            _ => {}
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}
