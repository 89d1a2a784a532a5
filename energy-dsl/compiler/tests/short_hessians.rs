//! Hessians of formulas from elsewhere are gathered at their narrowest parts.

use energy_compiler::Listing;

/// A formula, and the most operations of its reduced Hessian.
const FORMULAS: [(&str, usize); 21] = [
    // With s = ‖d‖², ∇²U = 2 f′ I + 4 f″ d dᵀ: 6 for s, 8 for f, 12 for f′ and f″, 6 for each product, 9 for ∇U.
    ("energy LennardJones(p, q: Point; k, s: Scalar) { let r = s^2 / norm_squared(p - q); 4 * k * (r^6 - r^3) }", 70),
    // f of a length: its derivatives are scalars.
    (
        "energy Buckingham(p, q: Point; a, b, c: Scalar) {
        let s = norm_squared(p - q); a * exp(-b * sqrt(s)) - c / s^3 + c / s^4
      }",
        95,
    ),
    // f of a determinant, with J = a·(b × c): ∇²J is linear in the edges.
    (
        "energy Volume(x0, x1, x2, x3: Point; k: Scalar) {
        let J = det(columns(x1 - x0, x2 - x0, x3 - x0)); k * (log(J)^2 + (J - 1)^2 + 1 / J^2 + exp(-J))
      }",
        210,
    ),
    // Two components of the slip: 2 × 2 curvatures, and constant rates of twelve coordinates.
    (
        "energy LaggedFriction(x0, x1, x2, x3: Point; y: Vec3, u, v: Vec3, b, c: Scalar, λ, ε: Scalar) {
        let d = x0 - (1 - b - c) * x1 - b * x2 - c * x3 - y;
        let s = sqrt(dot(d, u)^2 + dot(d, v)^2);
        λ * (if s < ε { s^2 / ε - s^3 / (3 * ε^2) + ε / 3 } else { s })
      }",
        260,
    ),
    // Gaps of two midpoints: three linear functions of twelve coordinates.
    (
        "energy Yarn(a0, a1, b0, b1: Point; k, r: Scalar) {
        let d = (a0 + a1) / 2 - (b0 + b1) / 2; k * ((r^2 / norm_squared(d))^2 + norm_squared(d) / r^2 - 2)
      }",
        75,
    ),
    // Nine differences of three points on each of two curves: 27 numbers, but 18 of the points. By hand 2,500: 45 for each
    // pair, 144 for the points, 1,728 to sum 3 × 3 blocks over both points of each pair of control points.
    (
        "energy QuadraturePoints(a: [Point; 4], b: [Point; 4]; w: [Vec4; 3], r, k: Scalar) {
        k * sum(i in 0..3, sum(j in 0..3, {
            let p = sum(n in 0..4, w[i][n] * a[n]); let q = sum(n in 0..4, w[j][n] * b[n]);
            let s = norm_squared(p - q) / r^2;
            if s < 1 { 1 / s + s - 2 } else { 0 }
        }))
      }",
        3000,
    ),
    // A gap and two mean edges: nine linear functions of eighteen coordinates.
    (
        "energy Cohesive(a0, a1, a2, b0, b1, b2: Point; k, δ: Scalar) {
        let g = (a0 + a1 + a2 - b0 - b1 - b2) / 3;
        let n = cross((a1 + b1 - a0 - b0) / 2, (a2 + b2 - a0 - b0) / 2);
        let t = dot(g, unit(n)); let r = sqrt((t^2 + norm_squared(g)) / 2) / δ;
        k * (1 - (1 + r) * exp(-r)) * norm(n) / 2
      }",
        940,
    ),
    // Three mean edges of a brick, nine linear functions of 24 coordinates.
    (
        "energy Brick(a, b, c, d, e, f, g, h: Point; μ, λ: Scalar) {
        let u = (b + c + f + g - a - d - e - h) / 4; let v = (c + d + g + h - a - b - e - f) / 4;
        let w = (e + f + g + h - a - b - c - d) / 4; let J = det(columns(u, v, w));
        μ * (norm_squared(u) + norm_squared(v) + norm_squared(w)) / J^(2/3) + λ * (J - 1)^2
      }",
        480,
    ),
    // A Gauss point between two gaps, with weights that are no fractions.
    (
        "energy GaussPoint(a, b, c, d: Point; k: Scalar) {
        let g = 0.2113248654051871 * a + 0.7886751345948129 * c - (0.2113248654051871 * b + 0.7886751345948129 * d);
        k * norm(g)^3
      }",
        60,
    ),
    // Distances from the centre: three of the four are independent. Seen from one point, so that they keep their digits
    // far from the origin.
    (
        "energy Centred(a, b, c, d: Point; k: Scalar) {
        let m = (a + b + c + d) / 4;
        k * (norm_squared(a - m) + norm_squared(b - m) + norm(c - m) + norm(d - m)^4)
      }",
        145,
    ),
    // Second derivatives of the printed formula, value and gradient of one that does not cancel.
    (
        "energy ComputedAs(x0, x1, x2: Point; rest u0, u1, u2: Vec2; λ, μ: Scalar) {
        rest { let D_m = columns(u1 - u0, u2 - u0); let B = inverse(D_m); let A = det(D_m) / 2; }
        let F = columns(x1 - x0, x2 - x0) * B; let C = transpose(F) * F;
        let I = trace(C); let J = norm(cross(x1 - x0, x2 - x0)) / (2 * A);
        let s = (C[0][0] - C[1][1])^2 + 4 * C[0][1]^2;
        A / 2 * (μ * computed_as(I - 2 * J, s / (I + 2 * J)) + λ * (J - 1)^2)
      }",
        320,
    ),
    // With δG = −G δF G and M = 2 GᵀG Gᵀ, each entry of ∇²U is (GᵀG)(GGᵀ) + G M + M G: three products. 42 operations
    // for G, 30 for each of GᵀG and GGᵀ, 45 for M, 5 for each of 45 entries.
    (
        "energy Inverse(x0, x1, x2, x3: Point) {
        let G = inverse(columns(x1 - x0, x2 - x0, x3 - x0)); ddot(G, G)
      }",
        530,
    ),
    (
        "energy InverseGap(x0, x1, x2, x3: Point; A: Mat3x3) {
        let G = inverse(columns(x1 - x0, x2 - x0, x3 - x0)) - A; ddot(G, G)
      }",
        600,
    ),
    (
        "energy Opposite(x0, x1, x2, x3: Point; rest X0, X1, X2, X3: Point; μ: Scalar) {
        rest { let B = inverse(columns(X1 - X0, X2 - X0, X3 - X0)); }
        let F = columns(x1 - x0, x2 - x0, x3 - x0) * B; let E = F - transpose(inverse(F)); μ * ddot(E, E)
      }",
        1040,
    ),
    // The same with F = D R and Z = R G: δG = −G δD Z. 45 operations more for each of F, Z, F Rᵀ, 30 for R Rᵀ.
    (
        "energy SymmetricDirichlet(x0, x1, x2, x3: Point; rest X0, X1, X2, X3: Point; μ: Scalar) {
        rest { let B = inverse(columns(X1 - X0, X2 - X0, X3 - X0)); }
        let F = columns(x1 - x0, x2 - x0, x3 - x0) * B; let G = inverse(F); μ * (ddot(F, F) + ddot(G, G))
      }",
        650,
    ),
    // ‖F − R‖² and tr S have closed second derivatives, however they are spelled.
    (
        "energy CorotatedDistance(x0, x1, x2, x3: Point; rest X0, X1, X2, X3: Point; μ, λ: Scalar) {
        rest { let B = inverse(columns(X1 - X0, X2 - X0, X3 - X0)); }
        let F = columns(x1 - x0, x2 - x0, x3 - x0) * B; let R = rotation_of(F);
        μ * ddot(F - R, F - R) + λ / 2 * (trace(transpose(R) * F) - 3)^2
      }",
        2000,
    ),
    (
        "energy CorotatedStrain(x0, x1, x2, x3: Point; rest X0, X1, X2, X3: Point; μ, λ: Scalar) {
        rest { let B = inverse(columns(X1 - X0, X2 - X0, X3 - X0)); }
        let F = columns(x1 - x0, x2 - x0, x3 - x0) * B;
        let E = transpose(rotation_of(F)) * F - identity(3); μ * ddot(E, E) + λ / 2 * trace(E)^2
      }",
        2000,
    ),
    // Entries of R are weighted before they are differentiated: 45 sums instead of 9 times 45.
    (
        "energy Aligned(x0, x1, x2, x3: Point; W: Mat3x3) {
        ddot(W, rotation_of(columns(x1 - x0, x2 - x0, x3 - x0)))
      }",
        2300,
    ),
    // Three unit vectors and an angle are as many numbers as the coordinates, and yet a better place to gather
    // derivatives: SymPy takes 6,933 operations.
    (
        "energy DihedralSpring(x0, x1, x2, x3: Point, ψ: Scalar; k: Scalar) {
        let n = unit(cross(x1 - x0, x2 - x0)); let m = unit(cross(x3 - x0, x1 - x0)); let e = unit(x1 - x0);
        k * (atan2(dot(cross(n, m), e), dot(n, m)) - ψ)^2 + k * (1 - cos(ψ))
      }",
        2000,
    ),
    // A unit normal and the point: six numbers below which nine coordinates move. SymPy takes 3,939 operations.
    (
        "energy PointAboveTriangle(p, a, b, c: Point; k, h, μ: Scalar, t: Vec3) {
        let n = unit(cross(b - a, c - a)); let g = dot(n, p - a);
        let s = p - (a + b + c) / 3 - g * n;
        k * (g - h)^2 * log(g / h) + μ * sqrt(norm_squared(s - t) + 0.01)
      }",
        1130,
    ),
    // The sine and the cosine of each angle give way to it: two unit vectors and two angles.
    (
        "energy Rod(x0, x1, x2: Point, θ0, θ1: Scalar; c, d, e, f: Vec3; B1, B2, l, κ1, κ2: Scalar) {
        let a = unit(x1 - x0); let b = unit(x2 - x1);
        let u = c - dot(a, c) / (1 + dot(d, a)) * (d + a); let v = e - dot(b, e) / (1 + dot(f, b)) * (f + b);
        let n = 2 / (1 + dot(a, b)) * cross(a, b);
        let m = cos(θ0) * u + sin(θ0) * cross(a, u) + cos(θ1) * v + sin(θ1) * cross(b, v);
        let o = cos(θ0) * cross(a, u) - sin(θ0) * u + cos(θ1) * cross(b, v) - sin(θ1) * v;
        (B1 * (dot(n, m) / 2 - l * κ1)^2 + B2 * (dot(n, o) / 2 - l * κ2)^2) / (2 * l)
      }",
        2900,
    ),
];

