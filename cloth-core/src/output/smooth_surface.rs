//! Smooth surfaces of meshes, for pictures: one patch per triangle, divided into smaller triangles.

use std::collections::HashMap;

use energy_dsl::Vector3;

use super::crease::{Creased, Edge};
use super::patch::Patch;
use super::subdivision::Subdivided;

/// Cosine of the angle from which on an edge of a solid is sharp.
const CREASE: f64 = 0.5;

/// A finer mesh on the smooth surface of another one.
#[derive(Debug, Default)]
pub(super) struct SmoothSurface {
    pub points: Vec<Vector3<f64>>,
    pub normals: Vec<Vector3<f64>>,
    pub triangles: Vec<[usize; 3]>,
    /// The corners of the patches.
    pub corners: Vec<PatchCorner>,
    pub patches: Vec<[usize; 3]>,
    /// Corners near each point, with weights that add up to one.
    pub origins: Vec<([usize; 3], [f32; 3])>,
    pub segments: Vec<Segment>,
}

/// A corner of patches.
#[derive(Clone, Copy, Debug)]
pub(super) struct PatchCorner {
    /// Its number among the points of the surface.
    pub point: usize,
    /// The vertices of the original mesh in whose middle it lies; twice the same one at a vertex.
    pub parents: [usize; 2],
}

/// A segment along an edge of a patch.
#[derive(Clone, Copy, Debug)]
pub(super) struct Segment {
    pub ends: [usize; 2],
    pub is_border: bool,
    /// Whether it lies on an edge of the original mesh.
    pub is_edge: bool,
}

impl SmoothSurface {
    /// Divides each triangle of a cloth into about `level`² triangles on the limit of its subdivision. Cloth has no
    /// creases: a fold is smooth, however tight.
    pub(super) fn of_cloth(points: &[Vector3<f64>], triangles: &[[usize; 3]], level: usize) -> Self {
        let mesh = if level > 1 { Subdivided::once(points, triangles) } else { Subdivided::none(points, triangles) };
        Self::of(&mesh.at_limit(), level.div_ceil(2), -1.0)
    }

    /// Divides each triangle of a solid into `level`² triangles on a surface through its vertices.
    pub(super) fn of_solid(points: &[Vector3<f64>], triangles: &[[usize; 3]], level: usize) -> Self {
        Self::of(&Subdivided::none(points, triangles), level, CREASE)
    }

    /// Divides triangles. Edges are sharp where the adjacent normals have a cosine below `crease`.
    fn of(mesh: &Subdivided, level: usize, crease: f64) -> Self {
        let Subdivided { points, triangles, parents } = mesh;
        let creased = Creased::of(points, triangles, crease);
        let originals = &creased.originals;
        let corner = |(point, &vertex): (usize, &usize)| PatchCorner { point, parents: parents[vertex] };
        let mut surface = Self {
            points: originals.iter().map(|&vertex| points[vertex]).collect(),
            normals: creased.normals.clone(),
            triangles: Vec::with_capacity(level * level * triangles.len()),
            corners: originals.iter().enumerate().map(corner).collect(),
            patches: creased.triangles.clone(),
            origins: (0..originals.len()).map(|corner| ([corner; 3], [1.0, 0.0, 0.0])).collect(),
            segments: Vec::new(),
        };
        let mut known = HashMap::new();
        for triangle in 0..triangles.len() {
            let patch = Patch::of(&creased, points, triangle);
            let edges = [0, 1, 2].map(|edge| {
                let ends = [edge, (edge + 1) % 3].map(|corner| creased.triangles[triangle][corner]);
                let key = (ends[0].min(ends[1]), ends[0].max(ends[1]));
                let first = *known.entry(key).or_insert_with(|| surface.add_edge(&patch, edge, level, &creased));
                (first, ends[0] < ends[1])
            });
            surface.add_patch(&patch, edges, level);
        }
        surface
    }

