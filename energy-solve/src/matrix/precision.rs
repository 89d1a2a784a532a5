use energy_dsl::{Block, BlockSum, Level, Real};

/// The type in which a matrix is stored or a linear system solved: `f32` or `f64`.
pub trait Precision: Real + Into<f64> + Send + Sync {
    /// The accumulator of sweeps through a matrix of this precision.
    type Sum<L: Level>: BlockSum<Self>;
    /// Wraps mutable blocks of this precision.
    fn blocks(blocks: &mut [Block<Self>]) -> Blocks<'_>;
}

impl Precision for f32 {
    type Sum<L: Level> = L::Sum32;
    fn blocks(blocks: &mut [Block<Self>]) -> Blocks<'_> {
        Blocks::Single(blocks)
    }
}

impl Precision for f64 {
    type Sum<L: Level> = L::Sum64;
    fn blocks(blocks: &mut [Block<Self>]) -> Blocks<'_> {
        Blocks::Double(blocks)
    }
}

/// Mutable blocks of a matrix in either precision, to which terms add theirs.
#[derive(Debug)]
pub enum Blocks<'a> {
    /// Single precision: half the memory, and enough for Newton's method, whose iterations correct each other.
    Single(&'a mut [Block<f32>]),
    /// Double precision.
    Double(&'a mut [Block<f64>]),
}

impl Blocks<'_> {
    /// Reborrows the blocks.
    #[must_use]
    pub fn reborrow(&mut self) -> Blocks<'_> {
        match self {
            Self::Single(blocks) => Blocks::Single(blocks),
            Self::Double(blocks) => Blocks::Double(blocks),
        }
    }

    /// A ← A + s B for the block at an index.
    ///
    /// # Panics
    /// If the index is out of range.
    pub fn add(&mut self, slot: usize, s: f64, block: &Block<f64>) {
        match self {
            Self::Single(blocks) => add_scaled(&mut blocks[slot], s, block),
            Self::Double(blocks) => add_scaled(&mut blocks[slot], s, block),
        }
    }
}

/// A ← A + s B.
#[inline(always)]
fn add_scaled<T: Precision>(sum: &mut Block<T>, s: f64, block: &Block<f64>) {
    for row in 0..3 {
        for column in 0..3 {
            sum[row][column] = sum[row][column] + T::from_f64(s * block[row][column]);
        }
    }
}

/// Converts a block to double precision.
#[inline(always)]
pub(crate) fn doubled<T: Precision>(block: &Block<T>) -> Block<f64> {
    let mut doubled = [[0.0; 3]; 3];
    for row in 0..3 {
        for column in 0..3 {
            doubled[row][column] = block[row][column].into();
        }
    }
    doubled
}
