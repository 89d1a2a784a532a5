use super::{PlateError, material_coordinates};
use crate::mesh::{Topology, TriangleMesh, Warp};

/// For each edge, the deviation of the surface's normal at the midpoint from the bisector of the triangles' normals.
///
/// Consider a quadratic height field with curvature H. The slope at the midpoint of an edge, outwards and relative to
/// the flat triangle, is p = (½ (H_tt τ² − 2 H_tn τ η + H_nn η²) − ⅛ H_tt L²)/η. Here t is the direction of the edge of
/// length L, n the outward normal, and (τ, −η) the position of the apex relative to the midpoint. The dihedral angle is
/// the sum p + p′ over the two triangles, the tilt ½ (p − p′).
#[derive(Clone, Debug, PartialEq)]
pub struct Tilts {
    /// For each hinge, the coefficients c of φ = Σ c (θ − θ̄) and their hinges, seen from the first triangle.
    pub tilts: Vec<Vec<(usize, f64)>>,
    /// The three sides of each triangle.
    pub(super) sides: Vec<[Side; 3]>,
}

/// A side of a triangle, in the triangle's coordinates along warp and weft.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Side {
    /// Length, in m.
    pub length: f64,
    /// Outward unit normal.
    pub normal: [f64; 2],
    /// The hinge; `None` on the boundary.
    pub hinge: Option<usize>,
    /// The triangle on the other side; `None` on the boundary.
    across: Option<usize>,
    /// τ and η of the apex, in m.
    apex: [f64; 2],
}

/// A linear form on (H_uu, H_vv, 2H_uv).
type Row = [f64; 3];

/// The largest number of rings of triangles around an edge whose hinges determine its tilt. If they do not suffice, the
/// tilt is a least-squares fit.
const RINGS: usize = 4;
/// Relative size below which a tilt counts as rounding error.
const NEGLIGIBLE: f64 = 1e-11;
/// The smallest determinant of MᵀM, relative to the cube of a third of its trace, for which hinges determine a
/// curvature.
const WELL_POSED: f64 = 1e-3;

impl Tilts {
    /// Computes the tilts of a mesh at rest.
    ///
    /// # Errors
    /// Returns an error if a triangle is perpendicular to the warp, or two neighbours have opposite fronts.
    pub fn of(mesh: &TriangleMesh, topology: &Topology, warp: Option<Warp>) -> Result<Self, PlateError> {
        let mut sides = Vec::with_capacity(mesh.triangles().len());
        for triangle in 0..mesh.triangles().len() {
            sides.push(sides_of(material_coordinates(mesh, triangle, warp)?));
        }
        for (number, hinge) in topology.hinges.iter().enumerate() {
            let [_, _, start, end] = hinge.vertices;
            for (at, &triangle) in hinge.triangles.iter().enumerate() {
                let corners = mesh.triangles()[triangle];
                let edge = if at == 0 { (start, end) } else { (end, start) };
                let side = (0..3).find(|&side| (corners[side], corners[(side + 1) % 3]) == edge);
                let side = side.ok_or(PlateError::Unoriented { triangles: hinge.triangles })?;
                sides[triangle][side].hinge = Some(number);
                sides[triangle][side].across = Some(hinge.triangles[1 - at]);
            }
        }
        let mut tilts = Self { tilts: Vec::with_capacity(topology.hinges.len()), sides };
        for hinge in 0..topology.hinges.len() {
            let tilt = tilts.tilt(hinge, topology.hinges[hinge].triangles);
            tilts.tilts.push(tilt);
        }
        Ok(tilts)
    }

    /// Returns the tilt of one hinge: the combination of nearby angles with minimal norm.
    fn tilt(&self, hinge: usize, [first, second]: [usize; 2]) -> Vec<(usize, f64)> {
        let mut patch = Patch::new(self, first);
        patch.unfold(second);
        let sides = [first, second].map(|triangle| (triangle, self.side(triangle, hinge)));
        let rows = sides.map(|(triangle, side)| side.slope(patch.turn(triangle)));
        let wanted: Row = std::array::from_fn(|k| 0.5 * (rows[0][k] - rows[1][k]));
        if size(wanted) <= NEGLIGIBLE * (size(rows[0]) + size(rows[1])) {
            return Vec::new();
        }
        let mut ring = 1;
        let (angles, gram) = loop {
            let angles = patch.angles();
            let gram = gram(&angles);
            let third = (gram[0][0] + gram[1][1] + gram[2][2]) / 3.0;
            if determinant(&gram) > WELL_POSED * third.powi(3) || ring == RINGS || !patch.grow() {
                break (angles, gram);
            }
            ring += 1;
        };
        let multiplier = solve_positive(gram, wanted);
        let part = |&(number, row): &(usize, Row)| (number, (0..3).map(|k| row[k] * multiplier[k]).sum());
        angles.iter().map(part).filter(|(_, c): &(usize, f64)| c.abs() > NEGLIGIBLE).collect()
    }

    fn side(&self, triangle: usize, hinge: usize) -> &Side {
        self.sides[triangle].iter().find(|side| side.hinge == Some(hinge)).expect("a hinge joins its triangles")
    }
}

/// Triangles unfolded into the plane of the first, each with the rotation of its coordinates in that plane.
struct Patch<'a> {
    tilts: &'a Tilts,
    triangles: Vec<(usize, f64)>,
}

impl<'a> Patch<'a> {
    fn new(tilts: &'a Tilts, first: usize) -> Self {
        Self { tilts, triangles: vec![(first, 0.0)] }
    }

