//! Derivatives of every function of the language, alone and combined.

use energy_dsl::energy;

energy! {
    #[audit(samples = 50)]
    energy AngleBetween(p, q, r: Point; k: Scalar) { k * angle(q - p, r - q)^2 }

    #[audit(samples = 50)]
    energy UnitVectors(p, q, r: Point; w: Vec3) {
        dot(w, unit(q - p)) * dot(w, unit(r - p)) + norm(unit(q - p) - unit(r - q))
    }

    #[audit(samples = 50)]
    energy Cosines(p, q, r: Point; k: Scalar) { exp(k * dot(unit(q - p), unit(r - q))) + (1 - dot(unit(p), unit(q)))^2 }

    #[audit(samples = 50)]
    energy Powers(p, q: Point; a, b: Scalar) {
        let r = norm(p - q);
        r^a + r^(-2) + r^2.5 + r^3 + (1 + r * r)^b + b^(r / 4) + (2 + dot(p, q)^2)^(norm(p) / 4)
    }

    #[audit(samples = 50)]
    energy Elongations(p, q, r: Point; L: Scalar) {
        let C = norm(p - q) - L;
        let D = L - norm(q - r);
        C * C + C * D + exp(-D) + C^3 + norm(p - r) * norm(q)
    }

    #[audit(samples = 50)]
    energy Elementary(p, q: Point; k: Scalar) {
        let s = dot(p, q) / k;
        sin(s) * cos(s) + exp(-s * s) + log(1 + s * s) + sqrt(1 + s^2) + atan2(s, 2 + norm(q)) + 1 / (2 + s * s)
    }

    #[audit(samples = 50)]
    energy Remainders(p, q: Point; k: Scalar) {
        let s = dot(p, q) / (2 * k);
        one_minus_cos(s) + k * x_minus_sin(s) + sin_half(s) * cos_half(s)
    }
}

