//! The cores of solids, as the barrier sees them.

use energy_dsl::Vector3;

use super::{AnySolid, Ball, Capsule, HalfSpace, RoundedBox};
use crate::collision::Core;
use crate::geometry::{add_scaled, cross, norm};

/// The distance of the corners from the middle of the triangle that stands for a plane, in m. The inscribed circle has
/// half this radius.
const PLANE_SIZE: f64 = 1e4;

impl AnySolid {
    /// Returns the core of the solid: the solid holds all points within the core's radius of it. A plane is a triangle
    /// of several kilometres about its point.
    pub fn core(&self) -> Core {
        match self {
            Self::HalfSpace(plane) => plane.core(),
            Self::Ball(Ball { centre, radius }) => {
                Core { vertices: vec![*centre], segments: vec![[0, 0]], radius: *radius, ..Core::default() }
            }
            Self::Capsule(Capsule { ends, radius }) => {
                let (vertices, segments, faces) = (ends.to_vec(), vec![[0, 1]], vec![[0, 1, 1]]);
                Core { vertices, segments, faces, radius: *radius, ..Core::default() }
            }
            Self::Box(block) => block.core(),
            Self::Mesh(solid) => {
                let (mesh, radius) = (solid.surface().mesh(), solid.surface().radius());
                let vertices = mesh.vertices().iter().map(|vertex| solid.transform(*vertex)).collect();
                Core { vertices, triangles: mesh.triangles().to_vec(), radius, ..Core::default() }
            }
        }
    }
}

impl HalfSpace {
    /// Two orthogonal unit vectors in the plane.
    pub fn tangents(&self) -> [Vector3<f64>; 2] {
        let n = self.normal;
        let flattest = (0..3).min_by(|&i, &j| n[i].abs().total_cmp(&n[j].abs())).unwrap_or(0);
        let mut axis = [0.0; 3];
        axis[flattest] = 1.0;
        let across = cross(n, axis);
        let u = across.map(|component| component / norm(across));
        [u, cross(n, u)]
    }

    fn core(&self) -> Core {
        let [u, w] = self.tangents();
        let corner =
            |along: f64, across: f64| add_scaled(add_scaled(self.point, PLANE_SIZE * along, u), PLANE_SIZE * across, w);
        let half = 0.75_f64.sqrt();
        let vertices = vec![corner(1.0, 0.0), corner(-0.5, half), corner(-0.5, -half)];
        Core { vertices, faces: vec![[0, 1, 2]], ..Core::default() }
    }
}

impl RoundedBox {
    fn core(&self) -> Core {
        // Bit k of the number says on which side of axis k a corner lies.
        let corner = |number: usize| {
            (0..3).fold(self.centre, |at, k| {
                let side = if number >> k & 1 == 1 { self.half[k] } else { -self.half[k] };
                add_scaled(at, side, self.axes[k])
            })
        };
        let side = |axis: usize, far: usize| {
            let at = |u: usize, v: usize| far << axis | u << ((axis + 1) % 3) | v << ((axis + 2) % 3);
            let [a, b, c, d] = [at(0, 0), at(1, 0), at(1, 1), at(0, 1)];
            if far == 1 { [[a, b, c], [a, c, d]] } else { [[a, c, b], [a, d, c]] }
        };
        let sides = (0..6).flat_map(|number| side(number / 2, number % 2));
        let vertices = (0..8).map(corner).collect();
        Core { vertices, triangles: sides.collect(), radius: self.radius, ..Core::default() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{dot, subtract};

    #[test]
    fn the_sides_of_a_box_face_outwards() {
        let axes = [[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]];
        let block = RoundedBox { centre: [1.0, 2.0, 3.0], axes, half: [0.5, 0.2, 0.1], radius: 0.02 };
        let core = AnySolid::Box(block).core();
        assert_eq!((core.vertices.len(), core.triangles.len(), core.radius), (8, 12, 0.02));
        let area = |corners: [usize; 3]| {
            let [a, b, c] = corners.map(|corner| core.vertices[corner]);
            let normal = cross(subtract(b, a), subtract(c, a));
            assert!(dot(normal, subtract(a, block.centre)) > 0.0, "{corners:?}");
            0.5 * norm(normal)
        };
        let all: f64 = core.triangles.iter().map(|corners| area(*corners)).sum();
        assert!((all - 8.0 * (0.5 * 0.2 + 0.2 * 0.1 + 0.1 * 0.5)).abs() < 1e-12, "{all}");
    }

    #[test]
    fn a_plane_is_a_triangle_about_its_point() {
        let plane = HalfSpace { point: [1.0, -2.0, 0.5], normal: [0.6, 0.0, 0.8] };
        let core = AnySolid::HalfSpace(plane).core();
        for vertex in &core.vertices {
            let to = subtract(*vertex, plane.point);
            assert!((norm(to) - PLANE_SIZE).abs() < 1e-8 && dot(to, plane.normal).abs() < 1e-11, "{vertex:?}");
        }
    }
}
