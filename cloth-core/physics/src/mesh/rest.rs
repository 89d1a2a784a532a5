use energy_dsl::Vector3;

use super::TriangleMesh;
use super::topology::Hinge;
use crate::geometry::{cross, dot, norm, subtract};

/// A triangle at rest, in its own plane: material coordinates of its corners in m, anticlockwise.
pub type MaterialTriangle = [[f64; 2]; 3];

/// Maps a triangle to its plane: the first corner to the origin, the second to the positive first axis.
///
/// ```
/// use cloth_physics::mesh::material_triangle;
/// let laid = material_triangle([[1.0, 1.0, 1.0], [1.0, 1.0, 3.0], [1.0, 4.0, 1.0]]);
/// assert_eq!(laid, [[0.0, 0.0], [2.0, 0.0], [0.0, 3.0]]);
/// ```
#[must_use]
pub fn material_triangle([a, b, c]: [Vector3<f64>; 3]) -> MaterialTriangle {
    let (base, side) = (subtract(b, a), subtract(c, a));
    let length = norm(base);
    [[0.0; 2], [length, 0.0], [dot(base, side) / length, norm(cross(base, side)) / length]]
}

/// Maps a triangle to its plane, with the first corner at the origin and the first axis along the projected warp.
/// `None` if the warp is perpendicular to the triangle.
///
/// ```
/// use cloth_physics::mesh::thread_triangle;
/// let laid = thread_triangle([[0.0; 3], [0.0, 2.0, 0.0], [-3.0, 0.0, 0.0]], [1.0, 0.0, 0.5]).unwrap();
/// assert_eq!(laid, [[0.0, 0.0], [0.0, 2.0], [-3.0, 0.0]]);
/// assert_eq!(thread_triangle([[0.0; 3], [0.0, 2.0, 0.0], [-3.0, 0.0, 0.0]], [0.0, 0.0, 1.0]), None);
/// ```
#[must_use]
pub fn thread_triangle([a, b, c]: [Vector3<f64>; 3], warp: Vector3<f64>) -> Option<MaterialTriangle> {
    let (base, side) = (subtract(b, a), subtract(c, a));
    let normal = cross(base, side);
    let unit = |vector: Vector3<f64>| vector.map(|component| component / norm(vector));
    let across = cross(unit(normal), unit(warp));
    if norm(across).is_nan() || norm(across) < 1e-6 {
        return None;
    }
    let v = unit(across);
    let u = cross(v, unit(normal));
    Some([[0.0; 2], [dot(base, u), dot(base, v)], [dot(side, u), dot(side, v)]])
}

/// Returns the area of a triangle in space, ½ ‖(b − a) × (c − a)‖.
pub(crate) fn area([a, b, c]: [Vector3<f64>; 3]) -> f64 {
    0.5 * norm(cross(subtract(b, a), subtract(c, a)))
}

/// Returns the mass of each vertex, in kg: a third of σ A of each adjacent triangle, with the density σ in kg/m².
#[must_use]
pub fn lumped_masses(mesh: &TriangleMesh, density: f64) -> Vec<f64> {
    let mut masses = vec![0.0; mesh.vertices().len()];
    for (triangle, corners) in mesh.triangles().iter().enumerate() {
        let area = area(mesh.corners(triangle));
        for &corner in corners {
            masses[corner] += density * area / 3.0;
        }
    }
    masses
}

/// Returns the dihedral angle of a hinge at rest, in radians: in (−π, π], 0 if flat.
///
/// With E = x₄ − x₃, N₁ = E × (x₁ − x₃), N₂ = −E × (x₂ − x₃): cos θ = n₁·n₂, sin θ = (n₁ × n₂)·E/‖E‖.
#[must_use]
pub fn rest_angle(mesh: &TriangleMesh, hinge: &Hinge) -> f64 {
    dihedral_angle(mesh.hinge_at_rest(hinge))
}

/// Returns the angle of [`rest_angle`] for the points of a hinge.
pub(crate) fn dihedral_angle([x1, x2, x3, x4]: [Vector3<f64>; 4]) -> f64 {
    let edge = subtract(x4, x3);
    let (n1, n2) = (cross(edge, subtract(x1, x3)), cross(subtract(x2, x3), edge));
    (dot(cross(n1, n2), edge) / norm(edge)).atan2(dot(n1, n2))
}

/// Returns the angles of a triangle at its corners, in radians.
///
/// ```
/// let [a, b, c] = cloth_physics::mesh::vertex_angles([[0.0; 3], [2.0, 0.0, 0.0], [0.0, 2.0, 0.0]]);
/// assert!((a - 2.0 * b).abs() < 1e-15 && b == c);
/// ```
#[must_use]
pub fn vertex_angles(corners: [Vector3<f64>; 3]) -> [f64; 3] {
    std::array::from_fn(|corner| {
        let [here, next, last] = [0, 1, 2].map(|step| corners[(corner + step) % 3]);
        let (first, second) = (subtract(next, here), subtract(last, here));
        norm(cross(first, second)).atan2(dot(first, second))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_corner_carries_a_third_of_the_mass() {
        let vertices = vec![[0.0, 0.0, 1.0], [2.0, 0.0, 1.0], [2.0, 3.0, 1.0], [0.0, 3.0, 1.0]];
        let mesh = TriangleMesh::new(vertices, vec![[0, 1, 2], [0, 2, 3]]).unwrap();
        let masses = lumped_masses(&mesh, 0.5);
        assert_eq!(masses, [1.0, 0.5, 1.0, 0.5]);
        assert_eq!(masses.iter().sum::<f64>(), 0.5 * 6.0);
    }

    #[test]
    fn a_triangle_keeps_its_lengths_when_it_is_laid_into_its_plane() {
        let corners = [[0.3, -1.0, 0.5], [1.9, 0.4, 2.0], [-0.8, 0.7, 1.1]];
        let planes = [material_triangle(corners), thread_triangle(corners, [0.2, 1.0, -0.4]).unwrap()];
        for laid in planes {
            for [a, b] in [[0, 1], [1, 2], [2, 0]] {
                let length = norm(subtract(corners[b], corners[a]));
                let apart = (laid[b][0] - laid[a][0]).hypot(laid[b][1] - laid[a][1]);
                assert!((apart - length).abs() < 1e-14, "{apart} for {length}");
            }
            let [p, q] = [1, 2].map(|corner| laid[corner]);
            assert!((0.5 * (p[0] * q[1] - p[1] * q[0]) - area(corners)).abs() < 1e-14, "anticlockwise");
        }
    }
}
