//! The mean strain around a vertex, as a quadratic form in the positions of its patch.
//!
//! For a triangle with the material coordinates X of its corners, E = ½ (FᵀF − 1) with F = Σ x_i ⊗ ∇N_i, where N_i are
//! the linear weights of its corners. So E, and the mean of E over triangles, is a quadratic form in the positions:
//!
//! Ē_k = ½ Σ S_k,ij x_i·x_j − e_k with e = (½, ½, 0)

use energy_dsl::Vector3;

use super::fan::{Corner, Fan, rotated};
use super::law::Strain;
use crate::mesh::MaterialTriangle;

/// A vertex with the triangles around it.
#[derive(Clone, Debug)]
pub(super) struct Patch {
    /// Its vertices, in ascending order.
    pub vertices: Vec<usize>,
    /// Position of the vertex itself in `vertices`.
    middle: usize,
    /// S by pairs i ≤ j of vertices, row by row, in 1/m².
    pub forms: Vec<Strain>,
    /// A third of the area of its triangles, in m².
    pub area: f64,
}

impl Patch {
    /// Creates the patch of a fan.
    pub fn new(fan: &Fan, triangles: &[[usize; 3]], rest: &[MaterialTriangle]) -> Self {
        let mut vertices: Vec<usize> = fan.iter().flat_map(|corner| triangles[corner.triangle]).collect();
        vertices.sort_unstable();
        vertices.dedup();
        let middle = fan.first().map_or(0, |corner| triangles[corner.triangle][corner.corner]);
        let middle = vertices.partition_point(|&known| known < middle);
        let mut patch = Self { vertices, middle, forms: Vec::new(), area: 0.0 };
        patch.fit(fan, triangles, rest);
        patch
    }

    /// Takes the rest shapes of its triangles.
    pub fn fit(&mut self, fan: &Fan, triangles: &[[usize; 3]], rest: &[MaterialTriangle]) {
        let double_area = |[[a, b], [c, d]]: [[f64; 2]; 2]| a * d - b * c;
        let edges = |at: &Corner| {
            let plane = rest[at.triangle];
            let [origin, first, second] = [0, 1, 2].map(|step| plane[(at.corner + step) % 3]);
            [first, second].map(|end| rotated(at.turn, [end[0] - origin[0], end[1] - origin[1]]))
        };
        self.area = fan.iter().map(|at| double_area(edges(at)) / 6.0).sum();
        let count = self.vertices.len();
        self.forms.clear();
        self.forms.resize(count * (count + 1) / 2, [0.0; 3]);
        for at in fan {
            let [[a, b], [c, d]] = edges(at);
            let determinant = double_area([[a, b], [c, d]]);
            let share = determinant / 6.0 / self.area;
            // ∇N of the ends of the two edges: the rows of D_m⁻¹.
            let first = [d / determinant, -c / determinant];
            let second = [-b / determinant, a / determinant];
            let gradients = [[-first[0] - second[0], -first[1] - second[1]], first, second];
            let corners = [0, 1, 2].map(|step| {
                let vertex = triangles[at.triangle][(at.corner + step) % 3];
                self.vertices.partition_point(|&known| known < vertex)
            });
            for (i, &[p, q]) in corners.iter().zip(&gradients) {
                for (j, &[r, s]) in corners.iter().zip(&gradients).filter(|(j, _)| i <= *j) {
                    let form = &mut self.forms[i * (2 * count - i + 1) / 2 + j - i];
                    let parts = [p * r, q * s, p * s + q * r];
                    (0..3).for_each(|k| form[k] += share * parts[k]);
                }
            }
        }
    }

    /// Shifts the vertex indices by `first`.
    pub fn on_vertices_from(mut self, first: usize) -> Self {
        self.vertices.iter_mut().for_each(|vertex| *vertex += first);
        self
    }

    /// Writes the positions relative to the middle.
    #[inline(always)]
    pub fn differences(&self, x: &[Vector3<f64>], to: &mut Vec<Vector3<f64>>) {
        let middle = x[self.vertices[self.middle]];
        to.clear();
        for &vertex in &self.vertices {
            let at = &x[vertex];
            to.push([at[0] - middle[0], at[1] - middle[1], at[2] - middle[2]]);
        }
    }

    /// Returns the mean strain Ē. `differences` is memory for the positions relative to the middle.
    #[inline(always)]
    pub fn strain(&self, x: &[Vector3<f64>], differences: &mut Vec<Vector3<f64>>) -> Strain {
        self.differences(x, differences);
        let (mut sum, mut pair) = ([-0.5, -0.5, 0.0], 0);
        for (i, a) in differences.iter().enumerate() {
            for (j, b) in differences.iter().enumerate().skip(i) {
                let product = a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
                let weight = if i == j { 0.5 * product } else { product };
                let form = &self.forms[pair];
                for k in 0..3 {
                    sum[k] += weight * form[k];
                }
                pair += 1;
            }
        }
        sum
    }
}
