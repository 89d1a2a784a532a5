//! The mean Green strain of the triangles around a vertex, and its derivatives.
//!
//! For a triangle with the weights N of its corners, F = Σ xᵢ ⊗ ∇Nᵢ has the columns u and v, the deformed unit vectors
//! along warp and weft. E = ½ (FᵀF − 1) = (½ (u·u − 1), ½ (v·v − 1), u·v) for (E_uu, E_vv, 2 E_uv).

use energy_dsl::Vector3;
use energy_solve::{Precision, index};

use super::fan::{Fan, rotated};
use super::law::Strain;
use crate::fabric::lists::Lists;
use crate::fabric::patch_blocks::Row;
use crate::mesh::MaterialTriangle;

/// Vertices with the triangles around them.
#[derive(Clone, Debug)]
pub(super) struct Patches {
    vertices: Lists<usize>,
    corners: Lists<Corner>,
    middles: Vec<Middle>,
}

/// The vertex itself.
#[derive(Clone, Copy, Debug)]
struct Middle {
    /// Its position among the vertices of its patch.
    position: usize,
    /// A third of the area of its triangles, in m².
    area: f64,
}

/// A vertex with the triangles around it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Patch<'a> {
    /// Its vertices, in ascending order.
    pub vertices: &'a [usize],
    corners: &'a [Corner],
    middle: &'a Middle,
}

/// A triangle of a patch.
#[derive(Clone, Copy, Debug)]
struct Corner {
    /// Positions of the two corners other than the middle in [`Patch::vertices`].
    ends: [u32; 2],
    /// Positions among the pairs i ≤ j of vertices: the first end with itself, the second with itself, the first with
    /// the second, the first with the middle, the second with the middle.
    pairs: [u32; 5],
    /// ∇N of these corners along warp and weft, in 1/m: the rows of D_m⁻¹, where the columns of D_m are the edges from
    /// the middle.
    gradients: [[f64; 2]; 2],
    /// The triangle's area over that of all.
    share: f64,
}

/// A vector, padded to four components.
type Padded = [f64; 4];

impl Patches {
    /// Creates the patches of fans. The vertices of the mesh begin with `first_vertex`.
    pub fn new(fans: &[Fan], triangles: &[[usize; 3]], rest: &[MaterialTriangle], first_vertex: usize) -> Self {
        let vertices = |fan: &Fan| {
            let mut vertices: Vec<usize> = fan.iter().flat_map(|corner| triangles[corner.triangle]).collect();
            vertices.sort_unstable();
            vertices.dedup();
            vertices
        };
        let mut vertices: Lists<usize> = fans.iter().map(vertices).collect();
        let at = |patch: usize, vertex: usize| vertices.get(patch).partition_point(|&known| known < vertex);
        let middle = |(patch, fan): (usize, &Fan)| {
            fan.first().map_or(0, |corner| at(patch, triangles[corner.triangle][corner.corner]))
        };
        let positions: Vec<usize> = fans.iter().enumerate().map(middle).collect();
        let corner = |patch: usize, corner: &super::fan::Corner| {
            let ends = [1, 2].map(|step| at(patch, triangles[corner.triangle][(corner.corner + step) % 3]));
            let ([i, j], middle) = (ends, positions[patch]);
            let pairs = [(i, i), (j, j), (i, j), (i, middle), (j, middle)];
            let pairs = pairs.map(|(i, j)| index(pair(vertices.get(patch).len(), i, j)));
            Corner { ends: ends.map(index), pairs, gradients: [[0.0; 2]; 2], share: 0.0 }
        };
        let corners = |(patch, fan): (usize, &Fan)| fan.iter().map(|one| corner(patch, one)).collect::<Vec<_>>();
        let corners = fans.iter().enumerate().map(corners).collect();
        vertices.items_mut().iter_mut().for_each(|vertex| *vertex += first_vertex);
        let middles = positions.into_iter().map(|position| Middle { position, area: 0.0 }).collect();
        let mut patches = Self { vertices, corners, middles };
        patches.fit(fans, rest);
        patches
    }

    /// Takes the rest shapes of triangles.
    pub fn fit(&mut self, fans: &[Fan], rest: &[MaterialTriangle]) {
        for (patch, (fan, middle)) in fans.iter().zip(&mut self.middles).enumerate() {
            let corners = self.corners.get_mut(patch);
            middle.area = 0.0;
            for (corner, at) in corners.iter_mut().zip(fan) {
                let plane = rest[at.triangle];
                let [origin, first, second] = [0, 1, 2].map(|step| plane[(at.corner + step) % 3]);
                let edge = |end: [f64; 2]| rotated(at.turn, [end[0] - origin[0], end[1] - origin[1]]);
                let ([a, b], [c, d]) = (edge(first), edge(second));
                let determinant = a * d - b * c;
                corner.gradients = [[d / determinant, -c / determinant], [-b / determinant, a / determinant]];
                corner.share = determinant / 6.0;
                middle.area += corner.share;
            }
            corners.iter_mut().for_each(|corner| corner.share /= middle.area);
        }
    }

