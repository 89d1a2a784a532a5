//! Operation counts for energy, gradient and reduced Hessian on the ordinary path. A fused multiply-add counts as two,
//! an exact rounding-error term as one. The tests of the ordinary path are included: that its results are finite, and
//! that parameters are far from overflow.

use crate::catalogue::find;
use energy_dsl::Element;
use energy_dsl::energy;

energy! {
    /// The membrane as a function of the columns of F.
    energy OnF(f1, f2: Point; A: Scalar, λ, μ: Scalar) {
        let F = columns(f1, f2);
        let E = (transpose(F) * F - identity(2)) / 2;
        A * (μ * ddot(E, E) + λ / 2 * trace(E)^2)
    }
}

fn operations(declaration: &energy_dsl::Declaration, routine: &str) -> usize {
    declaration.routines.iter().find(|r| r.name == routine).unwrap().reduced.total()
}

#[test]
fn flat_bending_has_a_constant_hessian() {
    assert!(find("FlatBending").unwrap().declaration.quadratic);
    assert!(!find("NeoHookean").unwrap().declaration.quadratic);
}

#[test]
fn hessians_stay_small() {
    for (name, most) in [("HookeSpring", 68), ("HairBend", 190), ("QuadraticHinge", 540)] {
        let count = operations(find(name).unwrap().declaration, "hessian");
        assert!(count <= most, "{name}: {count} operations, expected at most {most}");
    }
    let count = operations(<OnF as Element>::DECLARATION, "hessian");
    assert!(count <= 200, "StVK on F: {count} operations");
    // Vectors that a rotation preserves are not rotated, and a blend uses each weight five times.
    let count = operations(find("PointToPlane").unwrap().declaration, "jacobian");
    assert!(count <= 820, "point to plane: {count} operations");
}

#[test]
fn routines_leave_out_what_was_not_asked_for() {
    for entry in crate::catalogue::ELEMENTS.iter().filter(|e| e.declaration.curved) {
        let declaration = entry.declaration;
        if !declaration.routines.iter().any(|r| r.name == "hessian") {
            continue;
        }
        let [value, gradient, hessian, product] =
            ["value", "gradient", "hessian", "hessian_vector"].map(|routine| operations(declaration, routine));
        assert!(value < gradient && gradient <= hessian, "{}: {value}, {gradient}, {hessian}", declaration.name);
        // Upper bound: the Hessian and one product with it.
        let multiplied = 2 * declaration.reduced_coordinates * (declaration.reduced_coordinates + 1);
        assert!(product <= hessian + multiplied, "{}: {product} for the product, {hessian} for all", declaration.name);
    }
    let membrane = find("StVK").unwrap().declaration;
    assert!(10 * operations(membrane, "hessian_vector") < 7 * operations(membrane, "hessian"));
}

/// Reverse accumulation contracts a row of the blend to eight numbers before it carries them to the nodes. The planner
/// finds this in spite of the sign choices in between.
#[test]
fn a_row_of_the_data_term_grows_with_its_nodes_only() {
    let jacobian = |name| operations(find(name).unwrap().declaration, "jacobian");
    let (four, eight) = (jacobian("NonrigidPlane4"), jacobian("NonrigidPlane8"));
    assert!(four <= 890, "{four} operations for four nodes");
    assert!(eight <= 2 * four, "{eight} operations for eight nodes, {four} for four");
}
