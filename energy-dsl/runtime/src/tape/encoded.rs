//! General paths as bytes, for generated code.

use std::sync::OnceLock;

use super::general::GeneralPath;
use super::instruction::{Constant, Instruction, Tape};
use super::operation::Operation;
use crate::numbers::{Flags, Number};

/// A general path as the bytes that [`EncodedPath::encode`] wrote. It is read at its first use.
#[derive(Debug)]
pub struct EncodedPath {
    bytes: &'static [u8],
    path: OnceLock<GeneralPath>,
}

impl EncodedPath {
    /// Creates the path of these bytes.
    #[must_use]
    pub const fn new(bytes: &'static [u8]) -> Self {
        Self { bytes, path: OnceLock::new() }
    }

    /// Writes a path as bytes.
    #[must_use]
    pub fn encode(path: &GeneralPath) -> Vec<u8> {
        let mut writer = Writer(Vec::new());
        writer.path(path);
        writer.0
    }

    /// Returns the path.
    ///
    /// # Panics
    /// When the bytes are not those of a path.
    pub fn path(&self) -> &GeneralPath {
        self.path.get_or_init(|| {
            let path = Reader { rest: self.bytes }.path();
            path.expect("these bytes were written by a compiler of the same version")
        })
    }

    /// Writes the results in some lanes, and returns the flags there; see [`GeneralPath::run`].
    ///
    /// # Panics
    /// When the path has another number of inputs or results.
    #[cold]
    #[inline(never)]
    pub fn run<T: Number>(&self, inputs: &[T], lanes: T::Mask, results: &mut [T]) -> Flags<T> {
        self.path().run(inputs, lanes, results)
    }
}

/// Writes whole numbers in groups of seven bits, the lowest first. All but the last have the eighth bit.
struct Writer(Vec<u8>);

impl Writer {
    fn number(&mut self, mut number: usize) {
        while number >= 0x80 {
            self.0.push(number.to_le_bytes()[0] | 0x80);
            number >>= 7;
        }
        self.0.push(number.to_le_bytes()[0]);
    }

    fn list<I: IntoIterator<Item: Into<usize>, IntoIter: ExactSizeIterator>>(&mut self, numbers: I) {
        let numbers = numbers.into_iter();
        self.number(numbers.len());
        numbers.for_each(|number| self.number(number.into()));
    }

    fn slot(&mut self, slot: Option<u16>) {
        self.number(slot.map_or(0, |slot| usize::from(slot) + 1));
    }

    fn path(&mut self, path: &GeneralPath) {
        let GeneralPath { moves, groups, values_first, is_energy, tape, results, flags, settled, outside, summed } =
            path;
        self.list(moves.iter().copied());
        self.list(groups.iter().copied());
        [*values_first, *is_energy].into_iter().for_each(|holds| self.number(holds.into()));
        self.tape(tape);
        self.list(results.iter().copied());
        flags.iter().chain(settled).for_each(|&slot| self.slot(slot));
        self.slot(outside.as_ref().map(|(_, slot)| *slot));
        if let Some((tape, _)) = outside {
            self.tape(tape);
        }
        self.number(*summed);
    }

    fn tape(&mut self, tape: &Tape) {
        let Tape { slots, masks, constants, truths, instructions } = tape;
        self.number(*slots);
        self.number(*masks);
        self.number(constants.len());
        for (slot, constant) in constants {
            self.number((*slot).into());
            match constant {
                Constant::Pi => self.number(0),
                Constant::Number(number) => {
                    self.number(1);
                    self.0.extend(number.to_le_bytes());
                }
            }
        }
        self.number(truths.len());
        for (slot, truth) in truths {
            self.number((*slot).into());
            self.number((*truth).into());
        }
        self.number(instructions.len());
        for Instruction { operation, target, operands } in instructions {
            self.number(usize::from(*operation as u8));
            self.number((*target).into());
            // Operands after the last one that is not 0 are 0.
            let count = operands.iter().rposition(|&operand| operand != 0).map_or(0, |last| last + 1);
            self.list(operands[..count].iter().copied());
        }
    }
}

/// Reads what a [`Writer`] wrote. `None` if it cannot.
struct Reader<'a> {
    rest: &'a [u8],
}

