//! The meaning of texts: both spellings, every function, and derivatives of compiled formulas.

use approx::assert_relative_eq;
use energy_compiler::Textbook;
use energy_runtime::Inputs;

/// Returns the value of a formula of the points p = (1, 2, 2), q = (3, −1, 4) and the parameters k = 3, L = 0.5, θ₀ =
/// 0.25.
fn value(body: &str) -> f64 {
    // Uses every input, so that the formula need not.
    let source =
        format!("constraint Test(p_k, p_l: Point; k, L, θ0: Scalar) {{ vector({body}, dot(p_k, p_l) * k * L * θ0) }}");
    let program = Textbook::from_source(&source).unwrap_or_else(|e| panic!("{source}\n{e}"));
    let positions = [1.0, 2.0, 2.0, 3.0, -1.0, 4.0];
    program.evaluate(&Inputs { parameters: &[3.0, 0.5, 0.25], rest: &[], positions: &positions, velocities: &[] })[0]
}

#[test]
fn both_spellings_mean_the_same() {
    for (printed, rust) in [
        ("‖p_k − p_ℓ‖ − L", "norm(p_k - p_l) - L"),
        ("k/2 (1 − p̂_k·p̂_ℓ)", "k / 2 * (1 - dot(unit(p_k), unit(p_l)))"),
        ("k (sin(L/2) − sin(θ₀/2))", "k * (sin(L / 2) - sin(θ0 / 2))"),
        ("½ k ‖p_k‖² L³", "0.5 * k * norm_squared(p_k) * L^3"),
        ("√k ‖p_k × p_ℓ‖", "sqrt(k) * norm(cross(p_k, p_l))"),
        ("p_k ᐧ p_ℓ + p_k ⋅ p_ℓ", "2 * dot(p_k, p_l)"),
        ("2π sin θ₀", "2 * pi * sin(θ0)"),
        ("\\hat{p_k} \\cdot \\hat{p_l} \\theta_0", "dot(unit(p_k), unit(p_l)) * θ0"),
        ("|L − k|^1.5", "abs(L - k)^(3/2)"),
        ("a = p_k − p_ℓ; k ‖a‖ ‖a‖", "k * norm_squared(p_k - p_l)"),
        ("k^2^L", "k^(2^L)"),
        ("-L^2", "-(L * L)"),
        ("k L⁻²", "k / L / L"),
        ("k L⁻¹ + ¼ k + ¾ L³ + ⅛ L⁰", "k / L + k / 4 + 3 * L^3 / 4 + 1 / 8"),
        ("½√(k L) + √k", "sqrt(k * L) / 2 + sqrt(k)"),
        ("pₖ·pₗ + p_{k}·p_{l}", "2 * dot(p_k, p_l)"),
        ("n_1 = p_k × p_l; \\hat{n}_1·n̂_1 + n̂₁·\\hat n_1 + ‖n₁‖", "2 + norm(cross(p_k, p_l))"),
        ("trace(p_k ⊗ p_l)", "dot(p_k, p_l)"),
        ("Δ = p_k − p_ℓ; ‖Δ‖² ∕ 2", "norm_squared(p_k - p_l) / 2"),
        ("\\frac{k + 1}{2 L} \\sqrt{k}", "(k + 1) / (2 * L) * sqrt(k)"),
        ("\\left(k + L\\right) \\lVert p_k \\rVert \\cos \\theta_0", "(k + L) * norm(p_k) * cos(θ0)"),
        ("M = columns(p_k, p_l, p_k × p_l); (M⁻¹ p_l)·vector(1, 10, 100)", "10"),
        ("sin² θ₀ + cos² θ₀ + |−L|", "1.5"),
        ("M = columns(p_k, p_l); M[1][0] k + M[2]·vector(1, 2)", "2 * k + 10"),
        ("tanh k + erf(L) - atan(k/2)", "tanh(k) + erf(L) - atan2(k, 2)"),
        ("w = [k, L]; sum(j in 0..2, w[j] j) + p_k.y", "L + 2"),
    ] {
        let printed_value = value(&format!("\"{}\"", printed.replace('\\', "\\\\")));
        assert_relative_eq!(printed_value, value(rust), max_relative = 1e-14);
    }
}

