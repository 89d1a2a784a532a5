//! A triangle's bending: three combinations r of dihedral angles, the energy as their function, and its friction.

use energy_dsl::{Level, Number};
use energy_solve::{Precision, index};

use super::Curvature;
use super::rigidity::cholesky;
use crate::fabric::patch_blocks::Row;
use crate::geometry::dot;

/// A triangle and the hinges that its curvature depends on.
#[derive(Clone, Debug)]
pub(super) struct Patch {
    /// Its vertices, in ascending order.
    pub vertices: Vec<usize>,
    /// Its hinges: their indices, their b, and the positions of their points in `vertices`.
    pub angles: Vec<Angle>,
    /// Rest area, in m².
    pub area: f64,
    /// Orthonormal directions that r lacks, since angles at free edges reach them.
    unreached: Vec<[f64; 3]>,
}

/// A hinge in a patch. Two hinges share a cache line.
#[derive(Clone, Copy, Debug)]
pub(super) struct Angle {
    pub b: [f64; 3],
    hinge: u32,
    pub local: [u8; 4],
}

impl Angle {
    #[inline(always)]
    pub fn hinge(&self) -> usize {
        self.hinge as usize
    }

    /// Returns the same, given the new indices of hinges.
    pub fn renumbered(self, new_index: &[usize]) -> Self {
        Self { hinge: index(new_index[self.hinge()]), ..self }
    }
}

pub(super) type Matrix = [[f64; 3]; 3];

pub(super) const IDENTITY: Matrix = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];

impl Patch {
    /// Sets r = √A (1 − Q Qᵀ) Lᵀ κ with D = L Lᵀ. Q spans the directions that the angles at free edges can reach;
    /// minimising over them makes these components 0. Returns `None` if nothing remains.
    pub fn new(curvature: &Curvature, factor: &Matrix, hinges: &[[usize; 4]]) -> Option<Self> {
        let scaled = |b: &[f64; 3]| transposed_times(factor, b).map(|component| curvature.area.sqrt() * component);
        let unreached = orthonormal(curvature.free.iter().map(scaled));
        let mut angles = Vec::new();
        for &(hinge, b) in &curvature.angles {
            let mut b = scaled(&b);
            unreached.iter().for_each(|q| project_out(&mut b, q));
            angles.push(Angle { hinge: index(hinge), b, local: [0; 4] });
        }
        let square = |angle: &Angle| dot(angle.b, angle.b);
        let largest = angles.iter().map(square).fold(0.0, f64::max);
        angles.retain(|angle| square(angle) > 1e-24 * largest);
        let mut vertices: Vec<usize> = angles.iter().flat_map(|angle| hinges[angle.hinge()]).collect();
        vertices.sort_unstable();
        vertices.dedup();
        for angle in &mut angles {
            angle.local = hinges[angle.hinge()].map(|vertex| {
                u8::try_from(vertices.partition_point(|&known| known < vertex)).expect("a patch has few vertices")
            });
        }
        (!angles.is_empty()).then_some(Self { vertices, angles, area: curvature.area, unreached })
    }

    /// Adds the energy ½ ‖r′‖² of a plate with D′ = L′ L′ᵀ: changes r such that ½ ‖r‖² is the energy of both. Returns
    /// E and P with r′ = P r and E = 1 − PᵀP.
    pub fn add_plate(&mut self, factor: &Matrix, second: &Matrix) -> [Matrix; 2] {
        // κ = L⁻ᵀ r/√A but for what angles at free edges reach, and r′ lacks that.
        let change = |r: [f64; 3]| transposed_times(second, &back_substituted(factor, r));
        let unreached = orthonormal(self.unreached.iter().map(|&q| change(q)));
        let columns = IDENTITY.map(|axis| {
            let mut column = change(axis);
            unreached.iter().for_each(|q| project_out(&mut column, q));
            column
        });
        // ‖r‖² + ‖r′‖² = ‖Cᵀ r‖².
        let square = |i: usize, j: usize| IDENTITY[i][j] + dot(columns[i], columns[j]);
        let c = cholesky(&std::array::from_fn(|i| std::array::from_fn(|j| square(i, j))));
        self.angles.iter_mut().for_each(|angle| angle.b = transposed_times(&c, &angle.b));
        // Columns of C⁻¹, whose product with its transpose is E.
        let inverse = IDENTITY.map(|axis| forward_substituted(&c, axis));
        let entry = |i: usize, j: usize| (0..3).map(|k| inverse[k][i] * inverse[k][j]).sum();
        let elastic = std::array::from_fn(|i| std::array::from_fn(|j| entry(i, j)));
        [elastic, [0, 1, 2].map(|k| forward_substituted(&c, columns.map(|column| column[k])))]
    }
}

