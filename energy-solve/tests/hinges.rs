//! Semi-definite Hessians of dihedral angles in closed form, against eigenvalues of each triangle's part.

use energy_dsl::{Element, Potential, Vector3};
use energy_elements::{ArcAngle, BridsonBending, HingeAngle, HingeCos, HingeCosHalf, HingeSinHalf, QuadraticHinge};
use energy_solve::Curvature;
use nalgebra::{DMatrix, DVector};
use proptest::prelude::*;

use crate::curvature::{COUNT, Read, compiled, hessians, least_eigenvalue, on_random, points, with_eigenvalues};

type Hinge = [Vector3<f64>; 4];

/// The Hessian of f(θ) and its absolute value, made of matrices in terms of all four points.
struct Reference {
    exact: DMatrix<f64>,
    absolute: DMatrix<f64>,
}

impl Reference {
    /// Creates the reference from f′ and f″.
    fn new(x: &Hinge, [slope, bend]: [f64; 2]) -> Self {
        let (edge, zero) = (minus(x[3], x[2]), DMatrix::zeros(12, 12));
        let length = dot(edge, edge).sqrt();
        let unit = edge.map(|e| e / length);
        let (mut gradient, mut second, mut absolute) = (DVector::zeros(12), zero.clone(), zero);
        for (apex, sign) in [(0, -1.0), (1, 1.0)] {
            let arm = minus(x[apex], x[2]);
            let normal = cross(edge, arm);
            let area = dot(normal, normal).sqrt();
            let (n, height, foot) = (normal.map(|n| n / area), area / length, dot(edge, arm) / length / length);
            let t = cross(n, unit);
            // Derivatives of n·w, n·d and so on, by point.
            let mut of_apex = [0.0, 0.0, foot - 1.0, -foot];
            of_apex[apex] = 1.0;
            let by = |vector: Vector3<f64>, points: [f64; 4]| {
                DVector::from_fn(12, |row, _| vector[row % 3] * points[row / 3])
            };
            let [w, d] = [of_apex, [0.0, 0.0, -1.0, 1.0]];
            let (alpha, beta) = (by(n, w) / height, by(n, d) / length);
            let (mu, rho) = (by(t, w) / height, by(unit, w) / height + by(t, d) * 0.5 / length);
            let part = -(&alpha * mu.transpose() + &beta * rho.transpose());
            let part = &part + part.transpose();
            gradient += &alpha * sign;
            second += &part * sign;
            absolute += with_eigenvalues(&part, f64::abs) * slope.abs();
        }
        let square = &gradient * gradient.transpose();
        Self { exact: &square * bend + second * slope, absolute: square * bend.abs() + absolute }
    }
}

fn minus(a: Vector3<f64>, b: Vector3<f64>) -> Vector3<f64> {
    std::array::from_fn(|axis| a[axis] - b[axis])
}

fn dot(a: Vector3<f64>, b: Vector3<f64>) -> f64 {
    (0..3).map(|axis| a[axis] * b[axis]).sum()
}

/// Returns a × b without cancellation.
fn cross(a: Vector3<f64>, b: Vector3<f64>) -> Vector3<f64> {
    std::array::from_fn(|axis| {
        let (j, k) = ((axis + 1) % 3, (axis + 2) % 3);
        let product = a[k] * b[j];
        a[j].mul_add(b[k], -product) - a[k].mul_add(b[j], -product)
    })
}

/// Compares the Hessians of one element at many hinges. `derivatives` returns f′ and f″.
fn check(
    element: &Read,
    parameters: &[f64],
    derivatives: impl Fn(f64) -> [f64; 2],
    x: &[Hinge],
) -> Result<(), TestCaseError> {
    let of = |curvature| hessians(element.term(x.len(), &[], parameters), x, curvature);
    let [(exact, _), (clamped, _), (absolute, counts)] =
        [Curvature::Exact, Curvature::Clamped, Curvature::Absolute].map(of);
    prop_assert_eq!(counts.hessian.projected, x.len() as u64);
    for (number, x) in x.iter().enumerate() {
        let reference = Reference::new(x, derivatives(HingeAngle::new().value(x).value));
        let half = (&exact[number] + &reference.absolute) * 0.5;
        for (name, found, expected) in [
            ("exact", &exact[number], &reference.exact),
            ("absolute", &absolute[number], &reference.absolute),
            ("clamped", &clamped[number], &half),
        ] {
            let (error, size) = ((found - expected).amax(), reference.absolute.amax());
            prop_assert!(error <= 1e-12 * size, "{name}, {x:?}: off by {error:e} of {size:e}");
            if name != "exact" {
                for matrix in [found.clone(), found - &exact[number]] {
                    let least = least_eigenvalue(&matrix);
                    prop_assert!(least >= -1e-14 * size, "{name}, {x:?}: {least:e} of {size:e}");
                }
            }
        }
    }
    Ok(())
}

