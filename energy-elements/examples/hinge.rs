//! Evaluates a hinge of the library and prints its declaration: `cargo run -p energy-elements --example hinge`.

use energy_dsl::{Element, Potential};
use energy_elements::QuadraticHinge;

fn main() {
    // Two triangles on the edge x₃x₄, folded by a right angle.
    let x = [[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [0.0; 3], [1.0, 0.0, 0.0]];
    let hinge: QuadraticHinge = QuadraticHinge::new(2.0, 0.0);
    let at = hinge.gradient(&x);
    println!("energy of a right angle: {:.6} J", at.value);
    println!("force on x1: {:?} N", at.gradient[0].map(|g| -g));

    let declaration = QuadraticHinge::<f64>::DECLARATION;
    println!("declared as: {}", declaration.formula);
    println!("reduced coordinates: {}", declaration.reduced_coordinates);
    assert!((at.value - 2.0 * std::f64::consts::FRAC_PI_2.powi(2)).abs() < 1e-12);
}
