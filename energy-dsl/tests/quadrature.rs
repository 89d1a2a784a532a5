//! Sums of like terms: an element with eight quadrature points equals eight elements of one point each, and its terms
//! are a loop in the generated code.

use energy_compiler::Interpreted;
use energy_dsl::{Element, Inputs, Outputs, Potential, energy};

energy! {
    fn slope(a, b, c, r, s, t) {
        vector(a * (1 + b * s) * (1 + c * t), b * (1 + a * r) * (1 + c * t), c * (1 + a * r) * (1 + b * s)) / 8
    }
    fn jacobian(x, r, s, t) {
        let a = [-1, 1, 1, -1, -1, 1, 1, -1];
        let b = [-1, -1, 1, 1, -1, -1, 1, 1];
        let c = [-1, -1, -1, -1, 1, 1, 1, 1];
        sum(j in 0..8, outer(x[j] - x[0], slope(a[j], b[j], c[j], r, s, t)))
    }
    fn density(F, λ, μ) {
        let log_J = log(det(F));
        μ / 2 * (ddot(F, F) - 3) - μ * log_J + λ / 2 * log_J^2
    }

    /// A neo-Hookean brick.
    energy Brick(x: [Point; 8]; rest X: [Point; 8]; λ, μ: Scalar) {
        const g = 0.5773502691896258;
        let r = [-1, 1, -1, 1, -1, 1, -1, 1];
        let s = [-1, -1, 1, 1, -1, -1, 1, 1];
        let t = [-1, -1, -1, -1, 1, 1, 1, 1];
        rest {
            let D = [
                jacobian(X, -g, -g, -g), jacobian(X, g, -g, -g), jacobian(X, -g, g, -g), jacobian(X, g, g, -g),
                jacobian(X, -g, -g, g), jacobian(X, g, -g, g), jacobian(X, -g, g, g), jacobian(X, g, g, g)
            ];
            let V = [det(D[0]), det(D[1]), det(D[2]), det(D[3]), det(D[4]), det(D[5]), det(D[6]), det(D[7])];
            let B = [
                inverse(D[0]), inverse(D[1]), inverse(D[2]), inverse(D[3]),
                inverse(D[4]), inverse(D[5]), inverse(D[6]), inverse(D[7])
            ];
        }
        sum(q in 0..8, V[q] * density(jacobian(x, g * r[q], g * s[q], g * t[q]) * B[q], λ, μ))
    }

    /// The same at one quadrature point.
    energy Point(x: [Point; 8]; rest X: [Point; 8], at: Vec3; λ, μ: Scalar) {
        rest {
            let place = at;
            let D = jacobian(X, at.x, at.y, at.z);
            let B = inverse(D);
            let V = det(D);
        }
        V * density(jacobian(x, place.x, place.y, place.z) * B, λ, μ)
    }
}

type Points = [[f64; 3]; 8];

fn shapes() -> (Points, Points) {
    let rest: Points = std::array::from_fn(|j| {
        let sign = |odd: bool| if odd { 1.0 } else { -1.0 };
        let corner = [sign(matches!(j % 4, 1 | 2)), sign(j % 4 > 1), sign(j > 3)];
        corner.map(|c| c + 0.05 * (1.7 * j as f64 + c).sin())
    });
    let moved = rest.map(|[a, b, c]| [1.1 * a + 0.1 * b, 0.9 * b + 0.05 * (3.0 * a).sin(), 1.05 * c + 0.1 * a * b]);
    (rest, moved)
}

fn single_points(rest: Points) -> [Point; 8] {
    let g = 1.0 / 3.0_f64.sqrt();
    let sign = |bit: usize| if bit == 0 { -g } else { g };
    std::array::from_fn(|q| {
        let at = [sign(q & 1), sign(q >> 1 & 1), sign(q >> 2)];
        Point::new(rest, at, 3.0, 2.0).expect("a sound rest shape")
    })
}

fn assert_near(found: f64, expected: f64) {
    assert!((found - expected).abs() <= 1e-13 * (1.0 + expected.abs()), "{found} is not {expected}");
}