#[test]
fn functions_compute_what_they_say() {
    let (p, q) = ([1.0_f64, 2.0, 2.0], [3.0_f64, -1.0, 4.0]);
    let dot = p[0] * q[0] + p[1] * q[1] + p[2] * q[2];
    let angle = (dot / (3.0 * 26.0_f64.sqrt())).acos();
    for (formula, expected) in [
        ("angle(p_k, p_l)", angle),
        ("trace(outer(p_k, p_l))", dot),
        ("det(columns(p_k, p_l, cross(p_k, p_l)))", 9.0 * 26.0 - dot * dot),
        ("ddot(identity(3), outer(p_k, p_l))", dot),
        ("tanh(L) + sinh(L) * cosh(L)", 0.5_f64.tanh() + 1.0_f64.sinh() / 2.0),
        ("erf(L)", 0.520_499_877_813_046_5),
        ("erf(-k)", -0.999_977_909_503_001_4),
        ("atan(-k)", -(3.0_f64.atan())),
        ("gradient(k^2 * L, k)", 3.0),
        ("gradient(log(k) * L, k) * gradient(norm(L * p_k), L)", 0.5),
        ("det(identity(4) + identity(4))", 16.0),
        ("dot(inverse(columns(p_k, p_l, cross(p_k, p_l))) * p_l, vector(1, 10, 100))", 10.0),
        ("norm(transpose(outer(p_k, p_l)) * p_k)", 9.0 * 26.0_f64.sqrt()),
        ("min(k, L) + 10 * max(k, L)", 30.5),
        ("exp(log(k)) + atan2(1, 1) * 4 - π", 3.0),
        ("if k < L { 1 } else if L < k && k == 3 { 2 } else { 3 }", 2.0),
        ("if 1 < 2 && 2 <= 2 && 3 > 2 && 3 >= 3 && 1 == 1 && 1 != 2 { k } else { 0 }", 3.0),
        ("if 2 < 2 || 3 <= 2 || 2 > 2 || 2 >= 3 || 1 == 2 || 1 != 1 { k } else { 0 }", 0.0),
        ("if k < L || 2 < 1 { 1 } else { if L <= k && 1 < 2 { 2 } else { 3 } }", 2.0),
        ("sin_half(θ0) - sin(0.125)", 0.0),
        ("cos_half(θ0) - cos(0.125)", 0.0),
        ("one_minus_cos(L) - 1 + cos(L)", 0.0),
        ("x_minus_sin(L) - L + sin(L)", 0.0),
        // i j = k, and q q* = ‖q‖².
        ("(quat(0, 1, 0, 0) * quat(0, 0, 1, 0)).z", 1.0),
        ("{ let q = quat(L, p_k); real(q * conjugate(q)) - norm(q)^2 + dot(q, q) }", 9.25),
        ("norm(unit(quat(L, p_k)) - quat(L, p_k) / norm(quat(L, p_k)))", 0.0),
        // A quarter turn about z: half the angle is π/4.
        ("rotate(rotation(vector(0, 0, π / 4)), vector(1, 0, 0)).y", 1.0),
        ("(rotation_matrix(rotation(vector(0, 0, π / 4))) * vector(1, 0, 0)).y", 1.0),
        ("transform(exp(twist(vector(0, 0, π / 4), p_l)), p_k).y", 0.0),
        ("linear(twist(p_k, p_l)).x + angular(twist(p_k, p_l)).y", 5.0),
        // Motions compose from right to left.
        (
            "{ let A = exp(twist(L * p_k, p_l)); let B = exp(twist(p_l, p_k)); norm(transform(A * B, p_l) - \
             transform(A, transform(B, p_l))) }",
            0.0,
        ),
        (
            "{ let A = exp(twist(L * p_k, p_l)); let q = unit(k * A); norm(real(q) - real(A)) + norm(dual(q) - \
             dual(A)) }",
            0.0,
        ),
        ("norm(dual(dual_quat(quat(1, p_k), 2 * quat(0, p_l)))) - 2 * norm(p_l)", 0.0),
        ("sinc(L) - sin(L) / L + cosc(L) - (1 - cos(L)) / L^2", 0.0),
        ("cos_sqrt(k) - cos(sqrt(k)) + sinc_sqrt(k) - sinc(sqrt(k))", 0.0),
        ("log1p(k) - log(4) + expm1(k) - exp(k) + 1", 0.0),
        ("log1p(-1 + L) - log(L) + softplus(-L) - softplus(L) + L", 0.0),
        ("huber(L, k) + huber(-k, L)", 0.125 + 0.5 * 2.75),
        ("pseudo_huber(k, L) - L^2 * (sqrt(1 + (k / L)^2) - 1)", 0.0),
        ("asin(L) + acos(L) - π / 2 + asin(2 * k) + acos(-k)", 1.5 * std::f64::consts::PI),
        ("tan(L) - sin(L) / cos(L)", 0.0),
        ("clamp(k, 0, L) + clamp(-k, 0, L) + clamp(θ0, 0, L)", 0.75),
        ("sign(k) + 10 * sign(-L) + 100 * sign(k - k)", -9.0),
        ("max(θ0, k, L) + min(k, θ0, L)", 3.25),
        ("{ fn twice(x) { x + x } twice(twice(k)) }", 12.0),
        ("{ let a = unit(p_k); dot(â, a) }", 1.0),
        ("dot(gradient(norm_squared(p_k - p_l), p_k), vector(1, 0, 0))", -4.0),
    ] {
        let found = value(formula);
        assert!((found - expected).abs() <= 1e-13 * expected.abs().max(1.0), "{formula}: {found}, expected {expected}");
    }
}

