//! Sums of outer products over patches of vertices, with the blocks of a matrix to which they are added.

use energy_dsl::{Block, Level};
use energy_solve::{DofMap, Pattern, Precision, Restriction, Storage, index};

use super::lists::Lists;

/// Slots of the blocks of patches: of the pairs i ≤ j, and of the mirrored pairs if the matrix stores both triangles.
#[derive(Clone, Debug, Default)]
pub(super) struct PatchSlots {
    slots: Lists<u32>,
    mirrored: Lists<u32>,
}

impl PatchSlots {
    /// Looks up the blocks of patches, whose vertices ascend.
    pub fn new<'a>(patches: impl Iterator<Item = &'a [usize]> + Clone, dofs: &DofMap, pattern: &Pattern) -> Self {
        let slot = |(i, j): (usize, usize)| {
            let rows = dofs.row(i).zip(dofs.row(j));
            index(rows.and_then(|(row, column)| pattern.slot(row, column)).map_or(pattern.nowhere(), |(slot, _)| slot))
        };
        let is_mirrored = pattern.storage() == Storage::Whole;
        let mirrored = |&(i, j): &(usize, usize)| is_mirrored && i != j;
        // Vertices ascend, and so do their rows: no block of the upper triangle needs transposing.
        Self {
            slots: patches.clone().map(|patch| pairs(patch).map(slot)).collect(),
            mirrored: patches.map(|patch| pairs(patch).filter(mirrored).map(|(i, j)| slot((j, i)))).collect(),
        }
    }

    /// Returns the slots of these patches in a restricted matrix.
    pub fn restricted(&self, patches: &[usize], restriction: &Restriction<'_>) -> Self {
        let of = |slots: &Lists<u32>| {
            patches.iter().map(|&patch| slots.get(patch).iter().map(|&slot| restriction.slot(slot))).collect()
        };
        Self { slots: of(&self.slots), mirrored: of(&self.mirrored) }
    }

    /// Returns the slots of one patch.
    #[inline(always)]
    pub fn get(&self, patch: usize) -> Slots<'_> {
        Slots { slots: self.slots.get(patch), mirrored: self.mirrored.get(patch) }
    }
}

/// Returns the pairs i ≤ j of vertices.
fn pairs(vertices: &[usize]) -> impl Iterator<Item = (usize, usize)> {
    vertices.iter().enumerate().flat_map(move |(i, &first)| vertices[i..].iter().map(move |&second| (first, second)))
}

/// Slots of the blocks of one patch.
#[derive(Clone, Copy)]
pub(super) struct Slots<'a> {
    slots: &'a [u32],
    mirrored: &'a [u32],
}

impl Slots<'_> {
    /// Returns the number of pairs i ≤ j.
    #[inline(always)]
    pub fn pairs(self) -> usize {
        self.slots.len()
    }

    /// Adds s Σ aᵢₖ bⱼₖᵀ + m 1 to the block of each pair, given the rows a and b of the vertices and, by pairs i ≤ j, the
    /// multiples m of the identity; no multiples stand for zeros.
    #[inline(always)]
    pub fn add<L: Level, T: Precision>(
        self,
        (s, a, b): (T, &[Row<T>], &[Right<T>]),
        multiples: Option<&[T]>,
        to: &mut BlocksFrom<'_, T>,
    ) {
        let (mut slots, mut left) = (self.slots, multiples);
        // LLVM would break registers into their entries, if it knew the zeros.
        let (zero, one) = (T::from_f64(0.0), T::from_f64(1.0));
        let diagonal = std::hint::black_box([one, zero, zero, zero, one, zero, zero, zero]);
        for (i, row) in a.iter().enumerate() {
            let (of_row, others) = slots.split_at(a.len() - i);
            let of_pairs = left.map(|all| all.split_at(of_row.len()));
            let row = Left::of(s, row);
            for (number, (&slot, right)) in of_row.iter().zip(&b[i..]).enumerate() {
                if let Some(block) = to.block(slot) {
                    row.add::<L>(right, of_pairs.map(|(own, _)| (own[number], &diagonal)), block);
                }
            }
            (slots, left) = (others, of_pairs.map(|(_, others)| others));
        }
        // The mirrored block is the transposed one.
        let pairs = (0..a.len()).flat_map(|i| (i..a.len()).map(move |j| (i, j))).enumerate();
        for ((pair, (i, j)), &slot) in pairs.filter(|(_, (i, j))| i != j).zip(self.mirrored) {
            if let Some(block) = to.block(slot) {
                let mut added = [[T::from_f64(0.0); 3]; 3];
                let multiple = multiples.map(|all| (all[pair], &diagonal));
                Left::of(s, &a[i]).add::<L>(&b[j], multiple, &mut added);
                for row in 0..3 {
                    (0..3).for_each(|column| block[row][column] = block[row][column] + added[column][row]);
                }
            }
        }
    }
}

