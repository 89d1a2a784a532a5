//! General paths of routines.

use super::instruction::Tape;
use super::routine::flags;
use crate::numbers::{Care, Flags, Fused, Mask, Number, Ray, Roles, Settle, Settled, Unbounded, fill_outside, settle};

/// The general path of a routine, with all precautions. It runs over numbers with an extended exponent, one element at
/// a time.
///
/// It is thousands of operations and rarely runs. As data it costs compilers nothing, so generated code has it in this
/// form, too; see [`EncodedPath`](super::EncodedPath).
#[derive(Clone, Debug, PartialEq)]
pub struct GeneralPath {
    /// Whether derivatives are taken with respect to an input.
    pub moves: Vec<bool>,
    /// Sizes of the groups of results: values, first derivatives, second derivatives.
    pub groups: Vec<usize>,
    /// Whether the first group is of values, not of derivatives.
    pub values_first: bool,
    /// Whether the first group is an energy. It is infinite outside of its domain.
    pub is_energy: bool,
    /// Instructions of the path. The first slots hold its inputs.
    pub tape: Tape,
    /// Slots of the results, in the order of the routine's results.
    pub results: Vec<u16>,
    /// Mask slots of inputs at which a result may be a convention: degenerate, kink.
    pub flags: [Option<u16>; 2],
    /// Mask slots of inputs outside of the domain, and of conventions without a limit.
    pub settled: [Option<u16>; 2],
    /// A tape over the same inputs with a mask slot: the inputs outside of the domain; `None` if all inputs are inside.
    pub outside: Option<(Tape, u16)>,
    /// Index from which results are added to each other later.
    pub summed: usize,
}

impl GeneralPath {
    /// Writes the results in some lanes, and returns the flags there. Scalars and lanes give the same bits, at all
    /// levels: the path always runs with fused operations, whose cost does not matter here. Results that are added to
    /// each other later are [`Number::saturated`].
    ///
    /// # Panics
    /// When there are more inputs than slots, or another number of results.
    #[cold]
    #[inline(never)]
    pub fn run<T: Number>(&self, inputs: &[T], lanes: T::Mask, results: &mut [T]) -> Flags<T> {
        assert_eq!(results.len(), self.results.len(), "the path has another number of results");
        let (mut degenerate, mut kink) = (0, 0);
        for lane in 0..u32::BITS as usize {
            if lanes.bits() >> lane & 1 == 0 {
                continue;
            }
            let own: Vec<T::Unbounded> = inputs.iter().map(|input| input.unbounded(lane)).collect();
            let (found, flags) = T::Unbounded::general_path(self, &own);
            for (number, (result, found)) in results.iter_mut().zip(found).enumerate() {
                result.set_lane(lane, if number < self.summed { found } else { found.saturated() });
            }
            degenerate |= u32::from(flags.degenerate.any()) << lane;
            kink |= u32::from(flags.kink.any()) << lane;
        }
        let mask = <T::Mask as Mask>::from_bits;
        Flags { degenerate: mask(degenerate), kink: mask(kink) }
    }

    /// Returns the results of the tape along rays. As it is not generic, it is compiled once.
    fn along(&self, rays: &[Ray]) -> (Vec<Ray>, Care<Ray>) {
        self.at(rays)
    }

    /// Returns the results of the tape.
    fn at<T: Number>(&self, inputs: &[T]) -> (Vec<T>, Care<T>) {
        let values = self.tape.run::<T, Fused>(inputs.iter().cloned());
        let [outside, definite] = self.settled.map(|slot| values.mask(slot));
        let care = Care { flags: flags(&values, self.flags), outside, definite };
        (self.results.iter().map(|&slot| values.number(slot)).collect(), care)
    }
}

impl Settle for GeneralPath {
    fn settled<T: Number>(&self, inputs: &[T]) -> (Vec<T>, Flags<T>) {
        let Self { moves, groups, values_first, is_energy, .. } = self;
        let roles = Roles { moves, groups, values_first: *values_first, is_energy: *is_energy };
        let is_outside =
            |(tape, slot): &(Tape, u16)| tape.run::<T, Fused>(inputs.iter().cloned()).mask(Some(*slot)).any();
        if self.outside.as_ref().is_some_and(is_outside) {
            let mut results = vec![T::from_f64(0.0); self.results.len()];
            fill_outside(roles, &mut results);
            return (results, Flags::degenerate());
        }
        let (mut results, care) = self.at(inputs);
        let along = |rays: &[Ray]| {
            let (results, care) = self.along(rays);
            (results, care.flags.degenerate)
        };
        let flags = settle(inputs, roles, &mut results, care, &along);
        (results, flags)
    }

    fn in_double(&self, inputs: &[Unbounded<f64>]) -> Settled<f64> {
        self.settled(inputs)
    }

    fn in_single(&self, inputs: &[Unbounded<f32>]) -> Settled<f32> {
        self.settled(inputs)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numbers::{Baseline, Lane, Level};
    use crate::tape::{Constant, Instruction, Operation};

    fn tape(constant: f64, masks: usize, instructions: &[(Operation, u16, [u16; 2])]) -> Tape {
        let instruction = |&(operation, target, [a, b]): &(Operation, u16, [u16; 2])| Instruction {
            operation,
            target,
            operands: [a, b, 0, 0, 0, 0],
        };
        let constants = vec![(1, Constant::Number(constant))];
        let instructions = instructions.iter().map(instruction).collect();
        Tape { slots: 3, masks, constants, truths: Vec::new(), instructions }
    }

    /// x², with a documented value and a flag at 1; x < 0 is outside of the domain.
    fn square() -> GeneralPath {
        GeneralPath {
            moves: vec![true],
            groups: vec![1],
            values_first: true,
            is_energy: true,
            tape: tape(1.0, 1, &[(Operation::Equal, 0, [0, 1]), (Operation::Mul, 2, [0, 0])]),
            results: vec![2],
            flags: [None; 2],
            settled: [None, Some(0)],
            outside: Some((tape(0.0, 1, &[(Operation::Less, 0, [0, 1])]), 0)),
            summed: 1,
        }
    }

    #[test]
    fn general_paths_run_in_the_lanes_that_need_them() {
        type Wide = <Baseline as Level>::F64;
        let path = square();
        let run = |x: [f64; 2], lanes: u32| {
            let lanes = <Wide as Number>::Mask::from_bits(lanes);
            let mut squares = [Wide::splat(0.0)];
            let flags = path.run(&[Wide::load(&x)], lanes, &mut squares);
            ([0, 1].map(|lane| squares[0].extract(lane)), flags.degenerate.bits(), flags.kink.bits())
        };
        assert_eq!(run([2.0, 3.0], 0b11), ([4.0, 9.0], 0, 0));
        assert_eq!(run([2.0, 3.0], 0b10), ([0.0, 9.0], 0, 0));
        assert_eq!(run([2.0, 1.0], 0b11), ([4.0, 1.0], 0b10, 0));
        assert_eq!(run([-2.0, 3.0], 0b11), ([f64::INFINITY, 9.0], 0b01, 0));
    }
}
