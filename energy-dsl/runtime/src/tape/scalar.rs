//! Runs tapes over one element of any number type.

use super::instruction::{Constant, Instruction, Tape};
use super::operation::Operation;
use crate::numbers::{Level, Mask, Number};
use crate::with_operations;

/// The results of a tape over one element.
#[derive(Debug)]
pub struct Values<T: Number> {
    numbers: Vec<T>,
    masks: Vec<T::Mask>,
}

impl<T: Number> Values<T> {
    /// Returns the number in a slot.
    #[must_use]
    pub fn number(&self, slot: u16) -> T {
        self.numbers[usize::from(slot)].clone()
    }

    /// Returns the mask in a slot; false without one.
    #[must_use]
    pub fn mask(&self, slot: Option<u16>) -> T::Mask {
        slot.map_or_else(T::Mask::none, |slot| self.masks[usize::from(slot)])
    }
}

impl Tape {
    /// Runs the tape at a SIMD level.
    ///
    /// # Panics
    /// When there are more inputs than slots.
    #[must_use]
    pub fn run<T: Number, L: Level>(&self, inputs: impl IntoIterator<Item = T>) -> Values<T> {
        self.run_noting::<T, L>(inputs, &mut |_| {})
    }

    /// Runs the tape and calls `note` with the outcome of each comparison, in order.
    ///
    /// # Panics
    /// When there are more inputs than slots.
    #[must_use]
    pub fn run_noting<T: Number, L: Level>(
        &self,
        inputs: impl IntoIterator<Item = T>,
        note: &mut dyn FnMut(T::Mask),
    ) -> Values<T> {
        let mut numbers: Vec<T> = inputs.into_iter().collect();
        assert!(numbers.len() <= self.slots, "{} inputs for {} slots", numbers.len(), self.slots);
        numbers.resize(self.slots, T::from_f64(0.0));
        for &(slot, constant) in &self.constants {
            numbers[usize::from(slot)] = match constant {
                Constant::Number(number) => T::from_f64(number),
                Constant::Pi => T::from_f64(std::f64::consts::PI),
            };
        }
        let mut masks = vec![T::Mask::none(); self.masks];
        for &(slot, truth) in &self.truths {
            masks[usize::from(slot)] = if truth { !T::Mask::none() } else { T::Mask::none() };
        }
        let mut values = Values { numbers, masks };
        for instruction in &self.instructions {
            step::<T, L>(instruction, &mut values, note);
        }
        values
    }
}

macro_rules! define_step {
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
        fn step<T: Number, L: Level>(
            instruction: &Instruction,
            values: &mut Values<T>,
            note: &mut dyn FnMut(T::Mask),
        ) {
            let operands = instruction.operands;
            let [first, second, third, ..] = operands;
            let mask = |slot: u16| values.masks[usize::from(slot)];
            let mask = match instruction.operation {
                $($(Operation::$name => {
                    let [$($operand,)* ..] = operands;
                    $(let $operand = values.number($operand);)*
                    values.numbers[usize::from(instruction.target)] = $meaning;
                    return;
                })*)*
                $(Operation::$comparison => {
                    let [$($number,)* ..] = operands;
                    $(let $number = values.number($number);)*
                    $outcome
                })*
                $(Operation::$connective => {
                    let [$($mask,)* ..] = operands;
                    $(let $mask = mask($mask);)*
                    $connected
                })*
                Operation::IsModerate => values.number(first).is_moderate(second.to_le_bytes()[0]),
                Operation::Select => {
                    let chosen = T::select(mask(first), values.number(second), values.number(third));
                    values.numbers[usize::from(instruction.target)] = chosen;
                    return;
                }
            };
            note(mask);
            values.masks[usize::from(instruction.target)] = mask;
        }
    };
}

with_operations!(define_step);