/// Potentials of a tetrahedron with F = D B: parameters, formula, and the operations of SymPy 1.14 for value, gradient
/// and Hessian in the nine coordinates D, as `count_with_sympy.py` counts them.
const OF_TETRAHEDRA: [(&str, &str, &str, usize); 13] = [
    ("NeoHookean", "μ, λ: Scalar", "let J = det(F); μ / 2 * (ddot(F, F) - 3) - μ * log(J) + λ / 2 * log(J)^2", 874),
    (
        "MooneyRivlin",
        "μ, λ, κ: Scalar",
        "let C = transpose(F) * F; let J = det(F); let I1 = trace(C); let I2 = (I1^2 - ddot(C, C)) / 2;
        μ * (I1 * J^(-2/3) - 3) + λ * (I2 * J^(-4/3) - 3) + κ * (J - 1)^2",
        3539,
    ),
    ("Fung", "a, b: Scalar", "let E = (transpose(F) * F - identity(3)) / 2; a * (exp(b * ddot(E, E)) - 1)", 1216),
    (
        "Fibres",
        "c, a, b: Scalar, d, e: Vec3",
        "let C = transpose(F) * F; let p = dot(d, C * d) - 1; let q = dot(e, C * e) - 1;
        c * (trace(C) - 3) + a / (2 * b) * (exp(b * p^2) + exp(b * q^2) - 2)",
        1588,
    ),
    ("Conformal", "k: Scalar", "k * ddot(F, F) / det(F)^(2/3)", 896),
    ("Cofactors", "k: Scalar", "let A = adjugate(F); k * ddot(A, A) / det(F)^2 + k * ddot(F, F)", 1761),
    (
        "StVenantKirchhoff",
        "μ, λ: Scalar",
        "let E = (transpose(F) * F - identity(3)) / 2; μ * ddot(E, E) + λ / 2 * trace(E)^2",
        1327,
    ),
    ("Biderman", "a, b, c: Scalar", "let I = ddot(F, F) - 3; a * I + b * I^2 + c * I^3 + (det(F) - 1)^2", 1065),
    ("Anisotropic", "A: Mat3x3, k: Scalar", "let C = transpose(F) * F; k * ddot(A * C, C * A)", 3593),
    (
        "SmallStrain",
        "μ, λ: Scalar",
        "let e = (F + transpose(F)) / 2 - identity(3); μ * ddot(e, e) + λ / 2 * trace(e)^2",
        384,
    ),
    ("Face", "k: Scalar", "let n = adjugate(transpose(F)) * vector(0, 0, 1); k * norm_squared(n)", 336),
    ("SymmetricDirichlet", "k: Scalar", "let G = inverse(F); k * (ddot(F, F) + ddot(G, G))", 4049),
    ("Opposite", "k: Scalar", "let E = F - transpose(inverse(F)); k * ddot(E, E)", 5139),
];