/// A point after the first `;` is a parameter, whatever the kind is.
#[test]
fn points_after_the_unknowns_are_parameters() {
    for (source, unknowns, parameters) in [
        ("residual A(s: Scalar; p: Point) { s * p }", &[2.0][..], &[1.0, 2.0, 3.0][..]),
        ("residual A(p: Point; q: [Point; 2]) { p - q[1] }", &[4.0, 4.0, 4.0], &[0.0, 0.0, 0.0, 2.0, 0.0, -2.0]),
        ("constraint A(p: Point; q: Point) { 2 * (p - q) }", &[2.0, 2.0, 2.0], &[1.0, 0.0, -1.0]),
    ] {
        let program = Textbook::from_source(source).unwrap_or_else(|e| panic!("{source}\n{e}"));
        let inputs = Inputs { parameters, rest: &[], positions: unknowns, velocities: &[] };
        assert_eq!(program.evaluate(&inputs), [2.0, 4.0, 6.0], "{source}");
    }
}

#[test]
fn infinity_is_a_value_of_any_unit() {
    let source = "energy A(p, q: Point; k: Scalar[N/m], E: Scalar[J], L: Scalar[m]) {
        let r = \"‖p − q‖\";
        if r <= L && infinity > r { infinity } else { min(k / 2 * r^2, infinity) + max(-infinity, E) + \"E r / (r + ∞)\" }
    }";
    let program = Textbook::from_source(source).unwrap_or_else(|e| panic!("{source}\n{e}"));
    for (x, expected) in [(0.5, f64::INFINITY), (2.0, 9.0)] {
        let positions = [x, 0.0, 0.0, 0.0, 0.0, 0.0];
        let inputs = Inputs { parameters: &[2.0, 5.0, 1.0], rest: &[], positions: &positions, velocities: &[] };
        assert_eq!(program.evaluate(&inputs), [expected]);
    }
}

