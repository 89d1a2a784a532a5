//! Sums of outer products over patches of vertices, with the blocks of a matrix to which they are added.

use energy_dsl::{Block, Level};
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
    pub fn add<L: Level, T: Precision>(
        &self,
        factors: &[[Factors<T>; 3]],
        multiples: Option<&[T]>,
        first: usize,
        matrix: &mut [Block<T>],
    ) {
        let (mut slots, mut left) = (&self.slots[..], multiples);
        for i in 0..factors.len() {
            let (of_row, others) = slots.split_at(factors.len() - i);
            let of_pairs = left.map(|all| all.split_at(of_row.len()));
            let row = Left::of(&factors[i]);
            for (number, (&slot, other)) in of_row.iter().zip(&factors[i..]).enumerate() {
                if let Some(block) = matrix.get_mut((slot as usize).wrapping_sub(first)) {
                    row.add::<L>(other, of_pairs.map(|(own, _)| own[number]), block);
                }
            }
            (slots, left) = (others, of_pairs.map(|(_, others)| others));
        }
        if !self.mirrored.is_empty() {
            self.add_mirrored::<L, T>(factors, multiples, first, matrix);
        }
    }

    /// Adds to the blocks of the lower triangle.
    fn add_mirrored<L: Level, T: Precision>(
        &self,
        factors: &[[Factors<T>; 3]],
        multiples: Option<&[T]>,
        first: usize,
        matrix: &mut [Block<T>],
    ) {
        let pairs = (0..factors.len()).flat_map(|i| (i..factors.len()).map(move |j| (i, j))).enumerate();
        for ((pair, (i, j)), &slot) in pairs.filter(|(_, (i, j))| i != j).zip(&self.mirrored) {
            if let Some(block) = matrix.get_mut((slot as usize).wrapping_sub(first)) {
                Left::of(&factors[j]).add::<L>(&factors[i], multiples.map(|all| all[pair]), block);
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

/// The left factors of a row of blocks. In a copy of its own, the compiler keeps them in registers: it cannot tell that
/// the blocks are apart from the factors.
struct Left<T> {
    eight: [[T; 8]; 3],
    last: [T; 3],
}

impl<T: Precision> Left<T> {
    #[inline(always)]
    fn of(factors: &[Factors<T>; 3]) -> Self {
        Self { eight: [0, 1, 2].map(|k| factors[k].left), last: [0, 1, 2].map(|k| factors[k].last[0]) }
    }

    /// A ← A + Σ aₖ bₖᵀ + m 1.
    #[inline(always)]
    fn add<L: Level>(&self, right: &[Factors<T>; 3], multiple: Option<T>, sum: &mut Block<T>) {
        // All products come before the first sum is written.
        let numbers = sum.as_flattened_mut();
        let mut eight = [T::from_f64(0.0); 8];
        for entry in 0..8 {
            let mut product = self.eight[0][entry].mul_add::<L>(right[0].right[entry], numbers[entry]);
            product = self.eight[1][entry].mul_add::<L>(right[1].right[entry], product);
            eight[entry] = self.eight[2][entry].mul_add::<L>(right[2].right[entry], product);
        }
        let mut ninth = self.last[0].mul_add::<L>(right[0].last[1], numbers[8]);
        ninth = self.last[1].mul_add::<L>(right[1].last[1], ninth);
        ninth = self.last[2].mul_add::<L>(right[2].last[1], ninth);
        if let Some(multiple) = multiple {
            (eight[0], eight[4], ninth) = (eight[0] + multiple, eight[4] + multiple, ninth + multiple);
        }
        numbers[..8].copy_from_slice(&eight);
        numbers[8] = ninth;
    }
}