    /// Returns some of the patches.
    pub fn selected(&self, patches: impl Iterator<Item = usize> + Clone) -> Self {
        Self {
            vertices: patches.clone().map(|patch| self.vertices.get(patch).iter().copied()).collect(),
            corners: patches.clone().map(|patch| self.corners.get(patch).iter().copied()).collect(),
            middles: patches.map(|patch| self.middles[patch]).collect(),
        }
    }

    pub fn len(&self) -> usize {
        self.middles.len()
    }

    #[inline(always)]
    pub fn get(&self, patch: usize) -> Patch<'_> {
        Patch { vertices: self.vertices.get(patch), corners: self.corners.get(patch), middle: &self.middles[patch] }
    }

    /// Returns the vertices of all patches.
    pub fn vertices(&self) -> impl Iterator<Item = &[usize]> + Clone {
        self.vertices.iter()
    }

    /// Returns the area of a patch, in m².
    #[inline(always)]
    pub fn area(&self, patch: usize) -> f64 {
        self.middles[patch].area
    }
}

impl Patch<'_> {
    /// Returns the columns of F.
    #[inline(always)]
    fn threads(&self, corner: &Corner, x: &[Vector3<f64>]) -> [Padded; 2] {
        let middle = &x[self.vertices[self.middle.position]];
        let [first, second] = [&x[self.vertices[corner.ends[0] as usize]], &x[self.vertices[corner.ends[1] as usize]]];
        let [[a, b], [c, d]] = corner.gradients;
        let (mut u, mut v) = ([0.0; 4], [0.0; 4]);
        for axis in 0..3 {
            let (e, f) = (first[axis] - middle[axis], second[axis] - middle[axis]);
            u[axis] = a * e + c * f;
            v[axis] = b * e + d * f;
        }
        [u, v]
    }

    /// Returns the mean strain Ē.
    #[inline(always)]
    pub fn strain(&self, x: &[Vector3<f64>]) -> Strain {
        let mut strain = [0.0; 3];
        for corner in self.corners {
            let [u, v] = self.threads(corner, x);
            strain[0] += corner.share * (0.5 * (product(&u, &u) - 1.0));
            strain[1] += corner.share * (0.5 * (product(&v, &v) - 1.0));
            strain[2] += corner.share * product(&u, &v);
        }
        strain
    }

    /// Appends ∂Ē/∂x of its vertices.
    #[inline(always)]
    pub fn append_gradients(&self, x: &[Vector3<f64>], all: &mut Vec<Row<f64>>) {
        let first = all.len();
        all.resize(first + self.vertices.len(), [[0.0; 4]; 3]);
        let to = &mut all[first..];
        let mut of_middle = [[0.0; 4]; 3];
        for corner in self.corners {
            let [u, v] = self.threads(corner, x);
            for end in 0..2 {
                let [along, across] = corner.gradients[end];
                let (along, across) = (corner.share * along, corner.share * across);
                let row = &mut to[corner.ends[end] as usize];
                for axis in 0..4 {
                    let (uu, vv) = (along * u[axis], across * v[axis]);
                    let uv = along * v[axis] + across * u[axis];
                    row[0][axis] += uu;
                    row[1][axis] += vv;
                    row[2][axis] += uv;
                    // A translation strains nothing.
                    of_middle[0][axis] -= uu;
                    of_middle[1][axis] -= vv;
                    of_middle[2][axis] -= uv;
                }
            }
        }
        to[self.middle.position] = of_middle;
    }

    /// Appends k with S : ∂²Ē/∂xᵢ∂xⱼ = kᵢⱼ 1, by pairs i ≤ j of its vertices.
    #[inline(always)]
    pub fn append_stress_stiffness<T: Precision>(&self, &[s_uu, s_vv, s_uv]: &Strain, all: &mut Vec<T>) {
        let (first_pair, count) = (all.len(), self.vertices.len());
        all.resize(first_pair + count * (count + 1) / 2, T::from_f64(0.0));
        let to = &mut all[first_pair..];
        let mut of_middle = 0.0;
        for corner in self.corners {
            let [[a, b], [c, d]] = corner.gradients;
            let share = corner.share;
            let (p, q) = (share * (s_uu * a + s_uv * b), share * (s_uv * a + s_vv * b));
            let (r, s) = (share * (s_uu * c + s_uv * d), share * (s_uv * c + s_vv * d));
            let (first, mixed, second) = (p * a + q * b, p * c + q * d, r * c + s * d);
            let stiffnesses = [first, second, mixed, -first - mixed, -second - mixed];
            for (&pair, stiffness) in corner.pairs.iter().zip(stiffnesses) {
                let sum = &mut to[pair as usize];
                *sum = *sum + T::from_f64(stiffness);
            }
            of_middle += first + 2.0 * mixed + second;
        }
        if let Some(sum) = to.get_mut(pair(count, self.middle.position, self.middle.position)) {
            *sum = T::from_f64(of_middle);
        }
    }
}

/// Returns the position of two of `count` vertices among the pairs i ≤ j.
fn pair(count: usize, i: usize, j: usize) -> usize {
    let (i, j) = (i.min(j), i.max(j));
    i * (2 * count - i + 1) / 2 + j - i
}

#[inline(always)]
fn product(a: &Padded, b: &Padded) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}