    /// Adds another surface.
    pub(super) fn append(&mut self, other: Self) {
        let (first, corner) = (self.points.len(), self.corners.len());
        self.points.extend(other.points);
        self.normals.extend(other.normals);
        self.triangles.extend(other.triangles.iter().map(|corners| corners.map(|point| first + point)));
        let moved = |old: &PatchCorner| PatchCorner { point: first + old.point, ..*old };
        self.corners.extend(other.corners.iter().map(moved));
        self.patches.extend(other.patches.iter().map(|corners| corners.map(|old| corner + old)));
        self.origins.extend(other.origins.iter().map(|(corners, weights)| (corners.map(|old| corner + old), *weights)));
        let moved = |old: &Segment| Segment { ends: old.ends.map(|end| first + end), ..*old };
        self.segments.extend(other.segments.iter().map(moved));
    }

    /// Adds the points inside an edge, from its lower end to its higher one. Returns the first of them.
    fn add_edge(&mut self, patch: &Patch, edge: usize, level: usize, creased: &Creased) -> usize {
        let [from, to] = [edge, (edge + 1) % 3];
        let (low, high) = if patch.corners[from] < patch.corners[to] { (from, to) } else { (to, from) };
        let first = self.points.len();
        for step in 1..level {
            let mut weights = [0.0; 3];
            weights[high] = step as f64 / level as f64;
            weights[low] = 1.0 - weights[high];
            self.add_point(patch, weights);
        }
        let is_border = creased.edges[patch.number][edge] == Edge::Border;
        let inside = first..first + level - 1;
        let all = std::iter::once(patch.corners[low]).chain(inside).chain([patch.corners[high]]);
        let all: Vec<usize> = all.collect();
        let is_middle = |corner: usize| {
            let [one, other] = self.corners[corner].parents;
            one != other
        };
        let is_edge = !(is_middle(patch.corners[low]) && is_middle(patch.corners[high]));
        let segment = |ends: &[usize]| Segment { ends: [ends[0], ends[1]], is_border, is_edge };
        self.segments.extend(all.windows(2).map(segment));
        first
    }

    /// Adds the triangles of a patch, and the points inside.
    fn add_patch(&mut self, patch: &Patch, edges: [(usize, bool); 3], level: usize) {
        let first = self.points.len();
        for row in 1..level {
            for column in 1..level - row {
                let [second, third] = [column, row].map(|step| step as f64 / level as f64);
                self.add_point(patch, [1.0 - second - third, second, third]);
            }
        }
        let on_edge = |edge: usize, step: usize| {
            let (start, is_forward) = edges[edge];
            start + if is_forward { step - 1 } else { level - 1 - step }
        };
        // The number of the point `column` steps towards the second corner and `row` steps towards the third.
        let number = |row: usize, column: usize| match (row, column) {
            (0, 0) => patch.corners[0],
            (0, column) if column == level => patch.corners[1],
            (row, 0) if row == level => patch.corners[2],
            (0, column) => on_edge(0, column),
            (row, 0) => on_edge(2, level - row),
            (row, column) if row + column == level => on_edge(1, row),
            // Rows before this one have level − 2, level − 3, … points.
            (row, column) => first + (row - 1) * (level - 1) - row * (row - 1) / 2 + column - 1,
        };
        for row in 0..level {
            for column in 0..level - row {
                let [a, b, c] = [number(row, column), number(row, column + 1), number(row + 1, column)];
                self.triangles.push([a, b, c]);
                if row + column + 1 < level {
                    self.triangles.push([b, number(row + 1, column + 1), c]);
                }
            }
        }
    }

    fn add_point(&mut self, patch: &Patch, weights: [f64; 3]) {
        self.points.push(patch.point(weights));
        self.normals.push(patch.normal(weights));
        self.origins.push((patch.corners, weights.map(|weight| weight as f32)));
    }
}