/// All functions of the dihedral angle, in order: θ, cos θ, cos θ/2, sin θ/2, ½ k (θ − θ₀)², Bridson's, the arc's.
struct Functions([Read; 7]);

impl Functions {
    fn new() -> Self {
        Self([
            of_angle::<HingeAngle>(),
            of_angle::<HingeCos>(),
            of_angle::<HingeCosHalf>(),
            of_angle::<HingeSinHalf>(),
            of_angle::<QuadraticHinge>(),
            of_angle::<BridsonBending>(),
            of_angle::<ArcAngle>(),
        ])
    }

    fn check(&self, x: &[Hinge], rest: f64) -> Result<(), TestCaseError> {
        let Self([angle, cos, cos_half, sin_half, quadratic, bridson, arc]) = self;
        check(angle, &[], |_| [1.0, 0.0], x)?;
        check(cos, &[], |θ| [-θ.sin(), -θ.cos()], x)?;
        check(cos_half, &[], |θ| [-(θ / 2.0).sin() / 2.0, -(θ / 2.0).cos() / 4.0], x)?;
        check(sin_half, &[], |θ| [(θ / 2.0).cos() / 2.0, -(θ / 2.0).sin() / 4.0], x)?;
        check(quadratic, &[1.5, rest], |θ| [3.0 * (θ - rest), 3.0], x)?;
        let of_bridson = |θ: f64| [1.5 * ((θ / 2.0).sin() - (rest / 2.0).sin()), 0.75 * (θ / 2.0).cos()];
        check(bridson, &[1.5, rest], of_bridson, x)?;
        let wide = 8.0_f64.sqrt();
        check(arc, &[], |θ| [(θ / wide).cos(), -(θ / wide).sin() / wide], x)
    }
}

fn of_angle<E: Element>() -> Read {
    assert_eq!(E::DECLARATION.dihedral, Some([0, 1, 2, 3]));
    Read::new::<E>()
}

#[test]
fn any_hinge_is_made_definite_triangle_by_triangle() {
    let functions = Functions::new();
    on_random(&(points::<4>(), -2.0..2.0_f64), |(x, rest)| functions.check(&x, rest));
}

/// A rotation matrix.
const TURN: [Vector3<f64>; 3] = [[0.36, 0.48, -0.8], [-0.8, 0.6, 0.0], [0.48, 0.64, 0.6]];

/// Hinges that are nearly flat, nearly folded, obtuse, needles and of sizes from 1e-20 to 1e20.
#[test]
fn nasty_hinges_are_made_definite() {
    let mut x = Vec::new();
    for (height, foot) in [(0.8, 0.4), (1e-8, 0.3), (1e-4, 7.0), (0.5, -20.0), (1e8, 0.5), (3.0, 1.0)] {
        for angle in [1e-7_f64, 0.5, -2.9, std::f64::consts::PI - 1e-5] {
            let (sin, cos) = angle.sin_cos();
            for size in [1.0, 1e-20, 1e20] {
                let hinge: Hinge = [[foot, height, 0.0], [0.6, -0.9 * cos, 0.9 * sin], [0.0; 3], [1.0, 0.0, 0.0]];
                x.push(hinge.map(|point| point.map(|number| size * number)));
                // Turned, so that products of the needles' edges cancel.
                let turned =
                    [hinge[1], hinge[0], hinge[3], hinge[2]].map(|point| TURN.map(|row| size * dot(row, point)));
                x.push(turned);
            }
        }
    }
    Functions::new().check(&x, 0.3).unwrap();
}