#[test]
fn a_sum_over_quadrature_points_adds_their_derivatives() {
    let (rest, x) = shapes();
    let brick = Brick::new(rest, 3.0, 2.0).expect("a sound rest shape");
    let points = single_points(rest);
    let v: Points = std::array::from_fn(|j| [0.3, -0.2, 0.1].map(|c| c * j as f64));
    let (all, product) = (brick.hessian(&x), brick.hessian_vector(&x, &v));
    let parts = points.map(|point| (point.hessian(&x), point.hessian_vector(&x, &v)));
    let sum = |number: &dyn Fn(usize) -> f64| (0..8).map(number).sum::<f64>();
    assert_near(all.value, sum(&|q| parts[q].0.value));
    assert_near(brick.value(&x).value, all.value);
    assert_near(brick.gradient(&x).gradient[6][1], all.gradient[6][1]);
    for axis in 0..3 {
        for j in 0..8 {
            assert_near(all.gradient[j][axis], sum(&|q| parts[q].0.gradient[j][axis]));
            assert_near(product.product[j][axis], sum(&|q| parts[q].1.product[j][axis]));
        }
        for (number, block) in all.hessian.iter().enumerate() {
            (0..3).for_each(|column| {
                assert_near(block[axis][column], sum(&|q| parts[q].0.hessian[number][axis][column]));
            });
        }
    }
}

#[test]
fn a_flag_of_one_term_is_a_flag_of_the_sum() {
    let (rest, mut x) = shapes();
    let brick = Brick::new(rest, 3.0, 2.0).expect("a sound rest shape");
    assert!(!brick.hessian(&x).flags.any());
    // Inverts the neighbourhood of one corner: the logarithm of the volume there is not a number.
    x[6] = [-1.5, -1.5, -1.5];
    let flagged = single_points(rest).iter().filter(|point| point.value(&x).flags.any()).count();
    assert!((1..8).contains(&flagged), "{flagged} points");
    assert!(brick.value(&x).flags.any() && brick.hessian(&x).flags.any());
    // No term overflows, but their sum does.
    let stiff = Brick::new(rest, 0.0, 2e307).expect("a sound rest shape");
    let (rest_shape, x) = shapes();
    assert_eq!(rest_shape, rest);
    let scaled = x.map(|point| point.map(|c| 2.0 * c));
    let parts = single_points(rest).map(|point| Point { μ: 2e307, λ: 0.0, ..point }.value(&scaled));
    assert!(parts.iter().all(|part| part.value.is_finite() && !part.flags.any()), "{parts:?}");
    assert!(stiff.value(&scaled).flags.any());
}

/// The brick as text runs the same loop over its tape: ordinary, with an inverted corner, and where the sum overflows.
#[test]
fn a_tape_runs_the_loop_with_the_same_bits() {
    let read = Interpreted::from_source(&<Brick as Element>::DECLARATION.source).unwrap().pop().unwrap();
    let (rest, x) = shapes();
    let mut inverted = x;
    inverted[6] = [-1.5, -1.5, -1.5];
    let scaled = x.map(|point| point.map(|c| 2.0 * c));
    for (x, parameters) in [(x, [3.0, 2.0]), (inverted, [3.0, 2.0]), (scaled, [0.0, 2e307])] {
        let (rest, positions) = (rest.as_flattened(), x.as_flattened());
        let inputs = Inputs { parameters: &parameters, rest, positions, velocities: &[] };
        let numbers = |outputs: Outputs<f64>| {
            let flags = outputs.flags.map(|flags| (flags.degenerate, flags.kink));
            let blocks = outputs.blocks.into_iter().flat_map(|(_, numbers)| numbers);
            (blocks.map(|x| if x.is_nan() { u64::MAX } else { x.to_bits() }).collect::<Vec<_>>(), flags)
        };
        let compiled = <Brick as Element>::evaluate(&inputs).unwrap();
        assert_eq!(numbers(compiled), numbers(read.evaluate(&inputs).unwrap()), "{positions:?}");
    }
}

#[test]
fn a_degenerate_brick_is_refused() {
    let (mut rest, _) = shapes();
    rest.swap(0, 6);
    assert!(Brick::new(rest, 3.0, 2.0).is_err());
}

#[test]
fn all_terms_are_counted() {
    let operations = |declaration: &energy_dsl::Declaration| {
        let hessian = declaration.routines.iter().find(|routine| routine.name == "hessian");
        hessian.expect("an energy has a Hessian").full.total()
    };
    let (brick, point) = (operations(<Brick as Element>::DECLARATION), operations(<Point as Element>::DECLARATION));
    assert!(brick > 6 * point && brick < 9 * point, "{brick} in eight points, {point} in one");
}
