//! The cost of `#[uncompensated]`, against multi-precision: near rest, its errors are those of rounding the points
//! instead of the result.

use energy_compiler::{Interpreted, Textbook};
use verify::multiprecision::truth;
use verify::{BlockName, Sample, evaluate};

const SPRING: &str = "energy Spring(p, q: Point; k: Scalar[N/m], L: Scalar[m]) { k / 2 * (norm(q - p) - L)^2 }";
const HINGE: &str =
    "energy Hinge(x1, x2, x3, x4: Point; k: Scalar[J], θ0: Scalar[rad]) { k * (dihedral(x1, x2, x3, x4) - θ0)^2 }";

/// Returns the gradient's error in units of roundoff of its largest entry, with compensation and without.
fn errors(source: &str, parameters: &[f64], positions: Vec<f64>) -> [f64; 2] {
    let sample = Sample { parameters: parameters.into(), rest: vec![], positions, velocities: vec![] };
    let formula = Textbook::from_source(source).unwrap();
    ["", "#[uncompensated] "].map(|attribute| {
        let element = Interpreted::from_source(&format!("{attribute}{source}")).unwrap().remove(0);
        let answer = evaluate(element.declaration(), |inputs| element.evaluate(inputs), &sample.inputs()).unwrap();
        let truth = truth(element.declaration(), &formula, &sample, 30);
        let gradient = truth.iter().find(|block| block.block.name == BlockName::Gradient).unwrap();
        gradient.error_in_roundoffs(&answer.block(BlockName::Gradient).numbers)
    })
}

/// Returns a point in a frame along no axis, about a unit away from the origin.
fn point(along: f64, across: f64, up: f64) -> [f64; 3] {
    let axes = [[2.0, 3.0, 6.0], [3.0, -6.0, 2.0], [6.0, 2.0, -3.0]];
    std::array::from_fn(|i| 0.3 + (along * axes[0][i] + across * axes[1][i] + up * axes[2][i]) / 7.0)
}

/// Checks the error for inputs that `positions` brings to given values of a quantity. Without compensation, it grows
/// with 1/value.
fn check(source: &str, parameters: &[f64], positions: impl Fn(f64) -> Vec<f64>) {
    let mut worst = 0.0_f64;
    for exponent in 1..=12 {
        let value = 1.37 * 10.0_f64.powi(-exponent);
        let [compensated, plain] = errors(source, parameters, positions(value));
        assert!(compensated <= 12.0, "{source} at {value:e}: {compensated} u");
        assert!(plain <= 64.0 / value, "{source} at {value:e}, uncompensated: {plain:e} u");
        worst = worst.max(plain);
    }
    assert!(worst > 1e6, "{source}: uncompensated, the error grows near rest, but it is {worst:e} u at most");
}

#[test]
fn an_uncompensated_spring_is_as_exact_as_its_points_are_rounded() {
    check(SPRING, &[5.0, 1.0], |strain| [point(0.0, 0.0, 0.0), point(1.0 + strain, 0.0, 0.0)].concat());
}

#[test]
fn an_uncompensated_hinge_is_as_exact_as_its_points_are_rounded() {
    check(HINGE, &[5.0, 0.0], |angle: f64| {
        let (sine, cosine) = angle.sin_cos();
        [point(0.3, 1.0, 0.0), point(0.6, -cosine, sine), point(0.0, 0.0, 0.0), point(1.0, 0.0, 0.0)].concat()
    });
}

#[test]
fn undeformed_elements_have_exactly_zero_energy() {
    let flat = [[0.3, 1.0, 0.7], [0.6, -1.0, 0.7], [0.0, 0.0, 0.7], [1.0, 0.0, 0.7]].concat();
    for (source, parameters, positions) in
        [(SPRING, [5.0, 1.5], vec![0.25, 1.0, 2.0, 0.25, 1.0, 3.5]), (HINGE, [5.0, 0.0], flat)]
    {
        let element = Interpreted::from_source(&format!("#[uncompensated] {source}")).unwrap().remove(0);
        let sample = Sample { parameters: parameters.into(), rest: vec![], positions, velocities: vec![] };
        let answer = evaluate(element.declaration(), |inputs| element.evaluate(inputs), &sample.inputs()).unwrap();
        assert!(answer.block(BlockName::Energy).numbers[0] == 0.0, "{source}");
        assert!(answer.block(BlockName::Gradient).numbers.iter().all(|&g| g == 0.0), "{source}");
    }
}

#[test]
fn the_attribute_is_part_of_the_source() {
    let spring =
        Interpreted::from_source(&format!("#[uncompensated] {SPRING} energy Stiff = Spring(k = 100);")).unwrap();
    for element in &spring {
        let source = &element.declaration().source;
        let again = Interpreted::from_source(source).unwrap();
        assert_eq!(again[0].declaration().routines, element.declaration().routines, "{source}");
    }
    let compensated = Interpreted::from_source(SPRING).unwrap().remove(0);
    assert!(spring[0].declaration().routines[0].full.total() < compensated.declaration().routines[0].full.total());
}
