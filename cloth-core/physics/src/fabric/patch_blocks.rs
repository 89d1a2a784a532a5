//! Sums of outer products over patches of vertices, with the blocks of a matrix to which they are added.

use energy_dsl::Block;
use energy_solve::{DofMap, Pattern, Precision, Restriction, Storage, index};

/// Slots of the blocks of a patch: of the pairs i ≤ j, and of the mirrored pairs if the matrix stores both triangles.
#[derive(Clone, Debug)]
pub(super) struct PatchSlots {
    /// The number of vertices of the patch.
    pub vertices: usize,
    slots: Vec<u32>,
    mirrored: Vec<u32>,
}

impl PatchSlots {
    /// Looks up the blocks of a patch, whose vertices ascend.
    pub fn new(vertices: &[usize], dofs: &DofMap, pattern: &Pattern) -> Self {
        let slot = |i: usize, j: usize| {
            let rows = dofs.row(i).zip(dofs.row(j));
            index(rows.and_then(|(row, column)| pattern.slot(row, column)).map_or(pattern.nowhere(), |(slot, _)| slot))
        };
        let pairs = || (0..vertices.len()).flat_map(|i| (i..vertices.len()).map(move |j| (vertices[i], vertices[j])));
        // Vertices ascend, and so do their rows: no block of the upper triangle needs transposing.
        Self {
            vertices: vertices.len(),
            slots: pairs().map(|(i, j)| slot(i, j)).collect(),
            mirrored: match pattern.storage() {
                Storage::Upper => Vec::new(),
                Storage::Whole => pairs().filter(|(i, j)| i != j).map(|(i, j)| slot(j, i)).collect(),
            },
        }
    }

    /// Returns the slots in a restricted matrix.
    pub fn restricted(&self, restriction: &Restriction<'_>) -> Self {
        let slots = |slots: &[u32]| slots.iter().map(|&slot| restriction.slot(slot)).collect();
        Self { vertices: self.vertices, slots: slots(&self.slots), mirrored: slots(&self.mirrored) }
    }

    /// Adds Σ aᵢₖ bⱼₖᵀ + m 1 to the block of each pair, given the factors of the vertices and, by pairs i ≤ j, the
    /// multiples m of the identity; no multiples stand for zeros. `matrix` begins with block `first`; others are left
    /// out.
    #[inline(always)]
    pub fn add<T: Precision>(
        &self,
        factors: &[[Factors<T>; 3]],
        multiples: Option<&[T]>,
        first: usize,
        matrix: &mut [Block<T>],
    ) {
        let (mut slots, mut mirrored) = (self.slots.iter(), self.mirrored.iter());
        let mut pair = 0;
        for i in 0..factors.len() {
            for j in i..factors.len() {
                let Some(&slot) = slots.next() else { return };
                let multiple = multiples.map(|all| all[pair]);
                if let Some(block) = matrix.get_mut((slot as usize).wrapping_sub(first)) {
                    add_outer_product(block, &factors[i], &factors[j], multiple);
                }
                if i != j
                    && let Some(&slot) = mirrored.next()
                    && let Some(block) = matrix.get_mut((slot as usize).wrapping_sub(first))
                {
                    add_outer_product(block, &factors[j], &factors[i], multiple);
                }
                pair += 1;
            }
        }
    }
}

/// Patches whose rows are computed before any is used. A processor cannot forward a recent store to a wider load.
pub(super) const GROUP: usize = 8;

/// Returns the vertices of patches, padded to the same number by repeating the first, and that number.
pub(super) fn padded_stencils<'a>(patches: impl Iterator<Item = &'a [usize]> + Clone) -> (Vec<u32>, usize) {
    let arity = patches.clone().map(<[usize]>::len).max().unwrap_or(1);
    let padded = |patch: &'a [usize]| patch.iter().chain(std::iter::repeat_n(&patch[0], arity - patch.len()));
    (patches.flat_map(padded).copied().map(index).collect(), arity)
}

/// Three vectors, each padded to four components.
pub(super) type Row<T> = [[T; 4]; 3];

/// Two vectors a and b as the factors of a block, by entries: the first eight are added in one register.
#[derive(Clone, Copy)]
pub(super) struct Factors<T> {
    /// a, each component three times.
    left: [T; 8],
    /// b, repeated.
    right: [T; 8],
    /// The factors of the last entry.
    last: [T; 2],
}

impl<T: Precision> Factors<T> {
    #[inline(always)]
    pub fn new(&[x, y, z, _]: &[T; 4], &[a, b, c, _]: &[T; 4]) -> Self {
        Self { left: [x, x, x, y, y, y, z, z], right: [a, b, c, a, b, c, a, b], last: [z, c] }
    }

    /// Returns zeros, to be overwritten.
    pub fn zeros() -> Self {
        let zero = [T::from_f64(0.0); 4];
        Self::new(&zero, &zero)
    }
}

/// A ← A + Σ aₖ bₖᵀ + m 1.
#[inline(always)]
fn add_outer_product<T: Precision>(sum: &mut Block<T>, a: &[Factors<T>; 3], b: &[Factors<T>; 3], multiple: Option<T>) {
    // All products come before the first sum is written: the compiler cannot tell that A is apart from the factors.
    let product = |k: usize, entry: usize| a[k].left[entry] * b[k].right[entry];
    let last = |k: usize| a[k].last[0] * b[k].last[1];
    let mut eight = [T::from_f64(0.0); 8];
    for entry in 0..8 {
        eight[entry] = product(0, entry) + product(1, entry) + product(2, entry);
    }
    let mut ninth = last(0) + last(1) + last(2);
    if let Some(multiple) = multiple {
        (eight[0], eight[4], ninth) = (eight[0] + multiple, eight[4] + multiple, ninth + multiple);
    }
    let sum = sum.as_flattened_mut();
    for entry in 0..8 {
        sum[entry] = sum[entry] + eight[entry];
    }
    sum[8] = sum[8] + ninth;
}
