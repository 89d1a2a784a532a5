//! Declares, compiles and runs the four kinds of declaration.

use approx::assert_relative_eq;
use energy_compiler::Textbook;
use energy_dsl::energy;
use energy_dsl::{Constraint, Element, Flags, ForceLaw, Inputs, Mask, Number, Potential, Residual};

energy! {
    fn spring_energy(k, C) { k / 2 * C^2 }

    /// Two springs in a row, through a function shared by declarations.
    energy Chain(p, q, r: Point; k, L: Scalar) {
        spring_energy(k, norm(q - p) - L) + spring_energy(2 * k, norm(r - q) - L)
    }

    constraint Midpoint(p, q, m: Point) { (p + q) / 2 - m }

    force Swirl(p, q: Point, v, w: Velocity; c: Scalar, axis: Vec3) {
        let turn = cross(axis, v - w) * exp(-norm_squared(p - q));
        [c * turn, -c * turn]
    }

    residual Line(offset: Vec2, slope, bend: Scalar; t: Scalar) {
        vector(dot(offset, vector(1, t)) - slope, sin(slope * t), max(bend, slope)^2)
    }

    residual Aimed(scale: Scalar; target: Point) { scale * target }

    energy Soft(p: Point; k: Scalar) {
        let r = norm_squared(p);
        if r < 1 { k * r } else { k * (2 * sqrt(r) - 1) }
    }

    // Its condition tells where a is.
    energy Sided(a, b: Point; k: Scalar) {
        let s = norm_squared(b - a);
        if a.y > 0 { k * s } else { 2 * k * s }
    }

    energy Stretch(x0, x1: Point; rest X0, X1: Point; k: Scalar) {
        rest { let L = norm(X1 - X0); let per_length = 1 / L; }
        k / 2 * per_length * (norm(x1 - x0) - L)^2
    }
}

const P: [f64; 3] = [0.3, -0.2, 0.9];
const Q: [f64; 3] = [-0.4, 0.8, 0.1];
const R: [f64; 3] = [1.5, 0.7, -0.6];

fn distance(a: [f64; 3], b: [f64; 3]) -> f64 {
    (0..3).map(|i| (a[i] - b[i]).powi(2)).sum::<f64>().sqrt()
}

#[test]
fn functions_are_shared_between_declarations() {
    let chain = Chain::new(3.0, 0.5);
    let expected = 1.5 * (distance(P, Q) - 0.5).powi(2) + 3.0 * (distance(Q, R) - 0.5).powi(2);
    assert_relative_eq!(chain.value(&[P, Q, R]).value, expected, max_relative = 1e-15);
    let declaration = <Chain as Element>::DECLARATION;
    assert!(declaration.translation_invariant);
    assert_eq!(declaration.reduced_coordinates, 6, "two differences of three points");
}

#[test]
fn sums_of_points_are_reduced_coordinates() {
    let midpoint = <Midpoint as Element>::DECLARATION;
    assert_eq!(midpoint.reduced_coordinates, 3, "one sum of three points");
    let weights: Vec<&[(usize, f64)]> = midpoint.reduced_vectors.iter().map(|points| &**points).collect();
    assert_eq!(weights, [[(0, 0.5), (1, 0.5), (2, -1.0)]]);
    assert!(midpoint.translation_invariant);
    let sided = <Sided as Element>::DECLARATION;
    assert!(sided.reduced_coordinates == 3 && !sided.translation_invariant);
}

#[test]
fn points_after_the_unknowns_are_parameters() {
    let aimed = Aimed::new(P);
    assert_eq!(<Aimed as Element>::DECLARATION.points.len(), 1, "one unknown");
    assert_eq!(aimed.residual(&[2.0]).value, P.map(|x| 2.0 * x));
}

#[test]
fn vector_constraints_pull_towards_zero() {
    let midpoint = Midpoint::new(10.0, 0.5);
    let at = midpoint.constraint_jacobian(&[P, Q, R]);
    for axis in 0..3 {
        assert_relative_eq!(at.value[axis], (P[axis] + Q[axis]) / 2.0 - R[axis], max_relative = 1e-15);
        assert_eq!(at.jacobian[3 * axis + 2][axis], -1.0);
    }
    let v = [[1.0, 0.0, 0.0], [0.0, 2.0, 0.0], [0.0, 0.0, 3.0]];
    let force = midpoint.force(&[P, Q, R], &v).force;
    for axis in 0..3 {
        let rate = (v[0][axis] + v[1][axis]) / 2.0 - v[2][axis];
        assert_relative_eq!(force[2][axis], 10.0 * at.value[axis] + 0.5 * rate, max_relative = 1e-14);
    }
    let (newton, gauss) = (midpoint.hessian(&[P, Q, R]), midpoint.gauss_newton(&[P, Q, R]));
    assert_eq!(newton.hessian, gauss.hessian, "a linear constraint has no second derivatives");
}

