//! Adds the results of a batch to the vectors and blocks of its vertices, one element after the other, so that sums do
//! not depend on the number of lanes.

use energy_dsl::{BLOCK, Block, Lane, Mask, Vector3, triangle_index};

use crate::matrix::precision::{Blocks, Precision};
use crate::terms::scatter_map::{ScatterMap, ScatterMaps};

/// Elements that are evaluated together, one per lane.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lanes<'a> {
    /// Index of the first element among the active ones.
    pub(crate) first: usize,
    /// Number of elements.
    pub(crate) count: usize,
    /// Vertices of the elements and of those that follow, point by point.
    pub(crate) stencils: &'a [u32],
    /// Vertices per point.
    pub(crate) stride: usize,
}

impl<'a> Lanes<'a> {
    /// Returns the vertices of point `point` of the elements.
    #[inline(always)]
    pub(crate) fn vertices(&self, point: usize) -> &'a [u32] {
        &self.stencils[point * self.stride..][..self.count]
    }

    /// Returns the vertices of point `point` of the elements and of those that follow.
    #[inline(always)]
    pub(crate) fn all_vertices(&self, point: usize) -> &'a [u32] {
        &self.stencils[point * self.stride..]
    }
}

/// Scratch buffer for one vector per point of a batch's elements; each component is stored for all elements together.
#[derive(Debug)]
pub(crate) struct VectorBuffer {
    numbers: Vec<[f64; BLOCK]>,
}

impl VectorBuffer {
    pub(crate) fn new(points: usize) -> Self {
        Self { numbers: vec![[0.0; BLOCK]; 3 * points] }
    }

    /// Subtracts the vectors at the elements' points from `sums`, which holds the vertices from `first_vertex` on.
    #[inline(always)]
    pub(crate) fn subtract<V: Lane<f64>>(
        &mut self,
        lanes: &Lanes<'_>,
        vectors: &[Vector3<V>],
        first_vertex: usize,
        sums: &mut [Vector3<f64>],
    ) {
        let numbers = &mut self.numbers[..3 * vectors.len()];
        for (stored, number) in numbers.iter_mut().zip(vectors.as_flattened()) {
            number.store(stored);
        }
        for lane in 0..lanes.count.min(BLOCK) {
            for point in 0..vectors.len() {
                let vertex = (lanes.vertices(point)[lane] as usize).wrapping_sub(first_vertex);
                if let Some(vector) = sums.get_mut(vertex) {
                    for axis in 0..3 {
                        vector[axis] -= numbers[3 * point + axis][lane];
                    }
                }
            }
        }
    }
}

/// Scratch buffer for the triangles of blocks of a batch's elements: from lanes to the blocks of a matrix.
#[derive(Debug)]
pub struct TriangleBuffer {
    /// Blocks per triangle.
    pairs: usize,
    /// The first eight entries of each block, which are added in one register; sorted by element, then pair.
    eights: Vec<[f64; 8]>,
    /// The last entry of each block; sorted by pair, then element.
    ninths: Vec<[f64; BLOCK]>,
}

impl TriangleBuffer {
    /// Creates a buffer for elements with this many points.
    #[must_use]
    pub fn new(points: usize) -> Self {
        let pairs = points * (points + 1) / 2;
        Self { pairs, eights: vec![[0.0; 8]; BLOCK * pairs], ninths: vec![[0.0; BLOCK]; pairs] }
    }

