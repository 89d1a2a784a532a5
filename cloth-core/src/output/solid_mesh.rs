//! Triangle meshes of solids, for pictures and animations.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use energy_dsl::Vector3;

use crate::contact::{AnySolid, Ball, Capsule, HalfSpace, MeshSolid, RoundedBox};
use crate::geometry::{cross, norm, subtract};

/// The surface of a solid.
#[derive(Clone, Debug, PartialEq)]
pub struct SolidMesh {
    /// Vertices, in m.
    pub vertices: Vec<Vector3<f64>>,
    /// Triangles, anticlockwise seen from outside.
    pub triangles: Vec<[usize; 3]>,
}

/// Segments around a ball; from pole to pole it has half as many.
const AROUND: usize = 64;
/// Points along an edge of a rounded box before rounding. Even, so that no point lies in the middle.
const ALONG: usize = 12;
/// Cells along a side of the visible part of a plane.
const CELLS: usize = 24;

impl SolidMesh {
    /// Builds the surface of a solid. For a half-space, builds a square with side `size` in m, centred on the point of
    /// the plane nearest to `centre`.
    #[must_use]
    pub fn of(solid: &AnySolid, centre: Vector3<f64>, size: f64) -> Self {
        match solid {
            AnySolid::HalfSpace(solid) => plane(solid, centre, size),
            AnySolid::Ball(Ball { centre, radius }) => capsule(&Capsule { ends: [*centre; 2], radius: *radius }),
            AnySolid::Capsule(solid) => capsule(solid),
            AnySolid::Box(solid) => rounded_box(solid),
            AnySolid::Mesh(solid) => surface(solid),
        }
    }
}

/// Returns two unit vectors that form a right-handed basis with a direction.
fn across(direction: Vector3<f64>) -> [Vector3<f64>; 2] {
    let least = (0..3).min_by(|&a, &b| direction[a].abs().total_cmp(&direction[b].abs())).unwrap_or(0);
    let mut axis = [0.0; 3];
    axis[least] = 1.0;
    let first = cross(axis, direction);
    let first = first.map(|component| component / norm(first));
    [first, cross(direction, first)]
}

fn plane(solid: &HalfSpace, centre: Vector3<f64>, size: f64) -> SolidMesh {
    let [u, v] = across(solid.normal);
    let height = crate::geometry::dot(solid.normal, subtract(centre, solid.point));
    let middle: Vector3<f64> = std::array::from_fn(|axis| centre[axis] - height * solid.normal[axis]);
    let at = |step: usize| size * (step as f64 / CELLS as f64 - 0.5);
    let point = |row: usize, column: usize| -> Vector3<f64> {
        std::array::from_fn(|axis| middle[axis] + at(column) * u[axis] + at(row) * v[axis])
    };
    grid(CELLS + 1, CELLS + 1, point)
}

/// Builds a rectangular grid of points with two triangles per cell.
fn grid(rows: usize, columns: usize, point: impl Fn(usize, usize) -> Vector3<f64>) -> SolidMesh {
    let vertices = (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column)));
    let vertices = vertices.map(|(row, column)| point(row, column)).collect();
    let mut triangles = Vec::new();
    for row in 0..rows - 1 {
        for column in 0..columns - 1 {
            let a = row * columns + column;
            triangles.extend([[a, a + 1, a + columns + 1], [a, a + columns + 1, a + columns]]);
        }
    }
    SolidMesh { vertices, triangles }
}

/// Builds a capsule: a ball, cut at its equator, with the halves at the ends.
fn capsule(solid: &Capsule) -> SolidMesh {
    let [a, b] = solid.ends;
    let way = subtract(b, a);
    let axis = if norm(way) > 0.0 { way.map(|component| component / norm(way)) } else { [0.0, 0.0, 1.0] };
    let [u, v] = across(axis);
    let half = AROUND / 4;
    // Rows run from the pole at a to the pole at b, with the equator twice to join the halves.
    let apart = usize::from(a != b);
    let point = |row: usize, column: usize| -> Vector3<f64> {
        let (end, step) = if row <= half { (a, row) } else { (b, row - apart) };
        let latitude = PI * step as f64 / (2 * half) as f64 - FRAC_PI_2;
        let (sine, cosine) = (TAU * column as f64 / AROUND as f64).sin_cos();
        let (up, out) = latitude.sin_cos();
        std::array::from_fn(|i| end[i] + solid.radius * (up * axis[i] + out * (cosine * u[i] + sine * v[i])))
    };
    let mut mesh = grid(2 * half + 1 + apart, AROUND + 1, point);
    // Join the last column to the first, so that shading is continuous.
    for corner in mesh.triangles.as_flattened_mut() {
        *corner -= if *corner % (AROUND + 1) == AROUND { AROUND } else { 0 };
    }
    mesh
}

