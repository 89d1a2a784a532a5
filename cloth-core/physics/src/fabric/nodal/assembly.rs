//! Sums of the derivatives of patches.

use energy_dsl::{Block, Kernel, Level, Vector3, dispatch, triangle_index};
use energy_solve::{Curvature, Precision, Restriction, change_dense};

use super::law::{Response, Strain};
use super::patch::Patch;
use super::term::NodalMembrane;
use crate::geometry::dot;

/// Slots of the blocks of a patch: of the pairs i ≤ j, and of the transposed pairs if the matrix stores both triangles.
#[derive(Clone, Debug)]
pub(super) struct PatchSlots {
    pub slots: Vec<u32>,
    pub mirrored: Vec<u32>,
}

impl PatchSlots {
    /// Returns the slots in a restricted matrix.
    pub fn restricted(&self, restriction: &Restriction<'_>) -> Self {
        let slots = |slots: &[u32]| slots.iter().map(|&slot| restriction.slot(slot)).collect();
        Self { slots: slots(&self.slots), mirrored: slots(&self.mirrored) }
    }
}

/// Patches with their responses at positions x.
#[derive(Clone, Copy)]
pub(super) struct Assembly<'a> {
    pub of: &'a NodalMembrane,
    pub responses: &'a [Response],
    pub x: &'a [Vector3<f64>],
}

/// ∂Ē/∂x of one vertex: a vector per component of the strain.
type Row = [Vector3<f64>; 3];

impl<'a> Assembly<'a> {
    fn patches(&self) -> impl Iterator<Item = (&'a Patch, &'a Response)> + use<'a> {
        let of = self.of;
        of.active.iter().map(move |&patch| &of.patches[patch]).zip(self.responses)
    }

    /// Subtracts Σ S : ∂Ē/∂x.
    pub fn subtract_gradient(&self, force: &mut [Vector3<f64>]) {
        let mut differences = Vec::new();
        for (patch, response) in self.patches() {
            patch.differences(self.x, &mut differences);
            subtract_product_of_form(patch, response.stress, &differences, force);
        }
    }

    /// Subtracts the product of the exact Hessian with v.
    pub fn subtract_product(&self, velocity: &[Vector3<f64>], product: &mut [Vector3<f64>]) {
        let (mut differences, mut rows, mut velocities) = (Vec::new(), Vec::new(), Vec::new());
        for (patch, response) in self.patches() {
            patch.differences(self.x, &mut differences);
            gradients(patch, &differences, &mut rows);
            velocities.clear();
            velocities.extend(patch.vertices.iter().map(|&vertex| velocity[vertex]));
            let rate = |k: usize| rows.iter().zip(&velocities).map(|(row, v)| dot(row[k], *v)).sum::<f64>();
            let rates = [0, 1, 2].map(rate);
            let stress_rate = response.moduli.map(|row| dot(row, rates));
            for (row, &vertex) in rows.iter().zip(&patch.vertices) {
                for (gradient, rate) in row.iter().zip(stress_rate) {
                    (0..3).for_each(|axis| product[vertex][axis] -= rate * gradient[axis]);
                }
            }
            subtract_product_of_form(patch, response.stress, &velocities, product);
        }
    }

    /// Adds `scale` times the Hessian, Σ ∂Ē/∂xᵀ (∂S/∂E) ∂Ē/∂x + S : ∂²Ē/∂x².
    pub fn add_hessian<T: Precision>(self, scale: f64, curvature: Curvature, matrix: &mut [Block<T>]) {
        dispatch(Hessians { assembly: self, scale, curvature, matrix });
    }
}

/// Subtracts Σ_j (S : form_ij) v_j of each vertex i of a patch.
fn subtract_product_of_form(patch: &Patch, stress: Strain, vectors: &[Vector3<f64>], sum: &mut [Vector3<f64>]) {
    let mut pair = 0;
    for (i, &row) in patch.vertices.iter().enumerate() {
        for (j, &column) in patch.vertices.iter().enumerate().skip(i) {
            let weight = weighted(&stress, &patch.forms[pair]);
            (0..3).for_each(|axis| sum[row][axis] -= weight * vectors[j][axis]);
            if i != j {
                (0..3).for_each(|axis| sum[column][axis] -= weight * vectors[i][axis]);
            }
            pair += 1;
        }
    }
}

/// Writes ∂Ē/∂x of the vertices of a patch.
#[inline(always)]
fn gradients(patch: &Patch, differences: &[Vector3<f64>], rows: &mut Vec<Row>) {
    rows.clear();
    rows.resize(differences.len(), [[0.0; 3]; 3]);
    let mut pair = 0;
    for i in 0..differences.len() {
        let at = differences[i];
        let mut row = rows[i];
        for j in i..differences.len() {
            let form = &patch.forms[pair];
            for k in 0..3 {
                for axis in 0..3 {
                    row[k][axis] += form[k] * differences[j][axis];
                }
            }
            if i != j {
                let other = &mut rows[j];
                for k in 0..3 {
                    for axis in 0..3 {
                        other[k][axis] += form[k] * at[axis];
                    }
                }
            }
            pair += 1;
        }
        rows[i] = row;
    }
}

struct Hessians<'a, T> {
    assembly: Assembly<'a>,
    scale: f64,
    curvature: Curvature,
    matrix: &'a mut [Block<T>],
}