#[cfg(test)]
mod tests {
    use super::super::SolidMesh;
    use super::super::crease::unit_or_zero;
    use super::*;
    use crate::contact::{AnySolid, RoundedBox};
    use crate::geometry::{add_scaled, cross, dot, norm, subtract};

    /// An octahedron whose triangles were divided some times and moved onto the unit sphere: twice for 66 vertices.
    fn sphere(times: usize) -> (Vec<Vector3<f64>>, Vec<[usize; 3]>) {
        let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let mut points: Vec<Vector3<f64>> =
            axes.into_iter().flat_map(|axis| [axis, axis.map(|component: f64| -component)]).collect();
        let mut triangles = Vec::new();
        for signs in 0..8 {
            let [x, y, z] = [0, 1, 2].map(|axis| 2 * axis + (signs >> axis & 1));
            let is_even = (0..3).filter(|axis| signs >> axis & 1 == 1).count() % 2 == 0;
            triangles.push(if is_even { [x, y, z] } else { [y, x, z] });
        }
        for _ in 0..times {
            let finer = Subdivided::once(&points, &triangles);
            let on_sphere = |parents: &[usize; 2]| {
                let [a, b] = parents.map(|parent| points[parent]);
                unit_or_zero(add_scaled(a, 1.0, b))
            };
            points = finer.parents.iter().map(on_sphere).collect();
            triangles = finer.triangles;
        }
        (points, triangles)
    }

    /// Returns the number of triangles at each edge.
    fn counts(triangles: &[[usize; 3]]) -> HashMap<[usize; 2], usize> {
        let mut counts = HashMap::new();
        for corners in triangles {
            for from in 0..3 {
                let (a, b) = (corners[from], corners[(from + 1) % 3]);
                *counts.entry([a.min(b), a.max(b)]).or_insert(0) += 1;
            }
        }
        counts
    }

    #[test]
    fn spheres_of_few_triangles_are_round_and_closed() {
        let (points, triangles) = sphere(2);
        let (more, finer) = sphere(3);
        // A quarter of a pixel of a ball of 250 pixels. The limits of cloth shrink unevenly where its edges differ.
        let surfaces = [
            (SmoothSurface::of_solid(&points, &triangles, 7), 2e-3),
            (SmoothSurface::of_solid(&more, &finer, 4), 5e-4),
            (SmoothSurface::of_cloth(&more, &finer, 6), 1e-2),
        ];
        for (surface, most) in surfaces {
            assert!(counts(&surface.triangles).values().all(|count| *count == 2));
            let radii: Vec<f64> = surface.points.iter().map(|point| norm(*point)).collect();
            let mean = radii.iter().sum::<f64>() / radii.len() as f64;
            let worst = radii.iter().map(|radius| (radius / mean - 1.0).abs()).fold(0.0, f64::max);
            // The triangles of the coarse one are 4 % off.
            assert!(worst < most, "{worst}");
            for (point, normal) in surface.points.iter().zip(&surface.normals) {
                assert!(dot(unit_or_zero(*point), *normal) > 0.999, "{point:?} {normal:?}");
            }
        }
    }

    #[test]
    fn normals_change_little_from_point_to_point_also_across_the_edges_of_triangles() {
        // A fold: two rows of triangles at an angle of 60°, with flat rows on either side.
        let place = |row: usize| [[-2.0, 0.0], [-1.0, 0.0], [0.0, 0.577], [1.0, 0.0], [2.0, 0.0]][row];
        let points: Vec<Vector3<f64>> = (0..25).map(|n| [(n % 5) as f64, place(n / 5)[0], place(n / 5)[1]]).collect();
        let cells = (0..20).filter(|n| n % 5 != 4);
        let triangles: Vec<[usize; 3]> = cells.flat_map(|a| [[a, a + 1, a + 6], [a, a + 6, a + 5]]).collect();
        let surface = SmoothSurface::of_cloth(&points, &triangles, 16);
        let turns = counts(&surface.triangles).into_keys().map(|[a, b]| dot(surface.normals[a], surface.normals[b]));
        let least = turns.fold(1.0, f64::min);
        assert!(least > 0.97, "turned by {}°", least.acos().to_degrees());
        // Each triangle looks where its normals do.
        for corners in &surface.triangles {
            let [a, b, c] = corners.map(|corner| surface.points[corner]);
            let normal = unit_or_zero(cross(subtract(b, a), subtract(c, a)));
            assert!(corners.iter().all(|corner| dot(surface.normals[*corner], normal) > 0.9));
        }
    }

