//! Declares, compiles and runs elements with arrays, matrices and constants as inputs.

use approx::assert_relative_eq;
use energy_compiler::Textbook;
use energy_dsl::energy;
use energy_dsl::{Constraint, Element, ForceLaw, Inputs, Potential, Residual};

energy! {
    const COUNT: Scalar = 2 + 2;

    fn blend(w, x) { sum(j in 0..COUNT, w[j] * x[j]) }

    /// Points of an array are points like others; parameters of an array are nested arrays.
    energy Centre(x: [Point; COUNT]; w: [Scalar; COUNT], c: [Vec3; 2], M: Mat3x2, k: Scalar) {
        const HALF: Scalar = 1 / 2;
        let d = blend(w, x) - c[1];
        HALF * k * norm_squared(d) + dot(c[0], M * vector(x[3].x, x[COUNT - 1][1]))
    }

    force Pull(x: [Point; 2], v: [Velocity; 2]; c: Scalar) {
        let f = [c * (x[1] - x[0]), 2 * c * (v[0] - v[1])];
        [f[0] + f[1], -f[0]]
    }

    residual Fit(u: [Vec2; 2], s: Scalar; y: [Scalar; 2]) {
        [u[0].x * u[1][1] - y[0], u[1] * s, "sum(j in 0..2, y[j] u[j].y) − s"]
    }

    constraint Both(p, q: Point; a: Mat2x2) { [p - q, a * vector(p.x, q.z)] }

    energy Stretched(x: [Point; 2]; rest X: [Vec3; 2]; k: [Scalar; 1]) {
        rest { let L = [norm(X[1] - X[0]), 1]; let s = L[0] * L[1]; }
        k[0] * (norm(x[1] - x[0]) - s)^2
    }
}

const AT: [[f64; 3]; 4] = [[0.3, -0.2, 0.9], [-0.4, 0.8, 0.1], [1.5, 0.7, -0.6], [0.2, 1.1, 0.4]];

#[test]
fn arrays_of_points_and_parameters_are_indexed_and_summed() {
    let w = [0.1, 0.2, 0.3, 0.4];
    let c = [[1.0, 2.0, 3.0], [0.5, 0.25, 0.125]];
    let m = [[1.0, 2.0], [3.0, 4.0], [5.0, 6.0]];
    let centre = Centre::new(w, c, m, 8.0);
    let at = centre.gradient(&AT);
    let d: [f64; 3] = std::array::from_fn(|a| (0..4).map(|j| w[j] * AT[j][a]).sum::<f64>() - c[1][a]);
    let (x, y) = (AT[3][0], AT[3][1]);
    let linear: f64 = (0..3).map(|r| c[0][r] * (m[r][0] * x + m[r][1] * y)).sum();
    assert_relative_eq!(at.value, 4.0 * d.iter().map(|d| d * d).sum::<f64>() + linear, max_relative = 1e-14);
    assert_relative_eq!(at.gradient[2][1], 8.0 * 0.3 * d[1], max_relative = 1e-14);
    assert_relative_eq!(at.gradient[3][0], 8.0 * 0.4 * d[0] + 22.0, max_relative = 1e-14);
    let names: Vec<_> = Centre::<f64>::DECLARATION.points.iter().map(|p| (&*p.name, p.size)).collect();
    assert_eq!(names, [("x[0]", 3), ("x[1]", 3), ("x[2]", 3), ("x[3]", 3)]);
    let sizes: Vec<_> = Centre::<f64>::DECLARATION.parameters.iter().map(|p| (&*p.name, p.size)).collect();
    assert_eq!(sizes, [("w", 4), ("c", 6), ("M", 6), ("k", 1)]);
}

#[test]
fn flat_parameters_and_the_source_text_mean_the_same() {
    let parameters: Vec<f64> = (1..=17).map(f64::from).collect();
    let positions = AT.concat();
    let inputs = Inputs { parameters: &parameters, rest: &[], positions: &positions, velocities: &[] };
    let generated = Centre::<f64>::evaluate(&inputs).unwrap().blocks[0].1[0];
    // The text includes the function and the constant that it uses.
    let source = &Centre::<f64>::DECLARATION.source;
    assert!(source.contains("fn blend") && source.contains("const COUNT"), "{source}");
    assert_relative_eq!(generated, Textbook::from_source(source).unwrap().evaluate(&inputs)[0], max_relative = 1e-14);
}

#[test]
fn forces_take_arrays_of_velocities() {
    let v = [[1.0, 0.0, 0.0], [0.0, 2.0, 0.0]];
    let at = Pull::new(3.0).jacobians(&[AT[0], AT[1]], &v);
    for axis in 0..3 {
        let spring = 3.0 * (AT[1][axis] - AT[0][axis]);
        assert_relative_eq!(at.force[0][axis], spring + 6.0 * (v[0][axis] - v[1][axis]), max_relative = 1e-14);
        assert_relative_eq!(at.force[1][axis], -spring, max_relative = 1e-14);
        assert_eq!(at.by_velocity[1][axis][axis], -6.0);
    }
}

#[test]
fn residuals_and_constraints_may_list_their_rows() {
    let at = Fit::new([2.0, 3.0]).jacobian(&[1.0, 2.0, 3.0, 4.0, 5.0]);
    assert_eq!(at.value, [2.0, 15.0, 20.0, 11.0]);
    assert_eq!(at.jacobian[..5], [4.0, 0.0, 0.0, 1.0, 0.0]);
    assert_eq!(at.jacobian[15..], [0.0, 2.0, 0.0, 3.0, -1.0]);
    let both = Both::new([[1.0, 2.0], [3.0, 4.0]], 1.0, 0.0).constraint_jacobian(&[AT[0], AT[1]]);
    assert_relative_eq!(both.value[3], AT[0][0] + 2.0 * AT[1][2], max_relative = 1e-15);
    assert_eq!(both.jacobian[8][0], 3.0, "row 4 by p.x");
}

#[test]
fn arrays_may_be_rest_shape() {
    let stretched = Stretched::new([[0.0; 3], [3.0, 0.0, 4.0]], [2.0]).unwrap();
    assert_eq!(stretched.value(&[[0.0; 3], [0.0, 0.0, 6.0]]).value, 2.0);
}
