//! `include_energy!` declares the contents of a file.

use energy_dsl::include_energy;
use energy_dsl::{Constraint, Element, Potential};

include_energy!("tests/springs.energy");

#[test]
fn a_file_declares_what_a_macro_would() {
    let x = [[0.0, 0.0, 0.0], [3.0, 0.0, 4.0]];
    assert_eq!(Spring::new(8.0, 1.0).value(&x).value, 64.0);
    assert_eq!(Reference::new().value(&x).value, 50.0 + 0.15 * 25.0);
    let hinge = Hinge::new(0.5, 1.0, 0.0).constraint_jacobian(&[[2.0, 0.0, 0.0], [0.0, 0.0, 3.0]]);
    assert!((hinge.value[0] + 0.5_f64.cos()).abs() < 1e-15);
}

#[test]
fn the_text_that_a_type_carries_stands_alone() {
    let source = &Reference::<f64>::DECLARATION.source;
    assert!(source.starts_with("const REFERENCE"), "{source}");
    assert_eq!(Hinge::<f64>::DECLARATION.formula, "\\hat{a}·b̂ − cos θ₀");
    assert_eq!(Spring::<f64>::DECLARATION.docs, "A spring of rest length L.");
}