energy! {
    #[audit(samples = 50)]
    energy Choices(p, q: Point; k: Scalar) {
        let s = norm_squared(p);
        let t = norm_squared(q);
        abs(s - t) + min(s, t)^2 + max(s, k * t) + t * s + if s < t && t > k { (s - t) * (t - k) } else { 0 }
    }

    #[audit(samples = 50)]
    energy Matrices(p, q, r: Point; k: Scalar) {
        let M = columns(p - q, q - r, cross(p, r)) + 4 * identity(3);
        let G = transpose(M) * M;
        k * det(M) + trace(inverse(G)) + ddot(G, outer(p, q)) + dot(p, M * q) + norm(vector(dot(p, q), 2, 3))
    }

    #[audit(samples = 50)]
    energy HingeFunctions(x1, x2, x3, x4: Point; a: Scalar) {
        let θ = dihedral(x1, x2, x3, x4);
        a * sin(θ) + cos(θ)^2 + sin_half(θ) * cos_half(θ) + exp(cos_half(θ)) + θ^3 + norm(x1 - x2) * θ
    }

    #[audit(samples = 50)]
    force Gradients(p, q, r: Point, u, v, w: Velocity; k: Scalar) {
        let U = k * angle(q - p, r - q) + (norm(p - r) - 1)^2;
        let rate = dot(gradient(U, p), u - v) + dot(gradient(U, r), w - v);
        [-rate * gradient(U, p), cross(u, v) * norm(q), rate * unit(r - q)]
    }

    #[audit(samples = 50)]
    energy Sensitivity(p, q, r: Point; k, L: Scalar, a: Vec3, M: Mat2x2) {
        let e = norm(p - q) - L;
        let U = k / 2 * e^2 + log(1 + k^2) * angle(q - p, r - q) + exp(dot(a, p) / 8) + det(M) * M[0][1] * e;
        let G = gradient(U, M);
        gradient(U, k)^2 + gradient(U, L) * dot(gradient(U, a), q) + ddot(G, G)
            + norm_squared(gradient(gradient(U, L), p))
    }

    #[audit(samples = 50)]
    residual Calibration(s, t: Scalar; k: Scalar, x: Scalar) {
        let model = s * exp(-k * x) + t * tanh(k);
        vector(model, gradient(model, k), gradient(gradient(model, k), x))
    }

    #[audit(samples = 50)]
    constraint Angles(p, q, r: Point; φ: Scalar) { vector(angle(q - p, r - q) - φ, norm(p - r)^3) }

    #[audit(samples = 50)]
    energy Motions(p, q: Point; ξ: Twist, a: Quat, B: DualQuat, s: Scalar) {
        let A = exp(twist(p / 4, s * q));
        let U = unit(quat(s, p) * conjugate(a));
        dot(transform(A * exp(ξ), q), rotate(U, p)) + norm(real(A) - a) + dual(unit(A * B)).x
            + trace(rotation_matrix(rotation(q / 2))) * norm(quat(dot(p, q), p - q))
    }

    #[audit(samples = 50)]
    energy Sincs(p, q: Point; s: Scalar) {
        let y = norm_squared(p - q) / s;
        // Away from 0, where the textbook form has no digits.
        cos_sqrt(y) * s + sinc_sqrt(y) + sinc(1 + y * s) + cosc(1 + y)
    }

    #[audit(samples = 50)]
    force SincGradients(p, q: Point; s: Scalar) {
        let U = sinc_sqrt(s * norm_squared(p - q)) + cos_sqrt(norm_squared(p)) + sinc(1 + s * norm_squared(p + q));
        [-gradient(U, p), -gradient(U, q)]
    }

    #[audit(samples = 50)]
    energy Logarithms(p, q: Point; s: Scalar) {
        let x = dot(p, q);
        log1p(x^2) * expm1(x / 8) + log(2 + norm(p)) + softplus(s * x) + log1pmx(x^2 / 8)
            + log1p(x^2, 1 + x^2) * log1pmx(x / 64, 1 + x / 64) + exp(x / 16) - 1 + log(1 + norm_squared(q))
    }

    #[audit(samples = 50)]
    energy Areas(p, q, r: Point; s: Scalar) {
        let area = norm(cross(p - r, q - r));
        area * norm(p) + (area - s)^2 + sqrt(s + norm(cross(p - r, q)))
    }

    #[audit(samples = 50)]
    energy Losses(p, q: Point; δ: Scalar) {
        let x = norm(p) - norm(q);
        huber(x, δ) + pseudo_huber(x, δ) + huber(dot(p, q), 1 + norm(p)) + pseudo_huber(x, 1 + norm(q))
    }

    #[audit(samples = 50)]
    energy Arcs(p, q: Point; s: Scalar) {
        let x = dot(p, q) / (s + norm(p) * norm(q));
        asin(x) * acos(x / 2) + tan(x / s) + acos(dot(unit(p), unit(q)))
    }

    #[audit(samples = 50)]
    energy Sigmoids(p, q: Point; s: Scalar) {
        let x = dot(p, q) / s;
        tanh(x) * atan(s * x) + erf(x / 2) * norm(p) + sinh(x / 8) + cosh(norm(q) / 4) * erf(s)
    }

    #[audit(samples = 50)]
    force SigmoidGradients(p, q: Point; s: Scalar) {
        let U = tanh(norm(p - q)) + atan(s * p.x) + erf(p.y) + sinh(q.z / 4) * cosh(q.y / 4);
        [-gradient(U, p), -gradient(U, q)]
    }

    #[audit(samples = 50)]
    energy LargeMatrices(p, q, r: Point; M: Mat4x4, N: Mat2x3) {
        let A = columns(
            vector(p.x, p.y, p.z, 1), vector(q.x, q.y, q.z, 1), vector(r.x, r.y, r.z, 1), vector(1, p.x, q.y, r.z)
        ) + M + 8 * identity(4);
        let B = inverse(A);
        det(A) / 512 + ddot(B, transpose(M)) + trace(adjugate(A)) / 64 + A[1][2] * B[0][3] + dot(A[3], B[2])
            + norm(N * p) + N[1][2] * dot(N[0], q)
    }

    #[audit(samples = 50)]
    energy Polar(p, q: Point; M: Mat2x2) {
        let F = columns(vector(p.x, p.y), vector(q.x, q.y)) + M;
        let D = F - rotation_of(F);
        let G = columns(p, q);
        let E = stretch_of(G) - identity(2);
        ddot(D, D) + trace(E)^2 + ddot(E, E) + dot(vector(p.x, q.z), rotation_of(G)[0]) * det(stretch_of(F))
    }

    #[audit(samples = 4)]
    energy SpatialPolar(p, q, r: Point; M: Mat3x3) {
        let F = columns(p, q, r) + M;
        let S = stretch_of(F);
        ddot(rotation_of(F), M) + trace(S)^2 + det(S) * S[0][1]
    }

    #[audit(samples = 50)]
    energy SingularValues(p, q: Point; M: Mat2x2, k: Scalar) {
        let s = singular_values(columns(vector(p.x, p.y), vector(q.x, q.y)) + M);
        let t = singular_values(columns(p, q));
        k * sin(s[0] + s[1]) + exp(s[0] / 4) * t[1]^2 + (t[0]^k + t[1]^k) * p.z + atan2(s[1], 1 + s[0]^2)
    }

    #[audit(samples = 4)]
    force SpatialPolarGradients(p, q, r: Point; M: Mat3x3) {
        let U = trace(stretch_of(columns(p, q, r) + M))^2;
        [-gradient(U, p), -gradient(U, q), -gradient(U, r)]
    }

    #[audit(samples = 50)]
    energy Bounds(p, q: Point; a, b: Scalar) {
        let x = dot(p, q);
        clamp(x, -a, b)^2 + min(x, p.y, q.z, a) * max(x, p.z, b) + sign(x) * norm(p - q)
    }

    #[audit(samples = 50)]
    energy Naive(p, q, r: Point; k: Scalar) {
        let a = unit(q - p);
        let b = unit(r - q);
        sqrt((1 - dot(a, b)) / 2) + k * sqrt(1 - dot(a, b)) + norm(p)^2 - norm(q)^2 + (1 - cos(dot(p, r)))
    }

    #[audit(samples = 50)]
    residual Fit(a: Vec3, s, t: Scalar; m: Vec3) { vector(norm(a - m), sin(s) * t, dot(a, m)^2, atan2(s, 2 + t^2)) }
}

