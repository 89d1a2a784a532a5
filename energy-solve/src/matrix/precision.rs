use energy_dsl::{Block, BlockSum, Level, Real};

/// What a matrix is stored in, or a linear system solved in: `f32` or `f64`.
pub trait Precision: Real + Into<f64> + Send + Sync {
    /// What sweeps through a matrix stored in it sum up with.
    type Sum<L: Level>: BlockSum<Self>;
    /// The blocks of a matrix stored in it, to be added to.
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

/// Blocks of a matrix of either precision, to which terms add theirs.
#[derive(Debug)]
pub enum Blocks<'a> {
    /// Single precision: half the memory, and what Newton's method needs, whose iterations correct each other.
    Single(&'a mut [Block<f32>]),
    /// Double precision.
    Double(&'a mut [Block<f64>]),
}

impl Blocks<'_> {
    /// The same blocks, for a while.
    #[must_use]
    pub fn reborrow(&mut self) -> Blocks<'_> {
        match self {
            Self::Single(blocks) => Blocks::Single(blocks),
            Self::Double(blocks) => Blocks::Double(blocks),
        }
    }

    /// A ← A + s B at a place.
    ///
    /// # Panics
    /// When there is no such place.
    pub fn add(&mut self, place: usize, s: f64, block: &Block<f64>) {
        match self {
            Self::Single(blocks) => add_scaled(&mut blocks[place], s, block),
            Self::Double(blocks) => add_scaled(&mut blocks[place], s, block),
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

/// A block in double precision.
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