/// Blocks of a matrix from block `first` on. Others are left out.
pub(super) struct BlocksFrom<'a, T> {
    pub first: usize,
    pub blocks: &'a mut [Block<T>],
}

impl<T> BlocksFrom<'_, T> {
    #[inline(always)]
    fn block(&mut self, slot: u32) -> Option<&mut Block<T>> {
        self.blocks.get_mut((slot as usize).wrapping_sub(self.first))
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

/// Converts vectors to another precision. Loops, as in all that kernels call: the closures of `array::map` are compiled
/// without the instructions of the kernel.
#[inline(always)]
pub(super) fn converted<T: Precision, const N: usize>(vectors: &[[f64; 4]; N]) -> [[T; 4]; N] {
    let mut converted = [[T::from_f64(0.0); 4]; N];
    for (vector, number) in converted.iter_mut().zip(vectors) {
        for axis in 0..4 {
            vector[axis] = T::from_f64(number[axis]);
        }
    }
    converted
}

/// Three vectors b as the right factors of blocks: each repeated, as the first eight entries need it, and its last
/// component.
#[derive(Clone, Copy)]
pub(super) struct Right<T>([([T; 8], T); 3]);

impl<T: Precision> Right<T> {
    #[inline(always)]
    pub fn of(row: &Row<T>) -> Self {
        let of = |&[a, b, c, _]: &[T; 4]| ([a, b, c, a, b, c, a, b], c);
        Self([of(&row[0]), of(&row[1]), of(&row[2])])
    }

    /// Returns zeros, to be overwritten.
    pub fn zeros() -> Self {
        Self::of(&[[T::from_f64(0.0); 4]; 3])
    }
}

/// The left factors of a row of blocks, each component three times. Because they are copied, the compiler keeps them in
/// registers: it cannot tell that the blocks do not alias their sources.
struct Left<T>([([T; 8], T); 3]);

impl<T: Precision> Left<T> {
    #[inline(always)]
    fn of(s: T, row: &Row<T>) -> Self {
        let of = |&[x, y, z, _]: &[T; 4]| {
            let (x, y, z) = (s * x, s * y, s * z);
            ([x, x, x, y, y, y, z, z], z)
        };
        Self([of(&row[0]), of(&row[1]), of(&row[2])])
    }

    /// A ← A + Σ aₖ bₖᵀ + m 1, given m and the first eight entries of 1.
    #[inline(always)]
    fn add<L: Level>(&self, Right(right): &Right<T>, multiple: Option<(T, &[T; 8])>, sum: &mut Block<T>) {
        // All products come before the first sum is written.
        let numbers = sum.as_flattened_mut();
        let mut eight = [T::from_f64(0.0); 8];
        for entry in 0..8 {
            let mut product = self.0[0].0[entry].mul_add::<L>(right[0].0[entry], numbers[entry]);
            product = self.0[1].0[entry].mul_add::<L>(right[1].0[entry], product);
            eight[entry] = self.0[2].0[entry].mul_add::<L>(right[2].0[entry], product);
        }
        let mut ninth = self.0[0].1.mul_add::<L>(right[0].1, numbers[8]);
        ninth = self.0[1].1.mul_add::<L>(right[1].1, ninth);
        ninth = self.0[2].1.mul_add::<L>(right[2].1, ninth);
        if let Some((multiple, diagonal)) = multiple {
            for entry in 0..8 {
                eight[entry] = multiple.mul_add::<L>(diagonal[entry], eight[entry]);
            }
            ninth = ninth + multiple;
        }
        numbers[..8].copy_from_slice(&eight);
        numbers[8] = ninth;
    }
}
