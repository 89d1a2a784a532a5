use energy_compiler::Textbook;
use energy_dsl::{Declaration, Number};

use super::Big;
use super::big::with_precision;
use crate::blocks::Block;
use crate::formula::{blocks_near, blocks_over};
use crate::sample::Sample;

/// Highest precision, in bits. A block whose numbers shrink with the precision up to here is exactly zero: they are
/// below 1e-780 of the cancelled terms, less than the square of the smallest double relative to that of 1.
const HIGHEST: usize = 2600;

/// A block of true values.
#[derive(Clone, Debug)]
pub struct TrueBlock {
    /// The numbers, correct to the requested digits relative to the largest of them.
    pub block: Block<Big>,
    /// Whether the block has a value: `false` if the formula divides by zero.
    pub is_defined: bool,
    /// Whether two precisions agree on the block; `false` if the highest precision was reached first.
    is_settled: bool,
}

impl TrueBlock {
    /// Returns the largest magnitude.
    #[must_use]
    pub fn largest(&self) -> f64 {
        largest(&self.block.numbers).to_f64()
    }

    /// Returns the largest error of numbers in units of roundoff of the block's largest number, or of the smallest
    /// normal double if that is larger. NaN if a number is NaN; infinite if only the block is exactly zero.
    #[must_use]
    pub fn error_in_roundoffs(&self, got: &[f64]) -> f64 {
        let worst = self.block.numbers.iter().zip(got).map(|(t, &g)| t.error_of(g)).fold(0.0, worse);
        let largest = self.largest();
        match worst {
            0.0 => 0.0,
            // Correct if the double is infinite too; otherwise the error is infinite.
            _ if largest.is_infinite() => worst,
            _ if largest == 0.0 && self.block.numbers.iter().all(Big::is_zero) => f64::INFINITY,
            _ => worst / largest.max(f64::MIN_POSITIVE) / (f64::EPSILON / 2.0),
        }
    }

    /// Returns the largest difference from another block in multi-precision, relative to the largest number; 0 for
    /// equal blocks.
    #[must_use]
    pub fn relative_difference(&self, other: &Self) -> f64 {
        let pairs = self.block.numbers.iter().zip(&other.block.numbers);
        let difference = pairs.map(|(a, b)| (a.clone() - b.clone()).to_f64().abs()).fold(0.0, worse);
        if difference == 0.0 { 0.0 } else { difference / self.largest() }
    }

    /// Returns the index of the largest error.
    #[must_use]
    pub fn worst_entry(&self, got: &[f64]) -> usize {
        let errors = self.block.numbers.iter().zip(got).map(|(t, &g)| t.error_of(g)).enumerate();
        errors.fold((0, 0.0), |worst, next| if next.1 > worst.1 || next.1.is_nan() { next } else { worst }).0
    }
}

/// Returns the larger error. NaN counts as the largest.
#[must_use]
pub fn worse(a: f64, b: f64) -> f64 {
    if a.is_nan() || b <= a { a } else { b }
}

/// Computes every block of a declaration at one input, to `digits` decimal digits relative to each block's largest
/// number. Entries that consist of rounding errors only are exactly zero.
///
/// ```
/// use energy_compiler::Textbook;
/// use energy_dsl::Element;
/// use verify::{BlockName, Sample, multiprecision::truth};
///
/// let bend = energy_elements::HairBend::<f64>::DECLARATION;
/// let formula = Textbook::from_source(&bend.source).unwrap();
/// // A turn by 1e-8: 1 − cos has no digit left in doubles.
/// let sample = Sample {
///     parameters: vec![2.0],
///     rest: vec![],
///     positions: vec![0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 2.0, 1e-8, 0.0],
///     velocities: vec![],
/// };
/// let energy = &truth(bend, &formula, &sample, 50)[0];
/// assert_eq!(energy.block.name, BlockName::Energy);
/// assert!(energy.block.numbers[0].to_decimal(20).starts_with("4.9999999999999998") );
/// ```
#[must_use]
pub fn truth(declaration: &Declaration, formula: &Textbook, sample: &Sample, digits: usize) -> Vec<TrueBlock> {
    at_rising_precision(digits, Zeros::Confirmed, HIGHEST, || blocks_over(declaration, formula, sample)).blocks
}

