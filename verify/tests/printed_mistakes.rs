//! Mistakes in the printed formulas for body tracking, declared as terms: what an audit of hand-written derivatives
//! would find. Each is compared with the true derivative, by dual numbers through the declared residuals; the corrected
//! formula passes the same comparison.
//!
//! `cargo test -p verify --test all printed_mistakes:: -- --nocapture` prints the table.

use energy_dsl::Residual;
use energy_dsl::energy;
use energy_elements::{BlendedMotion4, GraphEdge, HuberLoss, NonrigidPlane4, TwistMotion};

energy! {
    fn numbers(q) { [real(q).w, imaginary(real(q)), dual(q).w, imaginary(dual(q))] }

    /// A1: ∂q¹/∂α = b + α c; it must be b + α² c.
    residual PrintedSlope(θ: Vec3) {
        let n = norm(θ);
        let b = sin(n) / n;
        let c = (cos(n) - b) / n^2;
        [b + θ.x * c, b + θ.x^2 * c]
    }

    /// A9: the blend divided by the norm of all eight numbers; it must be divided by the norm of the real four.
    residual PrintedBlend(ξ: [Twist; 4]; w: [Scalar[1]; 4], v: Vec3) {
        let b = sum(k in 0..4, w[k] * exp(ξ[k]));
        let all = sqrt(norm_squared(real(b)) + norm_squared(dual(b)));
        let wrong = 1 / all * b;
        [transform(wrong, v), transform(unit(b), v)]
    }

    /// A10: point to plane with the linear blend of the text instead of the dual quaternions of its derivative.
    residual PrintedPlane(ξ: [Twist; 4]; w: [Scalar[1]; 4], v: Vec3, n: Vec3, u: Vec3) {
        let q = [exp(ξ[0]), exp(ξ[1]), exp(ξ[2]), exp(ξ[3])];
        dot(sum(k in 0..4, w[k] * rotate(q[k], n)), sum(k in 0..4, w[k] * transform(q[k], v)) - u)
    }

    /// A8: the second node of an edge with the sign of the first.
    residual PrintedEdge(ξ_i, ξ_j: Twist; x: Vec3) {
        transform(exp(ξ_i), x) + transform(exp(ξ_j), x)
    }

    /// C1: the exponential with half the angle, mistaken for the printed one.
    residual HalfExponential(ξ: Twist) {
        numbers(exp(twist(angular(ξ) / 2, linear(ξ))))
    }
}

const TWISTS: [[f64; 6]; 4] = [
    [0.3, -0.4, 0.6, 0.1, -0.4, 0.9],
    [0.5, -0.2, 0.4, 0.3, -0.1, 0.7],
    [0.2, -0.5, 0.7, 0.0, -0.3, 1.1],
    [0.4, -0.3, 0.5, 0.2, -0.2, 0.8],
];
const W: [f64; 4] = [0.4, 0.3, 0.2, 0.1];
const V: [f64; 3] = [0.7, -0.2, 1.1];
const N: [f64; 3] = [0.6, 0.0, 0.8];
const U: [f64; 3] = [0.5, 0.1, 1.9];

