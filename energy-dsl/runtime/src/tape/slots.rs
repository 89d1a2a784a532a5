//! The slots of a routine for one block of elements, and its results.

use std::any::Any;

use super::TAPE_BLOCK;
use super::instruction::Tape;
use super::lanes::{Run, Slot};
use super::routine::{General, Routine};
use crate::aligned::Aligned;
use crate::numbers::{Float, Mask, dispatch};

/// The slots of a routine, for one block of elements at a time.
#[derive(Debug)]
pub(super) struct Slots<S> {
    numbers: Aligned<S>,
    masks: Vec<u64>,
    /// Slot of each result.
    results: Vec<u16>,
    /// The indices of the results.
    identity: Vec<u16>,
    /// The results, if the general path replaced some of them.
    replaced: Option<Vec<Slot<S>>>,
    /// Bits of the flagged elements: degenerate, kink.
    pub(super) flags: [u64; 2],
}

impl<S: Float> Slots<S> {
    /// Creates the slots of a routine and fills those of the constants.
    pub(super) fn new(routine: &Routine) -> Self {
        let tape: &Tape = &routine.tape;
        let mut slots = Self {
            numbers: Aligned::new(tape.slots * TAPE_BLOCK, S::from_f64(0.0)),
            masks: vec![0; tape.masks],
            identity: (0..=u16::MAX).take(routine.groups.iter().map(Vec::len).sum()).collect(),
            results: routine.groups.concat(),
            replaced: None,
            flags: [0; 2],
        };
        for &(slot, constant) in &tape.constants {
            slots.numbers_mut()[usize::from(slot)].fill(S::from_f64(constant.nearest()));
        }
        for &(slot, truth) in &tape.truths {
            slots.masks[usize::from(slot)] = if truth { u64::MAX } else { 0 };
        }
        slots
    }

    /// Returns all slots. Those of the inputs come first.
    pub(super) fn numbers_mut(&mut self) -> &mut [Slot<S>] {
        self.numbers.as_chunks_mut().0
    }

    /// Runs the routine on the first `count` elements.
    pub(super) fn run(&mut self, routine: &Routine, count: usize) {
        let slots: &mut dyn Any = self;
        if let Some(slots) = slots.downcast_mut() {
            run_doubles(slots, routine, count);
        } else if let Some(slots) = slots.downcast_mut() {
            run_singles(slots, routine, count);
        } else {
            unreachable!("`Float` is f32 or f64");
        }
    }

    #[inline(always)]
    fn run_here(&mut self, routine: &Routine, count: usize) {
        let Self { numbers, masks, .. } = self;
        dispatch(Run { tape: &routine.tape, slots: numbers.as_chunks_mut().0, masks, count });
        let present = u64::MAX >> (64 - count);
        self.replaced = None;
        self.flags = routine.flags.map(|slot| slot.map_or(0, |slot| self.masks[usize::from(slot)] & present));
        if let Some(general) = &routine.general {
            let extraordinary = !self.masks[usize::from(general.ordinary)] & present;
            if extraordinary != 0 {
                self.run_general(general, extraordinary);
            }
        }
    }

    /// Replaces the results of the extraordinary elements by those of the general path.
    #[cold]
    fn run_general(&mut self, general: &General, extraordinary: u64) {
        let numbers = self.numbers.as_chunks::<TAPE_BLOCK>().0;
        let mut replaced: Vec<Slot<S>> = self.results.iter().map(|&slot| numbers[usize::from(slot)]).collect();
        for element in (0..TAPE_BLOCK).filter(|element| extraordinary >> element & 1 == 1) {
            let (results, flags) = general.run(|input| numbers[usize::from(input)][element]);
            replaced.iter_mut().zip(results).for_each(|(slot, result)| slot[element] = result);
            self.flags[0] |= u64::from(flags.degenerate.any()) << element;
            self.flags[1] |= u64::from(flags.kink.any()) << element;
        }
        self.replaced = Some(replaced);
    }

    /// Returns the results of the last run.
    pub(super) fn results(&self) -> Results<'_, S> {
        match &self.replaced {
            None => Results { numbers: self.numbers.as_chunks().0, at: &self.results },
            Some(replaced) => Results { numbers: replaced, at: &self.identity },
        }
    }
}

/// This is not generic, so that the interpreter is compiled in this crate alone: it is 170 kB of code with all SIMD
/// levels.
#[inline(never)]
fn run_doubles(slots: &mut Slots<f64>, routine: &Routine, count: usize) {
    slots.run_here(routine, count);
}

/// Like [`run_doubles`].
#[inline(never)]
fn run_singles(slots: &mut Slots<f32>, routine: &Routine, count: usize) {
    slots.run_here(routine, count);
}

/// The results of a block of elements.
#[derive(Clone, Copy, Debug)]
pub struct Results<'a, S> {
    numbers: &'a [Slot<S>],
    /// Index of each result among the numbers.
    at: &'a [u16],
}

impl<'a, S> Results<'a, S> {
    /// Creates results: number i is `numbers[at[i]]`.
    #[must_use]
    pub fn new(numbers: &'a [Slot<S>], at: &'a [u16]) -> Self {
        Self { numbers, at }
    }

    /// Returns the number of results.
    #[must_use]
    pub fn len(self) -> usize {
        self.at.len()
    }

    /// Returns whether the list is empty.
    #[must_use]
    pub fn is_empty(self) -> bool {
        self.at.is_empty()
    }

    /// Returns one result of all elements.
    #[inline(always)]
    #[must_use]
    pub fn number(self, result: usize) -> &'a Slot<S> {
        &self.numbers[usize::from(self.at[result])]
    }
}