    #[test]
    fn borders_are_round_corners_and_creases_stay_sharp() {
        // A disc of twelve triangles: its border is a circle.
        let rim = (0..12).map(|n| (f64::from(n) * std::f64::consts::TAU / 12.0).sin_cos());
        let points: Vec<Vector3<f64>> =
            std::iter::once([0.0; 3]).chain(rim.map(|(sine, cosine)| [cosine, sine, 0.0])).collect();
        let triangles: Vec<[usize; 3]> = (0..12).map(|n| [0, n + 1, (n + 1) % 12 + 1]).collect();
        for surface in
            [SmoothSurface::of_solid(&points, &triangles, 6), SmoothSurface::of_cloth(&points, &triangles, 6)]
        {
            let border = surface.segments.iter().filter(|segment| segment.is_border);
            let radii: Vec<f64> = border.map(|segment| norm(surface.points[segment.ends[0]])).collect();
            let mean = radii.iter().sum::<f64>() / radii.len() as f64;
            assert_eq!(radii.len(), 72);
            assert!(radii.iter().all(|radius| (radius / mean - 1.0).abs() < 1e-3), "{radii:?}");
        }
        // A cube keeps its faces and edges, a square its corners.
        let points: Vec<Vector3<f64>> = (0..8).map(|n| [0, 1, 2].map(|axis| f64::from(n >> axis & 1))).collect();
        let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
        let triangles: Vec<[usize; 3]> = faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        let surface = SmoothSurface::of_solid(&points, &triangles, 5);
        for (point, normal) in surface.points.iter().zip(&surface.normals) {
            let on_face = |axis: usize| {
                normal[axis].abs() > 1.0 - 1e-12 && (point[axis] - (normal[axis] + 1.0) / 2.0).abs() < 1e-12
            };
            assert!((0..3).any(on_face), "{point:?} {normal:?}");
        }
        // Large flat faces between rounded edges stay flat.
        let (centre, half, radius) = ([0.0; 3], [0.3, 0.25, 0.2], 0.03);
        let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        let rounded = RoundedBox { centre, axes, half, radius };
        let mesh = SolidMesh::of(&AnySolid::Box(rounded), [0.0; 3], 1.0);
        let surface = SmoothSurface::of_solid(&mesh.vertices, &mesh.triangles, 8);
        let highest = surface.points.iter().map(|point| point[2]).fold(0.0, f64::max);
        assert!(highest < 0.23 + 2e-3, "{highest}");
        let square = SmoothSurface::of_cloth(&points[..4], &[[0, 1, 3], [0, 3, 2]], 4);
        assert!(points[..4].iter().all(|corner| square.points.contains(corner)));
    }

    #[test]
    fn degenerate_meshes_have_finite_surfaces() {
        let points = [[0.0; 3], [0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.0, 0.0], [1.0, 1.0, 0.0]];
        // Coinciding vertices, a flat triangle, and one edge of three triangles.
        let triangles = [[0, 1, 2], [0, 2, 3], [0, 2, 4], [2, 0, 4], [4, 4, 4]];
        for surface in [
            SmoothSurface::of_solid(&points, &triangles, 3),
            SmoothSurface::of_cloth(&points, &triangles, 4),
            SmoothSurface::of_cloth(&[], &[], 4),
        ] {
            let all = surface.points.iter().chain(&surface.normals).flatten();
            assert!(all.into_iter().all(|component| component.is_finite()));
        }
    }
}