/// Potentials of points, with the operations of SymPy above each.
const OF_POINTS: &str = include_str!("formulas/of_points.energy");

/// Potentials of points that take more than SymPy's operations and those for the differences of points: by how many
/// percent at most, and why.
const LONGER: [(&str, usize, &str); 5] = [
    ("LennardJones", 2, "the difference of q¹² and q⁶ is (q⁶ + q³)(q⁶ − q³), which keeps its digits"),
    ("Fene", 49, "log(1 − x) keeps its digits for small x"),
    ("GreenSpring", 17, "factors 2 of the derivatives do not meet those of the parameter"),
    ("TwoSquares", 14, "the same"),
    ("FungTri", 6, "the factored route is not shorter by a twentieth"),
];

/// Returns the name of a formula, the operations of its reduced Hessian, and the routes to it.
fn of_hessian(source: &str) -> (String, usize, String) {
    count(&Listing::from_source(source).expect("a sound formula").remove(0))
}

fn count(listing: &Listing) -> (String, usize, String) {
    let plans = listing.plans();
    let row = plans.lines().find(|line| line.contains("taken")).expect("a route is taken");
    let count = row.split_once(" operations").and_then(|(first, _)| first.split_whitespace().last()).expect("a count");
    let count = count.parse().expect("a number");
    println!("{}: {count} operations", listing.name());
    (listing.name().to_owned(), count, plans)
}