energy! {
    #[audit(samples = 20)]
    #[invariant(translation, rotation)]
    #[rest_state(zero_force)]
    energy Sheet(x0, x1, x2: Point; rest u0, u1, u2: Vec2; μ: Scalar) {
        rest { let B = inverse(columns(u1 - u0, u2 - u0)); }
        let F = columns(x1 - x0, x2 - x0) * B;
        let E = transpose(F) * F - identity(2);
        μ * ddot(E, E)
    }

    #[audit(samples = 20)]
    #[invariant(rotation)]
    #[rest_state(zero_force)]
    #[even]
    constraint Lengths(x: [Point; 2]; rest X: [Point; 2]) {
        rest { let L = norm(X[1] - X[0]); }
        [norm(x[1] - x[0]) - L, dot(x[0], x[0] - x[1]) * (norm(x[0] - x[1]) - L)]
    }

    #[audit(samples = 20)]
    #[invariant(translation, rotation)]
    force Drag(p, q: Point, v, w: Velocity; c: Scalar) { let f = c * norm(p - q) * (v - w); [-f, f] }

    #[audit(samples = 20)]
    #[even]
    residual Squares(a: Vec3, s: Scalar; k: Scalar) { [norm_squared(a) - k, s * a] }
}

/// Broken claims are found: the same claims on declarations that violate them.
mod broken_claims {
    use std::borrow::Cow;

    use energy_dsl::{Declaration, Element, Kind, Property};
    use energy_elements::{BridsonForce, Gravity, HingeAngle, StVK};
    use verify::audit::{Options, audit};

    /// Audits a declaration with a claim that it does not make. Returns the failures.
    fn message<E: Element>(claim: Property) -> String {
        let properties = Cow::Owned(vec![claim]);
        let declaration = Box::leak(Box::new(Declaration { properties, ..E::DECLARATION.clone() }));
        let options = Options { samples: 20, truths: 5, mutations: 0, extremes: 10, ..Options::default() };
        let report = audit(declaration, E::evaluate::<f64>, options);
        assert!(report.refused.is_empty(), "{:?}", report.refused);
        report.failures().map(|line| line.detail.as_str()).collect()
    }

    #[test]
    fn false_claims_are_found() {
        assert_eq!(Gravity::<f64>::DECLARATION.kind, Kind::Energy);
        for (message, attribute) in [
            (message::<Gravity<f64>>(Property::RotationInvariant), "invariant(rotation)"),
            (message::<Gravity<f64>>(Property::Even), "even"),
            (message::<HingeAngle<f64>>(Property::Even), "even"),
        ] {
            assert!(message.contains("claims") && message.contains(attribute), "{message}");
        }
        let right = [
            message::<HingeAngle<f64>>(Property::RotationInvariant),
            message::<BridsonForce<f64>>(Property::RotationInvariant),
            message::<StVK<f64>>(Property::ZeroForceAtRest),
        ];
        assert_eq!(right, ["", "", ""]);
    }
}