/// Returns r = Σ b (θ − θ̄) of a patch with these hinges.
#[inline(always)]
pub(super) fn residual<L: Level>(angles: &[Angle], values: &[f64]) -> [f64; 3] {
    let mut r = [0.0; 3];
    for angle in angles {
        let value = values[angle.hinge()];
        for k in 0..3 {
            r[k] = Number::mul_add::<L>(angle.b[k], value, r[k]);
        }
    }
    r
}

/// Appends ∇r of a patch with these hinges: three vectors per vertex.
#[inline(always)]
pub(super) fn append_gradients<L: Level, T: Precision>(
    angles: &[Angle],
    vertices: usize,
    gradients: &[[[T; 4]; 4]],
    all: &mut Vec<Row<T>>,
) {
    let first = all.len();
    all.resize(first + vertices, [[T::from_f64(0.0); 4]; 3]);
    let rows = &mut all[first..];
    for angle in angles {
        let gradient = &gradients[angle.hinge()];
        let b = [T::from_f64(angle.b[0]), T::from_f64(angle.b[1]), T::from_f64(angle.b[2])];
        for point in 0..4 {
            let row = &mut rows[angle.local[point] as usize];
            for k in 0..3 {
                for axis in 0..4 {
                    row[k][axis] = b[k].mul_add::<L>(gradient[point][axis], row[k][axis]);
                }
            }
        }
    }
}

/// Returns an orthonormal basis of what vectors span.
fn orthonormal(vectors: impl Iterator<Item = [f64; 3]>) -> Vec<[f64; 3]> {
    let mut basis: Vec<[f64; 3]> = Vec::new();
    for mut vector in vectors {
        let before = dot(vector, vector);
        basis.iter().for_each(|q| project_out(&mut vector, q));
        let square = dot(vector, vector);
        if square > 1e-20 * before {
            basis.push(vector.map(|component| component / square.sqrt()));
        }
    }
    basis
}

fn project_out(vector: &mut [f64; 3], unit: &[f64; 3]) {
    let part = dot(*vector, *unit);
    (0..3).for_each(|k| vector[k] -= part * unit[k]);
}

/// Returns Lᵀ b.
fn transposed_times(l: &Matrix, b: &[f64; 3]) -> [f64; 3] {
    std::array::from_fn(|k| (0..3).map(|i| l[i][k] * b[i]).sum())
}

/// Returns L⁻¹ b of a lower triangle.
fn forward_substituted(l: &Matrix, b: [f64; 3]) -> [f64; 3] {
    let x = b[0] / l[0][0];
    let y = (b[1] - l[1][0] * x) / l[1][1];
    [x, y, (b[2] - l[2][0] * x - l[2][1] * y) / l[2][2]]
}

/// Returns L⁻ᵀ b of a lower triangle.
fn back_substituted(l: &Matrix, b: [f64; 3]) -> [f64; 3] {
    let z = b[2] / l[2][2];
    let y = (b[1] - l[2][1] * z) / l[1][1];
    [(b[0] - l[1][0] * y - l[2][0] * z) / l[0][0], y, z]
}
