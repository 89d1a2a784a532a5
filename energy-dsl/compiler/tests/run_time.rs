//! Elements that are read at run time: their descriptions and their refusals.

use energy_compiler::{InputKind, Interpreted};
use energy_runtime::tape::{Column, TAPE_BLOCK};

const SPRING: &str = "energy Spring(p, q: Point; k: Scalar[N/m], L: Scalar[m]) { k / 2 * (norm(p - q) - L)^2 }";
const STRIP: &str = "energy Strip(p, q: Point; rest u: Vec2; k: Scalar) {
    rest { let per = 1 / norm_squared(u); }
    k * per * norm_squared(p - q)
}";

fn read(source: &str) -> Interpreted {
    Interpreted::from_source(source).expect("a sound text").remove(0)
}

#[test]
fn inputs_have_names_kinds_shapes_and_units() {
    let spring = read(SPRING);
    let found: Vec<_> = spring.inputs().iter().map(|i| (&*i.name, i.kind, &i.shape[..], &*i.unit)).collect();
    let point = |name| (name, InputKind::Point, &[3][..], "m");
    let parameter = |name, unit| (name, InputKind::Parameter, &[][..], unit);
    assert_eq!(found[2..], [parameter("k", "N/m"), parameter("L", "m")]);
    assert_eq!(
        found[..2].iter().map(|i| (i.0, i.1, i.2)).collect::<Vec<_>>(),
        ["p", "q"].map(|n| {
            let (name, kind, shape, _) = point(n);
            (name, kind, shape)
        })
    );
    assert_eq!((spring.coordinates(), spring.reduced_coordinates()), (6, 3));
    let again = read(SPRING);
    assert_eq!(spring.declaration(), again.declaration());
}

#[test]
fn ranges_are_the_whole_in_both_precisions() {
    let count = TAPE_BLOCK + 7;
    let lengths: Vec<f64> = (0..count).map(|i| 0.5 + 0.01 * i as f64).collect();
    let springs = read(SPRING).elements(count, &[], &[Column::Same(&[2.0]), Column::Each(&lengths)]).unwrap();
    let x: Vec<f64> = (0..6 * count).map(|i| (0.7 * i as f64).sin()).collect();
    let run = |range: std::ops::Range<usize>| {
        let n = range.len();
        let (mut e, mut g, mut h) = (vec![0.0; n], vec![0.0; 6 * n], vec![0.0; 36 * n]);
        let x = &x[6 * range.start..6 * range.end];
        assert!(springs.hessians(range, x, &mut e, &mut g, &mut h).unwrap().is_empty());
        (e, g, h)
    };
    let (whole, first, last) = (run(0..count), run(0..TAPE_BLOCK), run(TAPE_BLOCK..count));
    assert_eq!(whole.0, [first.0, last.0].concat());
    assert_eq!(whole.1, [first.1, last.1].concat());
    assert_eq!(whole.2, [first.2, last.2].concat());
    let h = &whole.2[36 * 9..][..36];
    assert!((0..36).all(|i| h[i] == h[i % 6 * 6 + i / 6]), "the Hessian is symmetric: {h:?}");
    let single = |numbers: &[f64]| numbers.iter().map(|&x| x as f32).collect::<Vec<f32>>();
    let lengths = single(&lengths);
    let singles = read(SPRING).elements(count, &[], &[Column::Same(&[2.0]), Column::Each(&lengths)]).unwrap();
    let mut energies = vec![0.0_f32; count];
    singles.values(0..count, &single(&x), &mut energies).unwrap();
    let near = |(a, b): (&f64, &f32)| (a - f64::from(*b)).abs() < 1e-6 * (1.0 + a.abs());
    assert!(whole.0.iter().zip(&energies).all(near));
    assert!(springs.values(0..0, &[], &mut []).unwrap().is_empty());
}

