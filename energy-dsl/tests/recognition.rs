//! Naive and robust spellings compile to the same primitives, the same operations and the same bits.

use energy_compiler::compile;
use energy_dsl::Potential;
use energy_dsl::energy;

/// Returns the primitives and the operation counts of a formula of vectors and numbers.
fn plan(formula: &str) -> String {
    let source = format!(
        "energy Test(p, q, r: Point; k, δ: Scalar) {{
            let a = q - p;
            let b = r - q;
            let x = dot(p, q);
            let y = dot(q, r);
            k * norm(a) * norm(b) * (x + y) * δ + {formula}
        }}"
    );
    plan_of(&source)
}

/// Returns the same for a residual of a motion Q (a unit dual quaternion), of vectors n, v and u, and of a quaternion h
/// of any length.
fn plan_of_motion(formula: &str) -> String {
    plan_of(&format!(
        "residual Test(ξ: [Twist; 2]; w: [Scalar; 2], h: Quat, n, v, u: Vec3) {{
            let Q = unit(sum(j in 0..2, w[j] * exp(ξ[j])));
            dot(n, u) * dot(v, u) * real(h) * real(real(Q)) + ({formula})
        }}"
    ))
}

fn plan_of(source: &str) -> String {
    let code = compile(source.parse().unwrap()).to_string();
    assert!(!code.contains("compile_error"), "{source}");
    let (_, plan) = code.split_once("primitives :").unwrap();
    plan.split_once("} ;").unwrap().0.to_owned()
}

#[test]
fn naive_and_robust_spellings_are_the_same_code() {
    for (naive, robust) in [
        ("log(1 + x)", "log1p(x)"),
        ("log(x + 1)", "log1p(x)"),
        ("log(1 - x)", "log1p(-x)"),
        ("(exp(x) - 1)", "expm1(x)"),
        ("(1 - exp(x))", "(-expm1(x))"),
        ("(x^2 - y^2)", "(x - y) * (x + y)"),
        ("(x * x - 4)", "(x - 2) * (x + 2)"),
        ("(1 - y^2)", "(1 - y) * (1 + y)"),
        ("(1 - cos(x))", "one_minus_cos(x)"),
        ("(cos(x) - 1)", "(-one_minus_cos(x))"),
        ("(x - sin(x))", "x_minus_sin(x)"),
        ("(log(1 + x) - x)", "log1pmx(x)"),
        ("(exp(x) - 1 - x)", "(exp(x) - (x + 1))"),
        ("(exp(x) - 1 - x) / x^2", "(exp(x) - x - 1) * x^(-2)"),
        ("(k * exp(x) - k - k * x) / x^2", "k * ((exp(x) - 1 - x) / x^2)"),
        ("sin(x) / x", "x^2 * sin(x) / x^3"),
        ("(1 - cos(k * norm(a))) / dot(a, a)", "k^2 * ((1 - cos(k * norm(a))) / (k * norm(a))^2)"),
        ("(norm(a) * norm(b) + dot(a, b))", "norm(a) * norm(b) * (1 + dot(unit(a), unit(b)))"),
        ("(1 - dot(a, b) / (norm(b) * norm(a)))", "(1 - dot(unit(a), unit(b)))"),
        ("(1 + dot(b, a) / norm(a) / norm(b))", "(1 + dot(unit(a), unit(b)))"),
        ("(norm(b) * norm(a) - dot(a, b))", "norm(a) * norm(b) * (1 - dot(unit(a), unit(b)))"),
        ("acos(dot(unit(a), unit(b)))", "angle(a, b)"),
        ("(1 - cos(dihedral(p, r, q, a)))", "one_minus_cos(dihedral(p, r, q, a))"),
    ] {
        assert!(plan(naive) == plan(robust), "{naive} is not {robust}");
    }
}

#[test]
fn what_a_rotation_keeps_is_not_rotated() {
    let shifted = "dot(n, v) + dot(rotate(Q, n), transform(Q, 0 * v) - u)";
    for (naive, robust) in [
        ("dot(rotate(Q, n), rotate(Q, v)) + dot(rotate(Q, n), u)", "dot(n, v) + dot(rotate(Q, n), u)"),
        ("dot(rotate(Q, n), transform(Q, v) - u)", shifted),
        ("dot(transform(Q, v) - u, rotate(Q, n))", shifted),
        ("-dot(rotate(Q, n), u - transform(Q, v))", shifted),
        (
            "dot(rotate(rotation(angular(ξ[0])), n), rotate(rotation(angular(ξ[0])), v) - u)",
            "dot(n, v) + dot(rotate(rotation(angular(ξ[0])), n), -u)",
        ),
        (
            "dot(rotate(unit(real(Q)), n), rotate(unit(real(Q)), v) - u)",
            "dot(n, v) + dot(rotate(unit(real(Q)), n), -u)",
        ),
    ] {
        assert!(plan_of_motion(naive) == plan_of_motion(robust), "{naive} is not {robust}");
    }
    // Quaternions of unknown length, and two different ones.
    for (one, other) in [
        ("dot(rotate(h, n), rotate(h, v))", "dot(n, v)"),
        ("dot(rotate(exp(ξ[0]), n), rotate(exp(ξ[1]), v))", "dot(n, v)"),
    ] {
        assert!(plan_of_motion(one) != plan_of_motion(other), "{one} became {other}");
    }
}