/// Builds the surface of a mesh solid, offset by its rounding. For a shell, builds the front side only.
fn surface(solid: &MeshSolid) -> SolidMesh {
    let (mesh, radius) = (solid.surface().mesh(), solid.surface().radius());
    let normals = super::vertex_normals(mesh.vertices(), mesh.triangles());
    let moved = |(p, n): (&Vector3<f64>, Vector3<f64>)| -> Vector3<f64> {
        solid.transform(std::array::from_fn(|axis| p[axis] + radius * n[axis]))
    };
    SolidMesh {
        vertices: mesh.vertices().iter().zip(normals).map(moved).collect(),
        triangles: mesh.triangles().to_vec(),
    }
}

/// Builds a rounded box from the faces of a cube: each point is projected onto a ball, then moved to its corner of the
/// box.
fn rounded_box(solid: &RoundedBox) -> SolidMesh {
    let mut all = SolidMesh { vertices: Vec::new(), triangles: Vec::new() };
    let points = if solid.radius > 0.0 { ALONG } else { 2 };
    for face in 0..6 {
        let (normal, side) = (face / 2, if face % 2 == 0 { 1.0 } else { -1.0 });
        let at = |step: usize| 2.0 * step as f64 / (points - 1) as f64 - 1.0;
        let point = |row: usize, column: usize| -> Vector3<f64> {
            let mut cube = [0.0; 3];
            cube[normal] = side;
            cube[(normal + 1) % 3] = side * at(column);
            cube[(normal + 2) % 3] = at(row);
            let length = norm(cube);
            let local: Vector3<f64> =
                std::array::from_fn(|i| solid.half[i].copysign(cube[i]) + solid.radius * cube[i] / length);
            std::array::from_fn(|i| solid.centre[i] + (0..3).map(|j| local[j] * solid.axes[j][i]).sum::<f64>())
        };
        let part = grid(points, points, point);
        let first = all.vertices.len();
        all.vertices.extend(part.vertices);
        all.triangles.extend(part.triangles.iter().map(|corners| corners.map(|corner| first + corner)));
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::dot;

    /// Returns the enclosed volume, ⅓ Σ of the cones over all triangles, if the surface is closed and points outwards.
    fn volume(mesh: &SolidMesh) -> f64 {
        let cone = |corners: &[usize; 3]| {
            let [a, b, c] = corners.map(|corner| mesh.vertices[corner]);
            dot(a, cross(b, c)) / 6.0
        };
        mesh.triangles.iter().map(cone).sum()
    }

    #[test]
    fn surfaces_lie_on_their_solids_and_enclose_their_volume() {
        let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let rounded = |radius| RoundedBox { centre: [0.3, -0.2, 0.5], axes, half: [1.0, 0.5, 0.25], radius };
        let r: f64 = 0.5;
        let ball = 4.0 / 3.0 * PI * r.powi(3);
        let of_rounded = 1.0 + 0.1 * 2.0 * (2.0 + 1.0 + 0.5) + PI * 0.01 * 3.5 + 4.0 / 3.0 * PI * 0.001;
        for (solid, exact) in [
            (AnySolid::Ball(Ball { centre: [0.1, 0.2, 0.3], radius: r }), ball),
            (AnySolid::Capsule(Capsule { ends: [[0.0; 3], [1.0, 2.0, -2.0]], radius: r }), ball + PI * r * r * 3.0),
            (AnySolid::Box(rounded(0.0)), 1.0),
            (AnySolid::Box(rounded(0.1)), of_rounded),
        ] {
            let mesh = SolidMesh::of(&solid, [0.0; 3], 1.0);
            let farthest = mesh.vertices.iter().map(|&p| solid.signed_distance(p).abs()).fold(0.0, f64::max);
            assert!(farthest < 1e-12, "{solid:?}: {farthest}");
            assert!((volume(&mesh) / exact - 1.0).abs() < 0.02, "{solid:?}: {} of {exact}", volume(&mesh));
        }
    }
}
