//! Constants and fixed parameters fold: the parts that they switch off leave no operations.

use energy_compiler::Textbook;
use energy_dsl::energy;
use energy_dsl::{Constraint, Element, Inputs, Potential};

energy! {
    const NONE: Scalar = 0;

    energy Both(p, q: Point; k, b: Scalar) { k * norm_squared(p - q) + b * norm(p - q)^3 }

    /// Without its second term.
    energy First = Both(b = NONE);
    energy Plain(p, q: Point; k: Scalar) { k * norm_squared(p - q) }
    energy Unit = First(k = 1);
    energy Bare(p, q: Point) { norm_squared(p - q) }

    energy Switched(p, q: Point; k: Scalar) {
        const POWER: Scalar = 1 + 1;
        const DAMPED: Scalar = NONE;
        if DAMPED > 0 || POWER == 3 { exp(norm(p - q)) } else { k * norm(p - q)^POWER }
    }

    energy Squared(p, q: Point; k: Scalar) { k * norm(p - q)^2 }

    constraint Taut = Rope(L = 0.5);
    constraint Rope(p, q: Point; L: Scalar[m], s: Scalar) = "s (‖p − q‖ − L)";
}

fn operations<E: Element>() -> Vec<usize> {
    E::DECLARATION.routines.iter().map(|r| r.full.total()).collect()
}

const X: [[f64; 3]; 2] = [[0.0, 0.0, 0.0], [3.0, 0.0, 4.0]];

#[test]
fn what_a_constant_switches_off_leaves_no_operations() {
    assert_eq!(operations::<First>(), operations::<Plain>());
    assert_eq!(operations::<Unit>(), operations::<Bare>());
    assert_eq!(operations::<Switched>(), operations::<Squared>());
    assert!(operations::<Both>().iter().zip(operations::<First>()).all(|(both, first)| *both > first));
    assert!(First::<f64>::DECLARATION.primitives.is_empty(), "the norm went with the term");
}

#[test]
fn fixed_parameters_are_no_fields() {
    assert_eq!(First::new(2.0).value(&X).value, 50.0);
    assert_eq!(Unit::<f64>::new().value(&X).value, 25.0);
    assert_eq!(Switched::new(2.0).value(&X).value, 50.0);
    assert_eq!(Taut::new(2.0, 1.0, 0.0).constraint_jacobian(&X).value, [9.0]);
    let names: Vec<_> = Taut::<f64>::DECLARATION.parameters.iter().map(|p| &*p.name).collect();
    assert_eq!(names, ["s"]);
    assert!(First::<f64>::DECLARATION.docs.contains("b = NONE"));
}

#[test]
fn the_text_of_a_specialised_declaration_stands_alone() {
    let textbook = Textbook::from_source(&Unit::<f64>::DECLARATION.source).unwrap();
    let positions = X.concat();
    let inputs = Inputs { parameters: &[], rest: &[], positions: &positions, velocities: &[] };
    assert_eq!(textbook.evaluate(&inputs), [25.0]);
}