/// Numbers that move may be equal in a region, where they have pieces.
#[test]
fn equalities_that_hold_in_a_region_are_accepted() {
    for condition in ["max(norm(p), 1) == 1", "k == 2", "abs(p.x) != p.x", "sign(p.x) == sign(p.y)"] {
        let source = format!("energy A(p: Point; k: Scalar) {{ if {condition} {{ k }} else {{ norm(p) }} }}");
        Textbook::from_source(&source).unwrap_or_else(|e| panic!("{source}\n{e}"));
    }
}

/// The velocity of an angle is no velocity of a point.
#[test]
fn a_velocity_has_the_unit_of_its_unknown() {
    let source = "force A(_θ: Scalar[rad], ω: Velocity; c: Scalar[N s/m]) { [-c * ω] }";
    let error = Textbook::from_source(source).unwrap_err().to_string();
    assert!(error.contains("unit"), "{error}");
}

/// Correct units are accepted, including inferred ones.
#[test]
fn right_units_are_accepted() {
    for source in [
        // L must be a length, ρ a stiffness; 0 has any unit.
        "energy A(p, q: Point; k: Scalar[N/m], L, ρ: Scalar) { k * (norm(p - q) - L)^2 + max(ρ, 0) * (L - 0)^2 }",
        "energy A(p: Point; g: Scalar[m/s^2], m: Scalar[kg]) { const H: Scalar[m] = 2; m * g * (p.z - H) }",
        // Half-integer powers, and units that cancel: √(J/N · m) is a length.
        "energy A(p: Point; E: Scalar[J], F: Scalar[N]) { F * sqrt(E / F * norm(p)) + E * (norm(p) / (E / F))^1.5 }",
        "energy A(p, q: Point; c: Scalar[J/m^(1/2)]) { c * sqrt(norm(p - q)) }",
        "energy A(p, q: Point; E: Scalar[\"kg·m²/s²\"], a: Scalar[1/m]) { E * exp(-a * norm(p - q)) }",
        "energy A(x1, x2, x3, x4: Point; k: Scalar[J], w: Scalar) { k * dihedral(x1, x2, x3, x4) * atan2(w, w + 1) }",
        "force A(_p: Point, v: Velocity; c: Scalar[N s/m]) { -c * v }",
        // A velocity has the unit of its unknown, by time.
        "force A(_θ: Scalar[rad], ω: Velocity; c: Scalar[N m s]) { [-c * ω] }",
        "force A(_s: Scalar[m], v: Velocity; c: Scalar[N s/m]) { [-c * v] }",
        "force A(_q: Rotation, ω: Velocity; c: Scalar[N m s]) { [-c * ω] }",
        "residual A(ξ: Twist; p: Vec3[m]) { vector(norm(p), angular(ξ).x, dot(linear(ξ), p)) }",
        "constraint A(p, q: Point; L: Scalar[m]) { [norm(p - q) - L, dot(p, q) / L^2] }",
        // Singular values have the unit of their matrix.
        "energy A(p, q: Point; k: Scalar[N/m]) { let σ = singular_values(outer(p, vector(1, 0)) + outer(q, vector(0, 1))); k * σ.x^2 }",
        // Without units there is nothing to check.
        "energy A(p, q: Point; α: Scalar[1]) { norm(p - q)^α + sin(norm(p)) }",
    ] {
        Textbook::from_source(source).unwrap_or_else(|e| panic!("{source}\n{e}"));
    }
}

#[test]
fn deep_nesting_is_refused_and_not_a_stack_overflow() {
    for (open, close) in [
        ("(", ")"),
        ("-", ""),
        ("sin(", ")"),
        ("[", "]"),
        ("if 1 < 2 { ", " } else { 1 }"),
        ("2^", ""),
        ("if 1 < 2 { 1 } else ", ""),
    ] {
        let source = format!("energy A(p: Point) {{ {}{{ norm(p) }}{} }}", open.repeat(5000), close.repeat(5000));
        let errors = Textbook::from_source(&source).unwrap_err().to_string();
        assert!(errors.contains("nested more than"), "{open}: {}", &errors[..errors.len().min(300)]);
    }
}

