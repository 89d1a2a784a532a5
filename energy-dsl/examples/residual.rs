//! Fits a parabola by Gauss–Newton with generated Jacobians: `cargo run -p energy-dsl --example residual`.

use energy_dsl::{Residual, energy};

energy! {
    /// The error of a measurement y at x for the model y = a x + b x².
    pub residual Parabola(a: Scalar, b: Scalar; x: Scalar, y: Scalar) { a * x + b * x^2 - y }
}

fn main() {
    let data = [0.0, 1.0, 2.0, 3.0].map(|x| Parabola::new(x, 2.0 * x - 0.5 * x * x));
    let [mut a, mut b] = [0.0_f64; 2];
    for step in 0..3 {
        // The normal equations JᵀJ d = −Jᵀr of two unknowns.
        let (mut m, mut g) = ([[0.0; 2]; 2], [0.0; 2]);
        for point in &data {
            let at = point.jacobian(&[a, b]);
            for i in 0..2 {
                g[i] += at.jacobian[i] * at.value[0];
                for j in 0..2 {
                    m[i][j] += at.jacobian[i] * at.jacobian[j];
                }
            }
        }
        let det = m[0][0] * m[1][1] - m[0][1] * m[1][0];
        a -= (m[1][1] * g[0] - m[0][1] * g[1]) / det;
        b -= (m[0][0] * g[1] - m[1][0] * g[0]) / det;
        println!("step {step}: a = {a:.6}, b = {b:.6}");
    }
    assert!((a - 2.0).abs() < 1e-12 && (b + 0.5).abs() < 1e-12);
}
