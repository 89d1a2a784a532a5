//! Routines of single vertices: the parts of gradient and Hessian that belong to one point.

use approx::assert_relative_eq;
use energy_dsl::{Potential, VertexPotential, triangle_index};

energy_dsl::energy! {
    /// Resists changes of a length.
    #[vertex]
    energy Spring(p, q: Point; k: Scalar[N/m], L: Scalar[m]) { k / 2 * (norm(p - q) - L)^2 }

    /// Resists changes of an angle.
    #[vertex]
    energy Hinge(x1, x2, x3, x4: Point; k: Scalar[J], θ0: Scalar[rad]) { k * (dihedral(x1, x2, x3, x4) - θ0)^2 }

    /// Resists strain, at three points of each element: a sum of like terms.
    #[vertex]
    energy Strained(x0, x1, x2: Point; rest u0, u1, u2: Vec2; μ: Scalar[N/m]) {
        rest { let B = inverse(columns(u1 - u0, u2 - u0)); let A = det(columns(u1 - u0, u2 - u0)) / 2; }
        let F = columns(x1 - x0, x2 - x0) * B;
        let E = (transpose(F) * F - identity(2)) / 2;
        μ * A * sum(j in 0..3, [1, 2, 3][j] * trace(E * E))
    }

    /// The same without routines of vertices.
    energy Plain(x0, x1, x2: Point; rest u0, u1, u2: Vec2; μ: Scalar[N/m]) {
        rest { let B = inverse(columns(u1 - u0, u2 - u0)); let A = det(columns(u1 - u0, u2 - u0)) / 2; }
        let F = columns(x1 - x0, x2 - x0) * B;
        let E = (transpose(F) * F - identity(2)) / 2;
        μ * A * sum(j in 0..3, [1, 2, 3][j] * trace(E * E))
    }
}

/// Points of a polygon that no symmetry of the formulas spares.
fn points<const N: usize>() -> [[f64; 3]; N] {
    std::array::from_fn(|i| {
        let t = i as f64;
        [(1.7 * t).sin() + 0.3 * t, (2.3 * t + 0.4).cos(), 0.2 * t * t - 0.5]
    })
}

/// Compares each vertex with the whole gradient and the diagonal blocks of the Hessian.
fn check<const N: usize, E: VertexPotential<f64> + Potential<f64, Points = [[f64; 3]; N]>>(element: &E) {
    let x = points::<N>();
    let whole = element.hessian(&x);
    for point in 0..N {
        let vertex = element.vertex(point, &x);
        assert!(!vertex.flags.any());
        assert_relative_eq!(vertex.value, whole.value, max_relative = 1e-14);
        let block = whole.hessian.as_ref()[triangle_index(N, point, point)];
        for row in 0..3 {
            let gradient = whole.gradient.as_ref()[point][row];
            assert_relative_eq!(vertex.gradient[row], gradient, max_relative = 1e-12, epsilon = 1e-13);
            for column in 0..3 {
                assert_relative_eq!(
                    vertex.block[row][column],
                    block[row][column],
                    max_relative = 1e-12,
                    epsilon = 1e-12
                );
                assert_eq!(vertex.block[row][column].to_bits(), vertex.block[column][row].to_bits());
            }
        }
    }
}

#[test]
fn vertices_have_their_parts_of_the_derivatives() {
    check(&Spring::new(3.0, 0.7));
    check(&Hinge::new(2.0, 0.3));
    check(&Strained::new([0.1, 0.0], [1.2, 0.1], [0.3, 0.9], 5.0).unwrap());
}

#[test]
fn singular_vertices_are_flagged() {
    let vertex = Spring::new(3.0, 0.7).vertex(0, &[[1.0, 2.0, 3.0]; 2]);
    assert!(vertex.flags.degenerate && vertex.gradient == [0.0; 3]);
}

/// A formula has the same bits with and without these routines.
#[test]
fn other_routines_keep_their_bits() {
    let rest = [[0.1, 0.0], [1.2, 0.1], [0.3, 0.9]];
    let [a, b, c] = rest;
    let (with, without) = (Strained::new(a, b, c, 5.0).unwrap(), Plain::new(a, b, c, 5.0).unwrap());
    let (with, without) = (with.hessian(&points()), without.hessian(&points()));
    assert_eq!(
        (with.value.to_bits(), with.gradient, with.hessian),
        (without.value.to_bits(), without.gradient, without.hessian)
    );
}

#[test]
#[should_panic(expected = "Spring has 2 points")]
fn a_point_that_does_not_exist_is_named() {
    Spring::new(3.0, 0.7).vertex(2, &points());
}