    fn turn(&self, triangle: usize) -> f64 {
        self.triangles.iter().find(|(known, _)| *known == triangle).map_or(0.0, |(_, turn)| *turn)
    }

    fn contains(&self, triangle: usize) -> bool {
        self.triangles.iter().any(|(known, _)| *known == triangle)
    }

    /// Unfolds a neighbour of a triangle in the patch.
    fn unfold(&mut self, triangle: usize) {
        if let Some(turn) = self.turn_across(triangle) {
            self.triangles.push((triangle, turn));
        }
    }

    /// Returns the rotation of a neighbour of a triangle in the patch. Outward normals across their edge are opposite.
    fn turn_across(&self, triangle: usize) -> Option<f64> {
        let sides = &self.tilts.sides[triangle];
        sides.iter().find_map(|side| {
            let (_, turn) = self.triangles.iter().find(|(known, _)| Some(*known) == side.across)?;
            let other = self.tilts.side(side.across?, side.hinge?);
            Some(turn + direction(other.normal) - direction(side.normal) + std::f64::consts::PI)
        })
    }

    /// Adds all neighbours of the patch. Returns `false` if the patch has no neighbours.
    fn grow(&mut self) -> bool {
        let before = self.triangles.len();
        for at in 0..before {
            for side in self.tilts.sides[self.triangles[at].0] {
                if let Some(across) = side.across.filter(|&across| !self.contains(across)) {
                    self.unfold(across);
                }
            }
        }
        self.triangles.len() > before
    }

    /// Returns the hinges in the patch, with their dihedral angles as functions of the curvature.
    fn angles(&self) -> Vec<(usize, Row)> {
        let mut angles: Vec<(usize, Row)> = Vec::new();
        for &(triangle, turn) in &self.triangles {
            for side in &self.tilts.sides[triangle] {
                let (Some(hinge), Some(across)) = (side.hinge, side.across) else { continue };
                if angles.iter().any(|(known, _)| *known == hinge) {
                    continue;
                }
                let other = self.tilts.side(across, hinge);
                let turn_across = turn + direction(side.normal) - direction(other.normal) + std::f64::consts::PI;
                let (here, there) = (side.slope(turn), other.slope(turn_across));
                angles.push((hinge, std::array::from_fn(|k| here[k] + there[k])));
            }
        }
        angles
    }
}

impl Side {
    /// Returns p as a function of the curvature, in coordinates that are rotated by `turn`.
    fn slope(&self, turn: f64) -> Row {
        let angle = direction(self.normal) + turn;
        // t is n rotated to the left, because a triangle lies to the left of its directed sides.
        let (n, m) = (angle.cos(), angle.sin());
        let [tau, eta] = self.apex;
        let [tt, tn, nn] = [0.5 * (tau * tau - 0.25 * self.length * self.length) / eta, -tau, 0.5 * eta];
        // H_tt, H_tn and H_nn with t = (−m, n).
        [
            tt * m * m - tn * n * m + nn * n * n,
            tt * n * n + tn * n * m + nn * m * m,
            -tt * n * m + 0.5 * tn * (n * n - m * m) + nn * n * m,
        ]
    }
}

fn sides_of(corners: [[f64; 2]; 3]) -> [Side; 3] {
    std::array::from_fn(|side| {
        let [start, end, apex] = [corners[side], corners[(side + 1) % 3], corners[(side + 2) % 3]];
        let edge = [end[0] - start[0], end[1] - start[1]];
        let length = edge[0].hypot(edge[1]);
        let along = edge.map(|component| component / length);
        let reach = [apex[0] - start[0], apex[1] - start[1]];
        let tau = reach[0] * along[0] + reach[1] * along[1] - 0.5 * length;
        let eta = along[0] * reach[1] - along[1] * reach[0];
        Side { length, normal: [along[1], -along[0]], hinge: None, across: None, apex: [tau, eta] }
    })
}

fn direction([x, y]: [f64; 2]) -> f64 {
    y.atan2(x)
}

fn size(row: Row) -> f64 {
    row.iter().fold(0.0, |largest, component| component.abs().max(largest))
}

fn gram(angles: &[(usize, Row)]) -> [Row; 3] {
    let mut gram = [[0.0; 3]; 3];
    for (_, row) in angles {
        for i in 0..3 {
            for j in 0..3 {
                gram[i][j] += row[i] * row[j];
            }
        }
    }
    gram
}

fn determinant(m: &[Row; 3]) -> f64 {
    let minor = |a: usize, b: usize| m[1][a] * m[2][b] - m[1][b] * m[2][a];
    m[0][0] * minor(1, 2) - m[0][1] * minor(0, 2) + m[0][2] * minor(0, 1)
}

/// Solves (G + ε) x = b with ε = 10⁻¹² tr G, so that directions that no hinge determines give 0.
fn solve_positive(mut gram: [Row; 3], mut b: Row) -> Row {
    let small = 1e-12 * (gram[0][0] + gram[1][1] + gram[2][2]);
    (0..3).for_each(|k| gram[k][k] += small);
    for k in 0..3 {
        for row in k + 1..3 {
            let factor = gram[row][k] / gram[k][k];
            for column in k..3 {
                gram[row][column] -= factor * gram[k][column];
            }
            b[row] -= factor * b[k];
        }
    }
    for k in (0..3).rev() {
        for column in k + 1..3 {
            b[k] -= gram[k][column] * b[column];
        }
        b[k] /= gram[k][k];
    }
    b
}