#[test]
fn forces_see_positions_and_velocities() {
    let swirl = Swirl::new(2.0, [0.1, 0.2, 0.3]);
    let (v, w) = ([0.5, -1.0, 0.25], [1.0, 1.0, -2.0]);
    let h = 1e-6;
    let jacobians = swirl.jacobians(&[P, Q], &[v, w]);
    for point in 0..2 {
        for axis in 0..3 {
            let moved = |sign: f64| {
                let (mut x, mut u) = ([P, Q], [v, w]);
                x[point][axis] += sign * h;
                let by_x = swirl.force(&x, &u).force;
                x[point][axis] -= sign * h;
                u[point][axis] += sign * h;
                (by_x, swirl.force(&x, &u).force)
            };
            let (plus, minus) = (moved(1.0), moved(-1.0));
            for i in 0..2 {
                for row in 0..3 {
                    let by_x = (plus.0[i][row] - minus.0[i][row]) / (2.0 * h);
                    let by_v = (plus.1[i][row] - minus.1[i][row]) / (2.0 * h);
                    assert_relative_eq!(jacobians.by_position[2 * i + point][row][axis], by_x, epsilon = 1e-9);
                    assert_relative_eq!(jacobians.by_velocity[2 * i + point][row][axis], by_v, epsilon = 1e-9);
                }
            }
        }
    }
}

#[test]
fn residuals_have_unknowns_that_are_not_points() {
    let line = Line::new(0.7);
    let at = line.jacobian(&[1.0, 2.0, 0.4, 0.3]);
    assert_relative_eq!(at.value[0], 1.0 + 2.0 * 0.7 - 0.4, max_relative = 1e-15);
    let expected = [[1.0, 0.7, -1.0, 0.0], [0.0, 0.0, 0.7 * (0.4_f64 * 0.7).cos(), 0.0], [0.0, 0.0, 0.8, 0.0]];
    for (found, expected) in at.jacobian.iter().zip(expected.as_flattened()) {
        assert_relative_eq!(*found, *expected, max_relative = 1e-15);
    }
}

#[test]
fn branches_choose_value_and_derivatives() {
    let soft = Soft::new(2.0);
    let inside = soft.hessian(&[[0.5, 0.0, 0.0]]);
    assert_eq!((inside.value, inside.gradient[0][0], inside.hessian[0][0][0]), (0.5, 2.0, 4.0));
    let outside = soft.hessian(&[[2.0, 0.0, 0.0]]);
    assert_eq!((outside.value, outside.gradient[0][0], outside.hessian[0][0][0]), (6.0, 4.0, 0.0));
    let origin = soft.hessian(&[[0.0; 3]]);
    assert_eq!(origin.hessian[0][0][0], 4.0, "the branch not taken is singular here, and leaves no trace");
}

#[test]
fn a_rest_shape_is_read_once_and_refused_when_degenerate() {
    let (a, b) = ([0.0; 3], [3.0, 0.0, 4.0]);
    let stretch = Stretch::new(a, b, 4.0).unwrap();
    assert_eq!(stretch.gradient(&[a, b]).gradient, [[0.0; 3]; 2], "at rest there is no force");
    let error = Stretch::new(P, P, 4.0).unwrap_err();
    assert!(error.to_string().contains("Stretch") && error.to_string().contains("degenerate"), "{error}");
    assert!(Stretch::new([f64::NAN, 0.0, 0.0], P, 4.0).is_err());
}

#[test]
fn the_source_a_type_carries_means_what_the_type_computes() {
    let textbook = Textbook::from_source(&<Stretch as Element>::DECLARATION.source).unwrap();
    let rest = [0.0, 0.0, 0.0, 0.0, 2.0, 0.0];
    let positions = [P, Q].concat();
    let inputs = Inputs { parameters: &[4.0], rest: &rest, positions: &positions, velocities: &[] };
    let generated = Stretch::<f64>::evaluate(&inputs).unwrap();
    assert_relative_eq!(generated.blocks[0].1[0], textbook.evaluate(&inputs)[0], max_relative = 1e-14);
}

#[test]
fn generated_code_runs_over_single_precision_and_any_other_number() {
    let single = Chain::new(3.0_f32, 0.5).value(&[P, Q, R].map(|p| p.map(|c| c as f32)));
    assert_relative_eq!(f64::from(single.value), Chain::new(3.0, 0.5).value(&[P, Q, R]).value, max_relative = 1e-6);
    let flags = Flags::<f64>::clear();
    assert!(!flags.any() && !Mask::any(flags.kink) && !1.0_f64.less(0.5));
}

/// With p pinned, only the block of q with itself is left of three.
#[test]
fn blocks_of_pinned_points_are_left_out() {
    use energy_dsl::{Baseline, ReducedPotential};

    let (chain, x) = (Chain::new(5.0, 0.5), [P, Q, R]);
    let (free, whole) = (chain.hessian_free_at::<Baseline, 0b110>(&x), chain.hessian(&x));
    assert_eq!(free.hessian[3..], whole.hessian[3..]);
    assert_eq!(free.hessian[..3], [[[0.0; 3]; 3]; 3]);
}
