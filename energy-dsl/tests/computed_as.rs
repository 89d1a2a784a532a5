//! Numbers that are computed by another expression than the one that defines them.

use approx::assert_relative_eq;
use energy_dsl::energy;
use energy_dsl::{ForceLaw, Potential};

energy! {
    fn gap(p, q, k) { computed_as(norm_squared(q - p) - k^2, (norm(q - p) - k) * (norm(q - p) + k)) }

    energy Sound(p, q: Point; k: Scalar) { gap(p, q, k)^3 }

    energy Plain(p, q: Point; k: Scalar) { (norm_squared(q - p) - k^2)^3 }

    force Pull(p, q: Point; k: Scalar) {
        let u = gap(p, q, k)^3;
        [-gradient(u, p), -gradient(u, q)]
    }

    // Both sides differ, to tell which is used.
    energy Mixed(p, q: Point; k: Scalar) {
        let s = norm_squared(q - p);
        if k < 1 { computed_as(2 * s, 3 * s) } else { 0 }
    }

    force MixedPull(p, q: Point; k: Scalar) {
        let s = norm_squared(q - p);
        let u = k * computed_as(2 * s, 3 * s);
        [-gradient(u, p), -gradient(u, q)]
    }

    energy ByValue(p, q: Point; k: Scalar) {
        let s = norm_squared(q - p);
        k * valued_as(2 * s, 3 * s)
    }

    // Conditions and products around it, and one in another.
    energy Nested(p, q: Point; k: Scalar) {
        let j = gap(p, q, k);
        let u = computed_as(norm_squared(q - p)^2 - 2 * norm_squared(q - p) * k^2 + k^4, j^2);
        if j > 0 { u * j } else { -u * j }
    }
}

const P: [[f64; 3]; 2] = [[0.3, -0.2, 0.9], [0.5, 0.1, 0.4]];

#[test]
fn all_derivatives_are_those_of_the_plain_formula() {
    let [sound, plain] = [Sound::new(0.4).hessian(&P), Plain::new(0.4).hessian(&P)];
    assert_relative_eq!(sound.value, plain.value, max_relative = 1e-13);
    for (a, b) in sound.gradient.as_flattened().iter().zip(plain.gradient.as_flattened()) {
        assert_relative_eq!(a, b, max_relative = 1e-13);
    }
    for (a, b) in sound.hessian.as_flattened().as_flattened().iter().zip(plain.hessian.as_flattened().as_flattened()) {
        assert_relative_eq!(a, b, max_relative = 1e-12);
    }
    let product = Sound::new(0.4).hessian_vector(&P, &[[1.0, 0.0, 0.0], [0.0, 0.0, 0.0]]);
    assert_relative_eq!(product.product[0][1], plain.hessian[0][1][0], max_relative = 1e-12);
}

#[test]
fn near_zero_the_value_keeps_its_digits() {
    // ‖d‖² − k² = 2⁻⁵⁰ (2 + 2⁻⁵⁰), of which the plain formula keeps nothing but the first digits.
    let tiny = 1.0 / (1_u64 << 50) as f64;
    let x = [[0.0; 3], [1.0 + tiny, 0.0, 0.0]];
    let expected = (tiny * (2.0 + tiny)).powi(3);
    assert_relative_eq!(Sound::new(1.0).value(&x).value, expected, max_relative = 1e-15);
}

#[test]
fn the_value_and_the_gradient_are_of_one_and_the_curvature_of_the_other() {
    let d: Vec<f64> = (0..3).map(|i| P[1][i] - P[0][i]).collect();
    let mixed = Mixed::new(0.5).hessian(&P);
    assert_relative_eq!(mixed.value, 3.0 * d.iter().map(|x| x * x).sum::<f64>(), max_relative = 1e-15);
    assert_relative_eq!(mixed.gradient[1][2], 6.0 * d[2], max_relative = 1e-15);
    assert_relative_eq!(mixed.hessian[0][0][0], 4.0, max_relative = 1e-15);
    let by_value = ByValue::new(1.0).hessian(&P);
    assert_relative_eq!(by_value.value, 3.0 * d.iter().map(|x| x * x).sum::<f64>(), max_relative = 1e-15);
    assert_relative_eq!(by_value.gradient[1][2], 4.0 * d[2], max_relative = 1e-15);
    assert_relative_eq!(by_value.hessian[0][0][0], 4.0, max_relative = 1e-15);
    assert_relative_eq!(ByValue::new(1.0).gradient(&P).gradient[1][2], 4.0 * d[2], max_relative = 1e-15);
    assert_relative_eq!(Mixed::new(0.5).gradient(&P).gradient[1][2], 6.0 * d[2], max_relative = 1e-15);
}

#[test]
fn a_force_that_is_a_gradient_has_the_negative_hessian() {
    let (force, energy) = (Pull::new(0.4), Sound::new(0.4).hessian(&P));
    let jacobians = force.jacobians(&P, &[[0.0; 3]; 2]);
    for point in 0..2 {
        for axis in 0..3 {
            assert_relative_eq!(jacobians.force[point][axis], -energy.gradient[point][axis], max_relative = 1e-13);
        }
    }
    for row in 0..3 {
        for column in 0..3 {
            let (found, expected) = (jacobians.by_position[0][row][column], -energy.hessian[0][row][column]);
            assert_relative_eq!(found, expected, max_relative = 1e-12);
        }
    }
    let mixed = MixedPull::new(1.0).jacobians(&P, &[[0.0; 3]; 2]);
    assert_relative_eq!(mixed.force[0][0], 6.0 * (P[1][0] - P[0][0]), max_relative = 1e-15);
    assert_relative_eq!(mixed.by_position[0][0][0], -4.0, max_relative = 1e-15);
}

#[test]
fn one_may_stand_in_another() {
    // u j = j³ for j > 0.
    let [nested, plain] = [Nested::new(0.4).hessian(&P), Plain::new(0.4).hessian(&P)];
    assert_relative_eq!(nested.value, plain.value, max_relative = 1e-13);
    assert_relative_eq!(nested.gradient[0][1], plain.gradient[0][1], max_relative = 1e-13);
    for (a, b) in nested.hessian[1].iter().flatten().zip(plain.hessian[1].iter().flatten()) {
        assert_relative_eq!(a, b, max_relative = 1e-12);
    }
}
