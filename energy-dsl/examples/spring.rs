//! Declares a spring, evaluates it, and checks the result: `cargo run -p energy-dsl --example spring`.

use energy_dsl::{Potential, energy};

energy! {
    /// A spring of stiffness k and rest length L.
    pub energy Spring(p, q: Point; k: Scalar[N/m], L: Scalar[m]) = "k/2 (‖p − q‖ − L)²";
}

fn main() {
    let spring: Spring = Spring::new(8.0, 1.0);
    let at = spring.hessian(&[[0.0, 0.0, 0.0], [3.0, 0.0, 4.0]]);
    println!("energy    {} J", at.value);
    println!("force on q {:?} N", at.gradient[1].map(|g| -g));
    // The length is 5 m, so the energy is 8/2 · (5 − 1)² J.
    assert_eq!(at.value, 64.0);
}