    /// Adds the triangles of the elements from `first` on, times `scale`, to `matrix`, which holds the blocks from
    /// `first_block` on. Transposes the blocks (i, j) that are stored as (j, i).
    #[inline(always)]
    pub fn scatter<V: Lane<f64>>(
        &mut self,
        maps: &ScatterMaps,
        (first, count): (usize, usize),
        scale: V,
        triangle: &mut [[Vector3<V>; 3]],
        (first_block, matrix): (usize, &mut Blocks<'_>),
    ) {
        turn(&maps.upper, first, triangle);
        self.fill(scale, triangle);
        let (pairs, elements) = (triangle.len(), first..first + count);
        let (slots, mirrored) = (maps.upper.of(elements.clone()), maps.mirrored.of(elements));
        match matrix {
            Blocks::Single(matrix) => self.add_to(pairs, slots, mirrored, first_block, matrix),
            Blocks::Double(matrix) => self.add_to(pairs, slots, mirrored, first_block, matrix),
        }
    }

    /// Fills the buffer with the scaled triangles of all lanes.
    #[inline(always)]
    fn fill<V: Lane<f64>>(&mut self, scale: V, triangle: &[[Vector3<V>; 3]]) {
        let (stride, eights) = (8 * self.pairs, self.eights.as_flattened_mut());
        for (pair, (block, ninth)) in triangle.iter().zip(&mut self.ninths).enumerate() {
            let mut entries = [scale; 9];
            for (entry, number) in entries.iter_mut().zip(block.as_flattened()) {
                *entry = *number * scale;
            }
            V::store_transposed(&entries[..8], V::LANES, &mut eights[8 * pair..], stride);
            entries[8].store(ninth);
        }
    }

    /// Adds the blocks to `matrix`, which holds the blocks from `first_block` on. `pairs`, the blocks per element, is a
    /// constant wherever this is inlined.
    #[inline(always)]
    fn add_to<T: Precision>(
        &self,
        pairs: usize,
        slots: &[u32],
        mirrored: &[u32],
        first_block: usize,
        matrix: &mut [Block<T>],
    ) {
        let ninths = &self.ninths[..pairs];
        let elements = slots.chunks_exact(pairs).zip(self.eights.chunks_exact(pairs)).enumerate().take(BLOCK);
        for (lane, (slots, eights)) in elements {
            for pair in 0..pairs {
                if let Some(block) = matrix.get_mut((slots[pair] as usize).wrapping_sub(first_block)) {
                    add_block(block, &eights[pair], ninths[pair][lane]);
                }
            }
        }
        if !mirrored.is_empty() {
            self.add_mirrored(mirrored, first_block, matrix);
        }
    }

    /// Adds the blocks below the diagonal. Out of line: only matrices that other terms make non-symmetric store them.
    #[inline(never)]
    fn add_mirrored<T: Precision>(&self, slots: &[u32], first_block: usize, matrix: &mut [Block<T>]) {
        let n = points_of_triangle(self.pairs);
        let below: Vec<usize> = (0..n).flat_map(|i| (i + 1..n).map(move |j| triangle_index(n, i, j))).collect();
        for (lane, slots) in slots.chunks_exact(below.len()).enumerate() {
            for (&slot, &pair) in slots.iter().zip(&below) {
                let Some(block) = matrix.get_mut((slot as usize).wrapping_sub(first_block)) else { continue };
                let eight = &self.eights[lane * self.pairs + pair];
                for row in 0..3 {
                    for column in 0..3 {
                        let entry = eight.get(3 * column + row).unwrap_or(&self.ninths[pair][lane]);
                        block[row][column] = block[row][column] + T::from_f64(*entry);
                    }
                }
            }
        }
    }
}

/// Transposes the blocks (i, j) that are stored as (j, i).
#[inline(always)]
fn turn<V: Lane<f64>>(maps: &ScatterMap, first: usize, triangle: &mut [[Vector3<V>; 3]]) {
    for pair in 0..triangle.len() {
        let bits = maps.transposed(first, pair);
        if bits != 0 {
            let turned = V::Mask::from_bits(bits);
            let block = &mut triangle[pair];
            for (i, j) in [(0, 1), (0, 2), (1, 2)] {
                let (upper, lower) = (block[i][j], block[j][i]);
                block[i][j] = V::select(turned, lower, upper);
                block[j][i] = V::select(turned, upper, lower);
            }
        }
    }
}

/// A ← A + B.
#[inline(always)]
fn add_block<T: Precision>(sum: &mut Block<T>, eight: &[f64; 8], ninth: f64) {
    let sum = sum.as_flattened_mut();
    for entry in 0..8 {
        sum[entry] = sum[entry] + T::from_f64(eight[entry]);
    }
    sum[8] = sum[8] + T::from_f64(ninth);
}

/// Returns n for a triangle of n (n + 1)/2 blocks.
pub(crate) fn points_of_triangle(blocks: usize) -> usize {
    (1..).find(|n| n * (n + 1) / 2 >= blocks).expect("some triangle is large enough")
}