#[test]
fn hessians_are_gathered_at_narrow_parts() {
    for (source, most) in FORMULAS {
        let (name, count, plans) = of_hessian(source);
        assert!(count <= most, "{name}: {count} operations, more than {most}\n{plans}");
    }
}

#[test]
fn hessians_are_shorter_than_common_subexpressions_of_sympy() {
    for (name, parameters, formula, by_sympy) in OF_TETRAHEDRA {
        let (name, count, plans) = of_hessian(&format!(
            "energy {name}(x0, x1, x2, x3: Point; rest X0, X1, X2, X3: Point; {parameters}) {{
                rest {{ let B = inverse(columns(X1 - X0, X2 - X0, X3 - X0)); }}
                let F = columns(x1 - x0, x2 - x0, x3 - x0) * B;
                {formula}
            }}"
        ));
        assert!(count < by_sympy, "{name}: {count} operations, {by_sympy} by SymPy\n{plans}");
    }
}

#[test]
fn hessians_of_potentials_of_points_are_shorter_too() {
    let all = Listing::from_file(OF_POINTS, "of_points.energy").expect("sound formulas");
    let numbers = OF_POINTS.lines().filter_map(|line| line.strip_prefix("// ")?.parse::<usize>().ok());
    let points =
        OF_POINTS.lines().filter_map(|line| line.split_once(": Point").map(|(names, _)| names.split(',').count()));
    let rows: Vec<(usize, usize)> = numbers.zip(points).collect();
    assert_eq!(all.len(), rows.len());
    for (listing, (by_sympy, points)) in all.iter().zip(rows) {
        let (name, count, plans) = count(listing);
        let longer = LONGER.iter().find(|(longer, ..)| *longer == name).map_or(0, |(_, percent, _)| *percent);
        let most = by_sympy * (100 + longer) / 100 + 3 * (points - 1);
        assert!(count <= most, "{name}: {count} operations, {by_sympy} by SymPy\n{plans}");
    }
}