/// Below and above the sizes whose products are representable, the nearest semi-definite matrix is taken.
#[test]
fn extreme_hinges_have_the_nearest_definite_hessian() {
    let hinge = [[0.4, 0.8, 0.1], [0.6, -0.9, 0.3], [0.0; 3], [1.0, 0.1, 0.0]];
    for size in [1e-100, 1e100] {
        let x = [hinge.map(|point| point.map(|number| size * number)); 3];
        let elements = [QuadraticHinge { k: 1.5, θ0: 0.3 }; 3];
        let (exact, _) = hessians(compiled::<_, 4>(&elements), &x, Curvature::Exact);
        for (curvature, change) in
            [(Curvature::Clamped, (|value| value.max(0.0)) as fn(f64) -> f64), (Curvature::Absolute, f64::abs)]
        {
            let (found, counts) = hessians(compiled::<_, 4>(&elements), &x, curvature);
            assert_eq!(counts.hessian.projected, 3);
            for (found, exact) in found.iter().zip(&exact) {
                let unit = size * size;
                let nearest = with_eigenvalues(&(exact * unit), change);
                let error = (found * unit - &nearest).amax();
                assert!(error <= 1e-12 * nearest.amax(), "{size:e}, {curvature:?}: off by {error:e}");
            }
        }
    }
}

#[test]
fn definite_and_degenerate_hinges_keep_their_bits() {
    let flat = [[0.4, 0.8, 0.0], [0.6, -0.9, 0.0], [0.0; 3], [1.0, 0.0, 0.0]];
    // Rotated, so that the angle has a rounding error.
    let turned = flat.map(|[a, b, c]| [0.6 * a - 0.8 * b, 0.8 * a + 0.6 * b, 0.3 * a + c]);
    let bent = turned.map(|[a, b, c]| [a, b, c + 0.2 * a * a]);
    let angle = HingeAngle::new().value(&bent).value;
    let degenerate = [[0.5, 0.0, 0.0], [0.6, -0.9, 0.1], [0.0; 3], [1.0, 0.0, 0.0]];
    let x = [flat, turned, bent, bent, degenerate];
    let rest = [0.0, 0.0, angle, angle * (1.0 + 1e-15), 0.4];
    let elements = rest.map(|θ0| QuadraticHinge { k: 1.5, θ0 });
    let (exact, _) = hessians(compiled::<_, 4>(&elements), &x, Curvature::Exact);
    for curvature in [Curvature::Clamped, Curvature::Absolute] {
        let (found, counts) = hessians(compiled::<_, 4>(&elements), &x, curvature);
        assert_eq!(counts.hessian.projected, 0);
        assert_eq!(found, exact);
    }
}

/// Hinges that are changed, that fall back and that keep their bits.
#[test]
fn lanes_of_hinges_do_not_affect_each_other() {
    let hinge = [[0.4, 0.8, 0.3], [0.6, -0.9, 0.4], [0.0; 3], [1.0, 0.1, 0.0]];
    let tiny = hinge.map(|point| point.map(|number| 1e-90 * number));
    let degenerate = [[0.5, 0.0, 0.0], [0.6, -0.9, 0.1], [0.0; 3], [1.0, 0.0, 0.0]];
    let soft = QuadraticHinge { k: -1.5, θ0: 0.3 };
    let rest = QuadraticHinge { k: 1.5, θ0: HingeAngle::new().value(&hinge).value };
    let stiff = QuadraticHinge { k: 1.5, θ0: 0.3 };
    let elements = [stiff, stiff, soft, stiff, rest];
    let x = [hinge, tiny, hinge, degenerate, hinge];
    for curvature in [Curvature::Clamped, Curvature::Absolute] {
        let (together, counts) = hessians(compiled::<_, 4>(&elements), &x, curvature);
        assert_eq!(counts.hessian.projected, 3);
        for (number, together) in together.iter().enumerate() {
            let (alone, _) = hessians(compiled::<_, 4>(&elements[number..=number]), &x[number..=number], curvature);
            assert_eq!(&alone[0], together, "{curvature:?}, element {number}");
        }
        // In every lane, among definite ones.
        for lane in 0..COUNT {
            let mut elements = [rest; COUNT];
            elements[lane] = soft;
            let (shifted, _) = hessians(compiled::<_, 4>(&elements), &[hinge; COUNT], curvature);
            assert_eq!(shifted[lane], together[2], "{curvature:?}, lane {lane}");
        }
    }
}