/// Computes every block at the sum of an input and an offset, such as a point of a ray through a singularity. Doubles
/// need not represent the sum. A block that comes out as zero is taken as exactly zero.
#[must_use]
pub fn truth_beside(
    declaration: &Declaration,
    formula: &Textbook,
    sample: &Sample,
    offset: &Sample,
    digits: usize,
) -> Vec<TrueBlock> {
    let blocks = || blocks_near(declaration, formula, sample, offset);
    at_rising_precision(digits, Zeros::Believed, HIGHEST, blocks).blocks
}

/// Computes every block at an input without total cancellation: a block that comes out as zero is taken as exactly
/// zero.
pub(crate) fn truth_of_ordinary(
    declaration: &Declaration,
    formula: &Textbook,
    sample: &Sample,
    digits: usize,
) -> Truth {
    at_rising_precision(digits, Zeros::Believed, HIGHEST, || blocks_over(declaration, formula, sample))
}

/// True blocks, and their cost.
#[derive(Clone, Debug)]
pub(crate) struct Truth {
    pub(crate) blocks: Vec<TrueBlock>,
    /// Sum of the precisions of all evaluations, in bits.
    pub(crate) bits: usize,
}

/// Computes every block near a singularity, where digits cancel, at the sum of an input and an offset. The precision is
/// limited: a block that needs more is not defined here.
pub(crate) fn truth_of_extreme(
    declaration: &Declaration,
    formula: &Textbook,
    sample: &Sample,
    offset: Option<&Sample>,
    digits: usize,
) -> Truth {
    const ENOUGH: usize = 1000;
    at_rising_precision(digits, Zeros::Believed, ENOUGH, || match offset {
        Some(offset) => blocks_near(declaration, formula, sample, offset),
        None => blocks_over(declaration, formula, sample),
    })
}

/// The treatment of a block that is zero at some precision, as 1 − x is for x within the last bit of 1.
#[derive(Clone, Copy, PartialEq)]
enum Zeros {
    Believed,
    /// Accept zero at the highest precision only.
    Confirmed,
}

fn at_rising_precision(digits: usize, zeros: Zeros, highest: usize, blocks: impl Fn() -> Vec<Block<Big>>) -> Truth {
    // log₂ 10, and some bits for ordinary cancellation.
    let wanted = digits * 333 / 100 + 1;
    let at = |bits: usize| with_precision(bits, &blocks);
    let mut bits = wanted + 48;
    let mut spent = bits;
    let mut coarse = at(bits);
    let mut settled: Vec<Option<TrueBlock>> = vec![None; coarse.len()];
    loop {
        bits = if settled.iter().all(Option::is_none) && bits == wanted + 48 { bits + bits / 2 } else { 2 * bits };
        spent += bits;
        let fine = at(bits);
        for (number, slot) in settled.iter_mut().enumerate().filter(|(_, slot)| slot.is_none()) {
            *slot = agreed(&coarse[number], &fine[number], wanted, zeros, bits >= highest);
        }
        if settled.iter().all(Option::is_some) {
            let mut blocks: Vec<TrueBlock> = settled.into_iter().flatten().collect();
            if highest < HIGHEST && bits >= highest {
                blocks.iter_mut().for_each(|truth| truth.is_defined &= truth.is_settled);
            }
            return Truth { blocks, bits: spent };
        }
        coarse = fine;
    }
}

/// Returns the block if two precisions agree on it, or if the finer precision is the highest.
fn agreed(coarse: &Block<Big>, fine: &Block<Big>, wanted: usize, zeros: Zeros, is_highest: bool) -> Option<TrueBlock> {
    let wanted = -i64::try_from(wanted).unwrap_or(i64::MAX);
    let is_defined = fine.numbers.iter().all(Big::is_defined);
    let scale = largest(&fine.numbers);
    let close = |(a, b): (&Big, &Big)| (a.clone() - b.clone()).is_within(&scale, wanted);
    let agree = coarse.numbers.iter().zip(&fine.numbers).all(close);
    let is_doubtful = zeros == Zeros::Confirmed && scale.is_zero();
    let is_settled = agree && !is_doubtful;
    if is_defined && !is_settled && !is_highest {
        return None;
    }
    let cleaned = coarse.numbers.iter().zip(&fine.numbers).map(|(a, b)| {
        // An entry on which two precisions do not agree in any bit is rounding.
        let is_rounding = is_defined && !(a.clone() - b.clone()).is_within(b, -1);
        if is_rounding { Big::from_f64(0.0) } else { b.clone() }
    });
    Some(TrueBlock { block: Block::new(fine.name, fine.columns, cleaned.collect()), is_defined, is_settled })
}

fn largest(numbers: &[Big]) -> Big {
    numbers.iter().fold(Big::from_f64(0.0), Big::larger)
}