fn largest(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

fn finite_differences<const U: usize>(x: [f64; U], f: impl Fn(&[f64; U]) -> Vec<f64>) -> Vec<Vec<f64>> {
    (0..U)
        .map(|i| {
            let at = |step: f64| {
                let mut moved = x;
                moved[i] += step;
                f(&moved)
            };
            at(1e-6).iter().zip(at(-1e-6)).map(|(ahead, behind)| (ahead - behind) / 2e-6).collect()
        })
        .collect()
}

#[test]
fn printed_mistakes_are_caught() {
    let mut table: Vec<(&str, f64, f64)> = Vec::new();
    let all: [f64; 24] = TWISTS.as_flattened().try_into().unwrap();

    // A1, against the generated ∂q¹/∂α.
    let truth = TwistMotion::new(1.0).jacobian(&TWISTS[0]).jacobian[6];
    let [printed, right] = PrintedSlope::<f64>::new().residual(&[0.3, -0.4, 0.6]).value;
    table.push(("A1  ∂q¹/∂α = b + α c", (printed - truth).abs(), (right - truth).abs()));

    // A2, rows labelled ∂/∂t_x instead of ∂/∂t_z: columns of the generated Jacobian.
    let jacobian = TwistMotion::new(1.0).jacobian(&TWISTS[0]).jacobian;
    let column = |c: usize| (0..8).map(|row| jacobian[6 * row + c]).collect::<Vec<f64>>();
    let by_z = finite_differences(TWISTS[0], |x| TwistMotion::new(1.0).residual(x).value.to_vec())[5].clone();
    table.push(("A2  ∂/∂t_x for ∂/∂t_z", largest(&column(3), &by_z), largest(&column(5), &by_z)));

    // A3, tr(∂f/∂T ∂T/∂t_x) without the transpose: the derivative of T's last column by t_x is the first axis, so the
    // printed trace is 0.
    let plane = NonrigidPlane4::new(1.0, W, V, N, U);
    let single = NonrigidPlane4::new(1.0, [1.0, 0.0, 0.0, 0.0], V, N, U).jacobian(&all);
    let by_t =
        finite_differences(all, |x| vec![NonrigidPlane4::new(1.0, [1.0, 0.0, 0.0, 0.0], V, N, U).residual(x).value[0]]);
    table.push(("A3  tr(AB) for tr(AᵀB), by t_x", by_t[3][0].abs(), (single.jacobian[3] - by_t[3][0]).abs()));

    // A5, ∂E/∂α = ∂f/∂α: the gradient of E = f² is 2 f ∂f/∂α.
    let at = plane.jacobian(&all);
    let energy = finite_differences(all, |x| vec![plane.residual(x).value[0].powi(2)]);
    let truth: Vec<f64> = energy.iter().map(|row| row[0]).collect();
    let doubled: Vec<f64> = at.jacobian.iter().map(|j| 2.0 * at.value[0] * j).collect();
    table.push(("A5  ∂E/∂α = ∂f/∂α", largest(&at.jacobian, &truth), largest(&doubled, &truth)));

    // A7, a fourth residual of 1 per edge; A8, its sign.
    let edge: [f64; 12] = all[..12].try_into().unwrap();
    let (printed, right) = (PrintedEdge::<f64>::new(V), GraphEdge::new(1.0, V));
    let truth = finite_differences(edge, |x| right.residual(x).value.to_vec());
    let columns = |jacobian: &[f64]| {
        (0..12).flat_map(|c| (0..3).map(move |r| (r, c))).map(|(r, c)| jacobian[12 * r + c]).collect::<Vec<f64>>()
    };
    let (wrong, good) = (columns(&printed.jacobian(&edge).jacobian), columns(&right.jacobian(&edge).jacobian));
    table.push(("A8  ∂h/∂ξ_j with the sign of ξ_i", largest(&wrong, &truth.concat()), largest(&good, &truth.concat())));
    let homogeneous = right.residual(&edge).value.iter().map(|h| h * h).sum::<f64>();
    table.push(("A7  h = (h_x, h_y, h_z, 1)", (homogeneous + 1.0) - homogeneous, 0.0));

    // A9, the norm of eight numbers.
    let blended = BlendedMotion4::new(1.0, W, V, N).residual(&all).value;
    let both = PrintedBlend::<f64>::new(W, V).residual(&all).value;
    table.push((
        "A9  b over the norm of all eight",
        largest(&both[..3], &blended[16..19]),
        largest(&both[3..], &blended[16..19]),
    ));

    // A10, the linear blend of the energy with the derivative for dual quaternions.
    let linear = PrintedPlane::<f64>::new(W, V, N, U);
    let truth = finite_differences(all, |x| linear.residual(x).value.to_vec()).concat();
    table.push((
        "A10 derivative of the other blend",
        largest(&at.jacobian, &truth),
        largest(&linear.jacobian(&all).jacobian, &truth),
    ));

    // A12, ρ(s) as a weight: 0 where the weight must be 1.
    let printed: f64 = HuberLoss::new(0.2).residual(&[0.0]).value[0];
    table.push(("A12 ψ = ρ(s) at s = 0", (printed - 1.0).abs(), 0.0));

    // A15, JᵀJ d = Jᵀr: the step leads uphill.
    let slope: f64 = at.jacobian.iter().map(|j| j * at.value[0] * j * at.value[0]).sum();
    table.push(("A15 JᵀJ d = +Jᵀr: slope of E along d", slope, (-slope).max(0.0)));

    // C1, half the angle.
    let truth = finite_differences(TWISTS[0], |x| TwistMotion::new(1.0).residual(x).value.to_vec());
    let rows = |jacobian: &[f64]| {
        (0..6).flat_map(|c| (0..8).map(move |r| (r, c))).map(|(r, c)| jacobian[6 * r + c]).collect::<Vec<f64>>()
    };
    let half = rows(&HalfExponential::<f64>::new().jacobian(&TWISTS[0]).jacobian);
    table.push(("C1  half the angle", largest(&half, &truth.concat()), largest(&rows(&jacobian), &truth.concat())));

    println!("{:<40} {:>12} {:>12}", "printed", "error", "corrected");
    for (name, printed, right) in &table {
        println!("{name:<40} {printed:>12.1e} {right:>12.1e}");
    }
    for (name, printed, right) in &table {
        assert!(*printed > 1e-3, "{name}: the mistake was not noticed ({printed:e})");
        assert!(*right < 1e-7, "{name}: the corrected form is wrong too ({right:e})");
    }
}