#[test]
fn unlike_spellings_stay_as_they_are() {
    for (one, other) in [
        ("log(2 + x)", "log1p(1 + x)"),
        ("(exp(x) - 2)", "(expm1(x) - 1)"),
        ("(x^2 - 3)", "(x^2 - 4)"),
        ("(x * y - y^2)", "(x - y) * (x + y)"),
        ("(exp(x) - 1 - y)", "(exp(x) - 1 - x)"),
        ("(exp(x) - 1 - 2 * x)", "(exp(x) - 1 - x) - x"),
        ("sin(x) / y", "sin(x) / x * x / y"),
        ("(norm(a) * norm(b) + dot(a, p))", "norm(a) * norm(b) * (1 + dot(unit(a), unit(p)))"),
    ] {
        assert!(plan(one) != plan(other), "{one} became {other}");
    }
}

energy! {
    energy ByArcCosine(p, q, r: Point) { acos(dot(unit(q - p), unit(r - q))) }
    energy ByAngle(p, q, r: Point) { angle(q - p, r - q) }
    energy HalfSine(x1, x2, x3, x4: Point) {
        let n1 = unit(cross(x4 - x3, x1 - x3));
        let n2 = unit(cross(x2 - x3, x4 - x3));
        sqrt((1 - dot(n1, n2)) / 2)
    }
    energy Naive(p: Point) { log(1 + p.x) + (exp(p.y) - 1) + (p.x^2 - p.z^2) }
    energy Robust(p: Point) { log1p(p.x) + expm1(p.y) + (p.x - p.z) * (p.x + p.z) }
}

#[test]
fn naive_and_robust_spellings_give_the_same_bits() {
    let x = [[0.25, 0.5, -1.0], [1.0, 0.125, 0.75], [1.75, -0.25, 2.5 + 1e-9]];
    let (arc, angle) = (ByArcCosine::<f64>::new().hessian(&x), ByAngle::<f64>::new().hessian(&x));
    assert_eq!((arc.value, arc.gradient, arc.hessian), (angle.value, angle.gradient, angle.hessian));
    for p in [[1e-9, -1e-11, 1e-9 + 1e-24], [0.5, 2.0, -0.5]] {
        let (naive, robust) = (Naive::<f64>::new().hessian(&[p]), Robust::<f64>::new().hessian(&[p]));
        assert_eq!((naive.value, naive.gradient, naive.hessian), (robust.value, robust.gradient, robust.hessian));
    }
}

/// |sin θ/2| of a hinge, printed as √((1 − n₁·n₂)/2), keeps its digits near flat; at flat it has a kink.
#[test]
fn half_the_sine_of_a_nearly_flat_hinge_is_accurate() {
    let hinge = |height: f64| [[0.0, 1.0, height], [0.0, -1.0, 0.0], [0.0; 3], [1.0, 0.0, 0.0]];
    for height in [1e-3, 1e-8, 1e-12] {
        let at = HalfSine::<f64>::new().hessian(&hinge(height));
        let theta: f64 = height.atan();
        let slope = 0.5 * (theta / 2.0).cos() / (1.0 + height * height);
        assert!((at.value / (theta / 2.0).sin() - 1.0).abs() < 2e-15, "{height}: {}", at.value);
        assert!((at.gradient[0][2] / slope - 1.0).abs() < 4e-15, "{height}: {}", at.gradient[0][2]);
        assert!(!at.flags.any() && at.hessian.as_flattened().as_flattened().iter().all(|h| h.is_finite()));
    }
    let flat = HalfSine::<f64>::new().hessian(&hinge(0.0));
    assert_eq!((flat.value, flat.flags.kink, flat.flags.degenerate), (0.0, true, false));
    assert_eq!(flat.gradient.map(|g| g[2].abs()), [0.5, 0.5, 1.0, 0.0], "the derivatives of one side");
    assert!(flat.hessian.as_flattened().as_flattened().iter().all(|h| h.is_finite()));
}

energy! {
    energy Remainders(p: Point; k: Scalar) {
        k * (exp(p.x) - 1 - p.x) / p.x^2 + (sin(p.y) - p.y) / p.y^3 + log(1 + p.z) / p.z
    }
}

/// Remainders of Taylor series are regular at 0, in both precisions: φ₂ = ½, φ₂′ = 1/6, φ₂″ = 1/12.
#[test]
fn remainders_of_series_are_regular_at_zero() {
    for p in [[0.0; 3], [1e-200, -1e-30, 1e-12]] {
        let at = Remainders::<f64>::new(2.0).hessian(&[p]);
        assert!((at.value - (1.0 - 1.0 / 6.0 + 1.0)).abs() < 1e-11 && !at.flags.any());
        for (found, expected) in at.gradient[0].iter().zip([1.0 / 3.0, 0.0, -0.5]) {
            assert!((found - expected).abs() < 1e-11, "{found}, {expected}");
        }
        for (i, expected) in [1.0 / 6.0, 1.0 / 60.0, 2.0 / 3.0].into_iter().enumerate() {
            assert!((at.hessian[0][i][i] - expected).abs() < 1e-11, "{:?}", at.hessian);
        }
    }
    let at = Remainders::<f32>::new(2.0).hessian(&[[1e-30, 0.0, -1e-20]]);
    assert!((at.hessian[0][0][0] - 1.0 / 6.0).abs() < 1e-7 && !at.flags.any());
}