impl<T: Precision> Kernel for Hessians<'_, T> {
    type Output = ();

    #[inline(always)]
    fn run<L: Level>(self) {
        let Self { assembly, scale, curvature, matrix } = self;
        let (mut differences, mut rows, mut products) = (Vec::new(), Vec::new(), Vec::<Row>::new());
        let mut isotropic = Vec::new();
        let all = assembly.of.active.iter().zip(assembly.responses).zip(&assembly.of.slots);
        for ((&patch, response), slots) in all {
            let patch = &assembly.of.patches[patch];
            let moduli = changed_moduli(response, curvature);
            isotropic_part(patch, response.stress, curvature, &mut isotropic);
            patch.differences(assembly.x, &mut differences);
            gradients(patch, &differences, &mut rows);
            products.clear();
            for row in &rows {
                let mut product = [[0.0; 3]; 3];
                for k in 0..3 {
                    let [a, b, c] = moduli[k].map(|entry| scale * entry);
                    for axis in 0..3 {
                        product[k][axis] = a * row[0][axis] + b * row[1][axis] + c * row[2][axis];
                    }
                }
                products.push(product);
            }
            let mut pair = 0;
            for (i, row) in rows.iter().enumerate() {
                for (j, product) in products.iter().enumerate().skip(i) {
                    let block = block_of(row, product, scale * isotropic[pair]);
                    add(&mut matrix[slots.slots[pair] as usize], &block, false);
                    if i != j
                        && let Some(&slot) = slots.mirrored.get(pair)
                    {
                        add(&mut matrix[slot as usize], &block, true);
                    }
                    pair += 1;
                }
            }
        }
    }
}

/// Returns Σ sₖ fₖ.
#[inline(always)]
fn weighted(stress: &Strain, form: &Strain) -> f64 {
    let mut sum = 0.0;
    for k in 0..3 {
        sum += stress[k] * form[k];
    }
    sum
}

/// Returns Σ rₖ pₖᵀ + k 1.
#[inline(always)]
fn block_of(row: &Row, product: &Row, isotropic: f64) -> Block<f64> {
    let mut block = [[0.0; 3]; 3];
    for i in 0..3 {
        for j in 0..3 {
            for k in 0..3 {
                block[i][j] += row[k][i] * product[k][j];
            }
        }
        block[i][i] += isotropic;
    }
    block
}

#[inline(always)]
fn add<T: Precision>(sum: &mut Block<T>, block: &Block<f64>, transposed: bool) {
    for i in 0..3 {
        for j in 0..3 {
            let entry = if transposed { block[j][i] } else { block[i][j] };
            sum[i][j] = sum[i][j] + T::from_f64(entry);
        }
    }
}

/// Returns the moduli, with eigenvalues treated as `curvature` says.
fn changed_moduli(response: &Response, curvature: Curvature) -> [[f64; 3]; 3] {
    let mut moduli = [response.moduli];
    if curvature != Curvature::Exact {
        change_dense(&mut moduli, 1, curvature);
    }
    moduli[0]
}

/// Writes S : form, the part of the Hessian that is the same for all axes, by pairs of vertices; with eigenvalues
/// treated as `curvature` says.
fn isotropic_part(patch: &Patch, stress: Strain, curvature: Curvature, to: &mut Vec<f64>) {
    to.clear();
    to.extend(patch.forms.iter().map(|form| weighted(&stress, form)));
    let count = patch.vertices.len();
    if curvature == Curvature::Exact || is_semi_definite(to, count) {
        return;
    }
    // The same matrix as a triangle of 3×3 blocks, filled up with zeros.
    let points = count.div_ceil(3);
    let mut blocks = vec![[[0.0; 3]; 3]; points * (points + 1) / 2];
    let mut pair = 0;
    let entry = |i: usize, j: usize| (triangle_index(points, i / 3, j / 3), i % 3, j % 3);
    for (i, j) in (0..count).flat_map(|i| (i..count).map(move |j| (i, j))) {
        let (block, row, column) = entry(i, j);
        blocks[block][row][column] = to[pair];
        if i / 3 == j / 3 {
            blocks[block][column][row] = to[pair];
        }
        pair += 1;
    }
    change_dense(&mut blocks, points, curvature);
    pair = 0;
    for (i, j) in (0..count).flat_map(|i| (i..count).map(move |j| (i, j))) {
        let (block, row, column) = entry(i, j);
        to[pair] = blocks[block][row][column];
        pair += 1;
    }
}

/// Whether a matrix, given by its upper triangle, has no negative eigenvalue beyond rounding.
fn is_semi_definite(upper: &[f64], count: usize) -> bool {
    let largest = upper.iter().fold(0.0_f64, |largest, entry| largest.max(entry.abs()));
    let mut rest = upper.to_vec();
    let at = |i: usize, j: usize| i * (2 * count - i + 1) / 2 + j - i;
    for k in 0..count {
        let pivot = rest[at(k, k)] + 1e-12 * largest;
        if pivot < 0.0 {
            return false;
        }
        for i in k + 1..count {
            let factor = rest[at(k, i)] / pivot.max(f64::MIN_POSITIVE);
            for j in i..count {
                rest[at(i, j)] -= factor * rest[at(k, j)];
            }
        }
    }
    true
}