#[test]
fn what_does_not_fit_is_refused_with_the_expected_size() {
    let spring = read(SPRING);
    let refused = |columns: &[Column<'_, f64>]| spring.elements(3, &[], columns).unwrap_err().to_string();
    assert_eq!(refused(&[]), "Spring: 0 columns for the parameters; expected one for each input: k, L");
    let short = refused(&[Column::Same(&[1.0]), Column::Each(&[1.0, 2.0])]);
    assert_eq!(short, "Spring: 2 numbers for `L`; expected 3");
    let springs = spring.elements(3, &[], &[Column::Same(&[1.0]), Column::Same(&[1.0])]).unwrap();
    let (mut e, x) = ([0.0; 3], [0.0; 18]);
    let error =
        |result: Result<_, energy_compiler::EvaluateError>| result.map(|_: energy_runtime::Flagged| ()).unwrap_err();
    let text = error(springs.values(1..3, &x[..12], &mut e[..2])).to_string();
    assert!(text.starts_with("1..3 of 3 elements: a range starts at a multiple of 64"), "{text}");
    let text = error(springs.values(0..3, &x[..17], &mut e)).to_string();
    assert_eq!(text, "17 numbers for the coordinates: expected 18");
    let text = error(springs.values(0..3, &x, &mut e[..2])).to_string();
    assert!(text.starts_with("2 places for 3 numbers of the energies"), "{text}");
    let text = error(springs.residuals(0..3, &x, &mut e)).to_string();
    assert!(text.starts_with("Spring: no `residual` of this energy; it has value, gradient"), "{text}");
    assert!(text.contains(" hessian") && !text.contains("reduced"), "{text}");
    // Coincident ends of a spring with a rest length have no direction.
    let flagged = springs.values(0..3, &x, &mut e).unwrap();
    assert!(flagged.is_empty() && e == [0.5; 3], "{flagged:?} {e:?}");
    let flagged = springs.gradients(0..3, &x, &mut e, &mut [0.0; 18]).unwrap();
    assert!(flagged.len() == 3 && flagged.iter().all(|(_, flags)| flags.degenerate), "{flagged:?}");
    let sound = [1.0, 0.0, 0.0, 0.0];
    let error = read(STRIP).elements::<f64>(2, &[Column::Each(&sound)], &[Column::Same(&[1.0])]).unwrap_err();
    assert!(error.to_string().starts_with("element 1: Strip: the rest shape is degenerate"), "{error}");
}

/// Elements whose energy depends on points through one dihedral angle only say of which points.
#[test]
fn functions_of_one_dihedral_angle_are_recognised() {
    let of_hinge = |formula: &str| {
        let source = format!(
            "energy Bend(x1, x2, x3, x4: Point; k, θ0: Scalar) {{
                let θ = dihedral(x1, x2, x3, x4);
                ({formula}) + k * θ0
            }}"
        );
        read(&source).declaration().dihedral
    };
    for formula in [
        "θ",
        "k * (θ - θ0)^2",
        "cos(θ)",
        "1 - cos(θ)",
        "sin(θ / 2)",
        "k * (sin(θ / 2) - sin(θ0 / 2))^2",
        "cos(θ / 2)",
        "k * one_minus_cos(θ - θ0) + θ^3",
        "sqrt(8) * sin(θ / sqrt(8))",
        "if θ < θ0 { k * (θ - θ0)^2 } else { exp(θ) }",
        "if norm(x4 - x3) < θ0 { θ } else { 2 * θ }",
        "gradient(k * θ^3, k) + sin(2 * θ) * sin(θ)",
    ] {
        assert_eq!(of_hinge(formula), Some([0, 1, 2, 3]), "{formula}");
    }
    for formula in [
        "θ * norm(x4 - x3)",
        "θ^2 / norm_squared(x1 - x2)",
        "θ + dihedral(x2, x1, x4, x3)",
        "θ - dihedral(x1, x4, x3, x2)",
        "(θ - dihedral(x1, x4, x3, x2)) * sin(θ)",
        "θ * dihedral(x1, x3, x2, x4)",
        "θ^2 + dot(x1 - x2, x3 - x4)",
        "k * norm(gradient(θ, x1))",
        "θ + dot(x1, x1)",
    ] {
        assert_eq!(of_hinge(formula), None, "{formula}");
    }

    let of = |source: &str| read(source).declaration().dihedral;
    let permuted = "energy A(p, q, a, b: Point) { dihedral(a, b, q, p)^2 }";
    assert_eq!(of(permuted), Some([2, 3, 1, 0]), "the points have any order");
    let constraint = "constraint A(x1, x2, x3, x4: Point; θ0: Scalar) { dihedral(x1, x2, x3, x4) - θ0 }";
    assert_eq!(of(constraint), Some([0, 1, 2, 3]), "the energy of a constraint counts");
    for source in [
        "constraint A(x1, x2, x3, x4: Point) { [dihedral(x1, x2, x3, x4), norm(x1 - x2)] }",
        "energy A(x1, x2, x3: Point) { angle(x1 - x3, x2 - x3) }",
        "energy A(x1, x2, x3: Point) { dihedral(x1, x1, x2, x3) }",
        "energy A(x1, x2, x3: Point; x4: Vec3) { dihedral(x1, x2, x3, x4) }",
        "energy A(x1, x2, x3, x4: Point) { dihedral(2 * x1, x2, x3, x4) }",
        "energy A(x1, x2, x3, x4: Point) { dihedral(2 * (x4 - x3), x1 - x3, x3 - x3, x2 - x3) }",
        "energy A(x1, x2: Point; rest X: Vec3) {
            rest { let s = dihedral(X, 2 * X, 3 * X, X); }
            s * norm(x1 - x2)
        }",
        "force A(x1, x2, x3, x4: Point) { let g = gradient(dihedral(x1, x2, x3, x4), x1); [g, g, g, g] }",
    ] {
        assert_eq!(of(source), None, "{source}");
    }
}
