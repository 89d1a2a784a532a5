use clap::ValueEnum;

use super::ValidateError;
use super::delaunay::{Point, double_area, triangulate};
use crate::mesh::TriangleMesh;

/// The kind of mesh of a strip.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, ValueEnum)]
pub enum MeshKind {
    /// Equilateral triangles.
    Equilateral,
    /// Squares with parallel diagonals.
    Diagonal,
    /// Squares with alternating diagonals.
    Alternating,
    /// Delaunay triangulation of random points.
    Random,
}

impl MeshKind {
    /// All kinds of mesh.
    pub const ALL: [Self; 4] = [Self::Equilateral, Self::Diagonal, Self::Alternating, Self::Random];

    /// The name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Equilateral => "equilateral",
            Self::Diagonal => "diagonal",
            Self::Alternating => "alternating",
            Self::Random => "random",
        }
    }
}

/// A strip [0, length] × [0, width] with straight edges. Its mesh may lie at any angle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Strip {
    /// Kind of mesh.
    pub kind: MeshKind,
    /// Angle between the mesh's first direction and the strip, in degrees.
    pub orientation: f64,
    /// Length along the first axis, in m.
    pub length: f64,
    /// Width along the second axis, in m.
    pub width: f64,
    /// Approximate distance between neighbouring vertices, in m.
    pub spacing: f64,
    /// Whether to place a second column of vertices one spacing from the first, to clamp both.
    pub clamped: bool,
}

/// Smallest distance of an interior vertex from an edge, over the spacing.
const CLEARANCE: f64 = 0.45;

impl Strip {
    /// Creates a strip of length 1, two squares wide, with parallel diagonals.
    pub(super) fn narrow(segments: usize) -> Self {
        let spacing = 1.0 / segments as f64;
        let width = 2.0 * spacing;
        Self { kind: MeshKind::Diagonal, orientation: 0.0, length: 1.0, width, spacing, clamped: false }
    }

    /// Builds the mesh in the plane of the first two axes; lengths in m.
    ///
    /// # Errors
    /// Returns an error if the strip cannot be meshed.
    pub fn mesh(&self) -> Result<TriangleMesh, ValidateError> {
        let columns = (self.length / self.spacing).round().max(1.0);
        let s = self.length / columns;
        let mut points = self.edges(columns as usize, s);
        let start = if self.clamped { s } else { 0.0 };
        let mut cells = vec![None; points.len()];
        for (cell, point) in self.lattice(s) {
            let clear = CLEARANCE * s;
            let along = (start + clear..self.length - clear).contains(&point[0]);
            if along && (clear..self.width - clear).contains(&point[1]) {
                points.push(point);
                cells.push(Some(cell));
            }
        }
        let mut triangles = triangulate(&perturbed(&points, 1e-6 * s));
        triangles.retain(|&[a, b, c]| double_area(points[a], points[b], points[c]) > 1e-3 * s * s);
        if self.kind == MeshKind::Diagonal || self.kind == MeshKind::Alternating {
            self.choose_diagonals(&points, &cells, s, &mut triangles);
        }
        let area: f64 = triangles.iter().map(|&[a, b, c]| 0.5 * double_area(points[a], points[b], points[c])).sum();
        if (area / (self.length * self.width) - 1.0).abs() > 1e-9 {
            return Err(ValidateError::Strip { strip: *self, area });
        }
        let vertices = points.iter().map(|&[x, y]| [x, y, 0.0]).collect();
        Ok(TriangleMesh::new(vertices, triangles)?)
    }

    /// Returns the vertices on the four edges and in the second column.
    fn edges(&self, columns: usize, s: f64) -> Vec<Point> {
        let rows = (self.width / s).round().max(1.0) as usize;
        let at = |row: usize| self.width * row as f64 / rows as f64;
        let mut points = Vec::new();
        for column in 0..=columns {
            let x = self.length * column as f64 / columns as f64;
            let whole = column == 0 || column == columns || (self.clamped && column == 1);
            let inside = if whole { 1..rows } else { 0..0 };
            points.push([x, 0.0]);
            points.extend(inside.map(|row| [x, at(row)]));
            points.push([x, self.width]);
        }
        points
    }

    /// Returns the lattice points that may lie in the strip, with their indices.
    fn lattice(&self, s: f64) -> Vec<([i64; 2], Point)> {
        let (sine, cosine) = self.orientation.to_radians().sin_cos();
        let up = if self.kind == MeshKind::Equilateral { [0.5, 0.75_f64.sqrt()] } else { [0.0, 1.0] };
        let reach = ((self.length + self.width) / s).ceil() as i64 * 2 + 2;
        let mut random = random_numbers(12_345);
        let mut points = Vec::new();
        for j in -reach..=reach {
            for i in -reach..=reach {
                let (mut a, mut b) = (s * (i as f64 + up[0] * j as f64), s * up[1] * j as f64);
                if self.kind == MeshKind::Random {
                    (a, b) = (a + 0.6 * s * random(), b + 0.6 * s * random());
                }
                let point = [cosine * a - sine * b, sine * a + cosine * b];
                if (0.0..self.length).contains(&point[0]) && (0.0..self.width).contains(&point[1]) {
                    points.push(([i, j], point));
                }
            }
        }
        points
    }