#[test]
fn long_sums_and_calls_that_multiply_are_refused_with_a_remedy() {
    let terms = vec!["norm(p)"; 8000].join(" + ");
    let message = Textbook::from_source(&format!("energy Long(p: Point) {{ {terms} }}")).unwrap_err().to_string();
    assert!(message.contains("more than 500 operators") && message.contains("sum over an index"), "{message}");
    // 300 terms are as long as a formula gets by hand.
    let terms = vec!["norm(p)"; 300].join(" + ");
    Textbook::from_source(&format!("energy Sum(p: Point) {{ {terms} }}")).unwrap();

    let mut functions = "fn f0(x) { x } ".to_owned();
    for level in 1..=40 {
        functions += &format!("fn f{level}(x) {{ f{0}(x) + f{0}(x) }} ", level - 1);
    }
    let message = Textbook::from_source(&format!("{functions} energy Many(p: Point) {{ f40(norm(p)) }}"))
        .unwrap_err()
        .to_string();
    assert_eq!(message.matches("called more than 4096 times").count(), 1, "{message}");
}

#[test]
fn hostile_texts_are_refused_without_panic() {
    for source in [
        "",
        "energy",
        "energy A",
        "energy A(",
        "energy A()",
        "energy A() {}",
        "energy A(p: Point)",
        "pub",
        "pub(",
        "#",
        "#[doc",
        "fn",
        "fn f",
        "fn f(",
        "force A(p: Point) { [] }",
        "energy A(p: Point) = ;",
        "energy A(p: Point) = \"\";",
        "energy A(p: Point) = \"‖‖\";",
        "energy A(p: Point) = \"((((\";",
        "energy A(p: Point) = \"\\\\hat\";",
        "energy A(p: Point) { let }",
        "energy A(p: Point) { rest }",
        "energy A(p: Point[) { 1 }",
        "1 2 3",
        "\"‖\"",
    ] {
        assert!(Textbook::from_source(source).is_err(), "accepted: {source}");
        if let Ok(tokens) = source.parse::<proc_macro2::TokenStream>() {
            let _ = energy_compiler::compile(tokens);
        }
    }
}

#[test]
fn vectors_that_vanish_identically_compile() {
    for vector in ["p - p", "0 * p", "(p - q) - (p - q)", "cross(p, p)"] {
        for formula in ["1 - dot(unit(a), unit(b))", "angle(a, b)", "norm(a) - k", "norm(cross(a, b))"] {
            let source =
                format!("energy Test(p, q: Point; k: Scalar) {{ let _a = {vector}; let _b = q - p; k * ({formula}) }}");
            Textbook::from_source(&source).unwrap_or_else(|e| panic!("{source}: {e}"));
            energy_compiler::Listing::from_source(&source).unwrap_or_else(|e| panic!("{source}: {e}"));
        }
    }
}

#[test]
fn constants_that_are_infinite_are_written() {
    let source = "energy A(p, q: Point) { min(dot(p - q, p - q), 1e308 * 10) }";
    let code = energy_compiler::compile(source.parse().unwrap()).to_string().replace(' ', "");
    assert!(code.contains("f64::INFINITY"), "{code}");
}

#[test]
fn too_many_coordinates_are_refused_before_they_are_differentiated() {
    let source = |points: usize| {
        format!("energy A(p: [Point; {points}]) {{ sum(i in 1..{points}, norm_squared(p[i] - p[i - 1])) }}")
    };
    assert!(energy_compiler::Interpreted::from_source(&source(85)).is_ok());
    let refused = energy_compiler::Interpreted::from_source(&source(200)).unwrap_err().to_string();
    assert!(refused.contains("A moves 600 coordinates") && refused.contains("255 rows"), "{refused}");
    let residual = "residual R(u: [Scalar; 256]; k: Scalar) { k * u[0] * u[255] }";
    assert!(energy_compiler::Interpreted::from_source(residual).is_ok());
}