impl Reader<'_> {
    fn number(&mut self) -> Option<usize> {
        let (mut number, mut shift) = (0, 0);
        loop {
            let (&byte, rest) = self.rest.split_first()?;
            self.rest = rest;
            number |= usize::from(byte & 0x7F).checked_shl(shift)?;
            shift += 7;
            if byte & 0x80 == 0 {
                return Some(number);
            }
        }
    }

    fn short(&mut self) -> Option<u16> {
        self.number()?.try_into().ok()
    }

    fn list<T>(&mut self, mut one: impl FnMut(&mut Self) -> Option<T>) -> Option<Vec<T>> {
        (0..self.number()?).map(|_| one(self)).collect()
    }

    fn slot(&mut self) -> Option<Option<u16>> {
        match self.number()? {
            0 => Some(None),
            slot => Some(Some((slot - 1).try_into().ok()?)),
        }
    }

    fn path(&mut self) -> Option<GeneralPath> {
        let moves = self.list(|reader| Some(reader.number()? == 1))?;
        let groups = self.list(Self::number)?;
        let [values_first, is_energy] = [self.number()? == 1, self.number()? == 1];
        let tape = self.tape()?;
        let results = self.list(Self::short)?;
        let flags = [self.slot()?, self.slot()?];
        let settled = [self.slot()?, self.slot()?];
        let outside = match self.slot()? {
            Some(slot) => Some((self.tape()?, slot)),
            None => None,
        };
        let summed = self.number()?;
        Some(GeneralPath { moves, groups, values_first, is_energy, tape, results, flags, settled, outside, summed })
    }

    fn tape(&mut self) -> Option<Tape> {
        let [slots, masks] = [self.number()?, self.number()?];
        let constants = self.list(|reader| {
            let slot = reader.short()?;
            if reader.number()? == 0 {
                return Some((slot, Constant::Pi));
            }
            let (&bytes, rest) = reader.rest.split_first_chunk()?;
            reader.rest = rest;
            Some((slot, Constant::Number(f64::from_le_bytes(bytes))))
        })?;
        let truths = self.list(|reader| Some((reader.short()?, reader.number()? == 1)))?;
        let operations = Operation::by_code();
        let instructions = self.list(|reader| {
            let (operation, target) = (*operations.get(reader.number()?)?, reader.short()?);
            let mut operands = [0; 6];
            for (place, operand) in reader.list(Self::short)?.into_iter().enumerate() {
                *operands.get_mut(place)? = operand;
            }
            Some(Instruction { operation, target, operands })
        })?;
        Some(Tape { slots, masks, constants, truths, instructions })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_are_read_as_they_were_written() {
        let instruction = |operation, target, operands| Instruction { operation, target, operands };
        let tape = Tape {
            slots: 300,
            masks: 2,
            constants: vec![(7, Constant::Number(-0.1)), (299, Constant::Pi), (8, Constant::Number(f64::INFINITY))],
            truths: vec![(0, true), (1, false)],
            instructions: vec![
                instruction(Operation::Mul, 20, [1, 0, 0, 0, 0, 0]),
                instruction(Operation::Select, 0, [1, 299, 200, 0, 0, 0]),
                instruction(Operation::MulThenTwoMulAdds, 1, [1, 2, 3, 4, 5, 65_535]),
            ],
        };
        let path = GeneralPath {
            moves: vec![true, false],
            groups: vec![1, 200],
            values_first: true,
            is_energy: false,
            outside: Some((tape.clone(), 1)),
            tape,
            results: vec![0, 128, 16_384],
            flags: [None, Some(0)],
            settled: [Some(65_535), None],
            summed: 1,
        };
        let bytes = EncodedPath::encode(&path);
        assert_eq!(Reader { rest: &bytes }.path().as_ref(), Some(&path));
        let without = GeneralPath { outside: None, ..path };
        let again = EncodedPath::encode(&without);
        assert_eq!(Reader { rest: &again }.path(), Some(without));
        // Every shorter list of bytes lacks something.
        assert!((0..bytes.len()).all(|length| Reader { rest: &bytes[..length] }.path().is_none()));
        let all = Operation::by_code();
        assert!(all.iter().enumerate().all(|(code, operation)| usize::from(*operation as u8) == code));
    }
}
