//! Runs tapes over blocks of elements, in SIMD lanes.

use super::TAPE_BLOCK;
use super::instruction::{Instruction, Tape};
use super::operation::Operation;
use crate::numbers::{Float, Kernel, Lane, Level, Mask, Number};
use crate::with_operations;

/// The number of one slot for each element of a block.
pub type Slot<S> = [S; TAPE_BLOCK];

/// Runs a tape on blocks whose input and constant slots are filled.
pub(super) struct Run<'a, S> {
    pub(super) tape: &'a Tape,
    pub(super) slots: &'a mut [Slot<S>],
    /// One bit per element.
    pub(super) masks: &'a mut [u64],
    /// Number of elements, from 1 to [`TAPE_BLOCK`]. Results of the others are arbitrary.
    pub(super) count: usize,
}

impl<S: Float> Kernel for Run<'_, S> {
    type Output = ();

    #[inline(always)]
    fn run<L: Level>(self) {
        let Self { tape, slots, masks, count } = self;
        if count <= <S::Lanes<L> as Lane<S>>::LANES {
            run::<S, L, 1>(&tape.instructions, slots, masks);
        } else {
            run::<S, L, TAPE_BLOCK>(&tape.instructions, slots, masks);
        }
    }
}

/// Returns the bits of a mask for each element, from masks of the lanes from each offset on.
macro_rules! bits {
    (|$at:ident| $mask:expr, $most:expr, $lanes:expr) => {{
        let (mut bits, mut $at) = (0, 0);
        while $at < $most {
            bits |= u64::from($mask.bits()) << $at;
            $at += $lanes;
        }
        bits
    }};
}

macro_rules! define_run {
    (
        numbers {
            $($_section:ident {
                $($(#[$_docs:meta])* $name:ident($($operand:ident),*) = $meaning:expr $(, $_cost:tt)?;)*
            })*
        }
        masks {
            comparisons { $($(#[$_less:meta])* $comparison:ident($($number:ident),*) = $outcome:expr;)* }
            connectives { $($(#[$_and:meta])* $connective:ident($($mask:ident),*) = $connected:expr;)* }
        }
    ) => {
        /// Runs instructions on the first lanes of all slots, `ELEMENTS` rounded up.
        #[inline(always)]
        fn run<S: Float, L: Level, const ELEMENTS: usize>(
            instructions: &[Instruction],
            slots: &mut [Slot<S>],
            masks: &mut [u64],
        ) {
            let lanes = <S::Lanes<L> as Lane<S>>::LANES;
            for instruction in instructions {
                let target = usize::from(instruction.target);
                let operands = instruction.operands;
                let [i, j, k] = [usize::from(operands[0]), usize::from(operands[1]), usize::from(operands[2])];
                match instruction.operation {
                    $($(Operation::$name => {
                        let [$($operand,)* ..] = operands;
                        $(let $operand = usize::from($operand);)*
                        $(assert!($operand < slots.len());)*
                        assert!(target < slots.len());
                        let mut at = 0;
                        while at < ELEMENTS {
                            $(let $operand = S::Lanes::<L>::load(&slots[$operand][at..]);)*
                            ($meaning).store(&mut slots[target][at..]);
                            at += lanes;
                        }
                    })*)*
                    $(Operation::$comparison => {
                        let [$($number,)* ..] = operands;
                        masks[target] = bits!(|at| {
                            $(let $number = load::<S, L>(slots, usize::from($number), at);)*
                            $outcome
                        }, ELEMENTS, lanes);
                    })*
                    $(Operation::$connective => {
                        let [$($mask,)* ..] = operands;
                        $(let $mask = masks[usize::from($mask)];)*
                        masks[target] = $connected;
                    })*
                    Operation::IsModerate => {
                        let degree = operands[1].to_le_bytes()[0];
                        masks[target] = bits!(|at| load::<S, L>(slots, i, at).is_moderate(degree), ELEMENTS, lanes);
                    }
                    Operation::Select => {
                        let bits = masks[i];
                        let mut at = 0;
                        while at < ELEMENTS {
                            let mask = Mask::from_bits((bits >> at) as u32);
                            let (yes, no) = (load::<S, L>(slots, j, at), load::<S, L>(slots, k, at));
                            S::Lanes::<L>::select(mask, yes, no).store(&mut slots[target][at..]);
                            at += lanes;
                        }
                    }
                }
            }
        }
    };
}

with_operations!(define_run);

#[inline(always)]
fn load<S: Float, L: Level>(slots: &[Slot<S>], slot: usize, at: usize) -> S::Lanes<L> {
    S::Lanes::<L>::load(&slots[slot][at..])
}