    /// Flips the diagonals of whole cells inside the strip to the requested direction.
    fn choose_diagonals(&self, points: &[Point], cells: &[Option<[i64; 2]>], s: f64, triangles: &mut [[usize; 3]]) {
        let (sine, cosine) = self.orientation.to_radians().sin_cos();
        // An edge vertex belongs to a cell if it lies on the lattice.
        let cell = |vertex: usize| -> Option<[i64; 2]> {
            cells[vertex].or_else(|| {
                let [x, y] = points[vertex];
                let lattice = [(cosine * x + sine * y) / s, (cosine * y - sine * x) / s];
                let near = lattice.map(f64::round);
                let off = (lattice[0] - near[0]).hypot(lattice[1] - near[1]);
                (off < 1e-6).then(|| near.map(|number| number as i64))
            })
        };
        let mut halves: std::collections::BTreeMap<[i64; 2], Vec<usize>> = std::collections::BTreeMap::new();
        for (number, triangle) in triangles.iter().enumerate() {
            let corners: Option<Vec<[i64; 2]>> = triangle.iter().map(|&vertex| cell(vertex)).collect();
            let Some(corners) = corners else { continue };
            let low = [0, 1].map(|axis| corners.iter().map(|corner| corner[axis]).min().unwrap_or(0));
            if corners.iter().all(|corner| corner[0] <= low[0] + 1 && corner[1] <= low[1] + 1) {
                halves.entry(low).or_default().push(number);
            }
        }
        for (low, pair) in halves {
            let &[first, second] = pair.as_slice() else { continue };
            let mut corners: Vec<usize> = triangles[first].iter().chain(&triangles[second]).copied().collect();
            corners.sort_unstable();
            corners.dedup();
            let find = |right: i64, up: i64| {
                corners.iter().copied().find(|&vertex| cell(vertex) == Some([low[0] + right, low[1] + up]))
            };
            let (Some(a), Some(b), Some(c), Some(d)) = (find(0, 0), find(1, 0), find(1, 1), find(0, 1)) else {
                continue;
            };
            let turned = self.kind == MeshKind::Alternating && (low[0] + low[1]).rem_euclid(2) == 1;
            [triangles[first], triangles[second]] =
                if turned { [[a, b, d], [b, c, d]] } else { [[a, b, c], [a, c, d]] };
        }
    }
}

/// Returns the points with small random displacements, so that no four lie on a circle.
pub(super) fn perturbed(points: &[Point], by: f64) -> Vec<Point> {
    let mut random = random_numbers(99);
    points.iter().map(|&[x, y]| [x + by * random(), y + by * random()]).collect()
}

/// Returns a linear congruential generator of numbers in [−½, ½), identical on every machine.
pub(super) fn random_numbers(seed: u32) -> impl FnMut() -> f64 {
    let mut state = seed;
    move || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        f64::from(state >> 8) / f64::from(1 << 24) - 0.5
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strips_are_covered_at_any_angle() {
        for kind in MeshKind::ALL {
            for orientation in [0.0, 17.0, 45.0, 90.0] {
                let strip = Strip { kind, orientation, length: 1.0, width: 0.3, spacing: 0.05, clamped: true };
                let mesh = strip.mesh().unwrap();
                let clamped = mesh.vertices().iter().filter(|p| p[0] < 0.051).count();
                assert_eq!(clamped, 14, "{kind:?}, {orientation}°");
            }
        }
    }

    #[test]
    fn squares_have_the_requested_diagonals() {
        for (kind, expected) in [(MeshKind::Diagonal, 48), (MeshKind::Alternating, 24)] {
            let strip = Strip { kind, orientation: 0.0, length: 0.6, width: 0.4, spacing: 0.05, clamped: false };
            let mesh = strip.mesh().unwrap();
            assert_eq!(mesh.triangles().len(), 192);
            // Count inner cells only: in the outer ring, the Delaunay triangulation chooses the diagonals.
            let inner = |p: &[f64; 3]| p[0] > 0.049 && p[0] < 0.551 && p[1] > 0.049 && p[1] < 0.351;
            let mut rising = 0;
            for triangle in 0..mesh.triangles().len() {
                let corners = mesh.corners(triangle);
                let falls = |k: usize| {
                    let (p, q) = (corners[k], corners[(k + 1) % 3]);
                    (q[0] - p[0]) * (q[1] - p[1]) > 1e-6
                };
                rising += usize::from(corners.iter().all(inner) && (0..3).any(falls));
            }
            assert!(rising >= expected, "{kind:?}: {rising}");
        }
    }
}
