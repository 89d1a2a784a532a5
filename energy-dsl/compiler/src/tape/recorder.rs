//! Assigns slots to the results of statements.

use super::steps::{Step, steps};

use crate::graph::{Input, NodeId, Op};
use crate::plan::{Code, RETURNED};
use energy_runtime::tape::{Constant, Instruction, Operation, Tape};

/// A routine with more numbers than a tape has slots.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct TooLarge;

/// A path of a routine as a tape.
pub(crate) struct Recorded {
    pub(crate) tape: Tape,
    pub(crate) groups: Vec<Vec<u16>>,
    pub(crate) flags: [Option<u16>; 2],
    pub(crate) settled: [Option<u16>; 2],
    pub(crate) guard: Option<u16>,
}

/// Writes statements to a tape. The inputs have the first slots, in the given order.
pub(crate) fn record(code: &Code, inputs: &[Input]) -> Result<Recorded, TooLarge> {
    let list = code.statements.list();
    let steps = steps(code);
    let mut last_uses = vec![0; list.len()];
    for (place, step) in steps.iter().enumerate() {
        step.iter().flat_map(|step| &step.reads).for_each(|&operand| last_uses[operand] = place);
    }
    code.returned().for_each(|result| last_uses[result.0 as usize] = RETURNED);
    let mut recorder = Recorder { numbers: Slots::of(inputs.len()), ..Recorder::default() };
    for op in list {
        recorder.place_fixed(*op, inputs)?;
    }
    for (place, step) in steps.iter().enumerate() {
        if let Some(step) = step {
            recorder.compute(place, step, list, &last_uses)?;
        }
    }
    let Recorder { numbers, masks, mut tape, places } = recorder;
    (tape.slots, tape.masks) = (numbers.count, masks.count);
    let place = |at: NodeId| places[at.0 as usize];
    Ok(Recorded {
        tape,
        groups: code.groups.iter().map(|group| group.iter().map(|&at| place(at)).collect()).collect(),
        flags: code.flags.map(|flag| flag.map(place)),
        settled: code.settled.map(|mask| mask.map(place)),
        guard: code.guard.map(place),
    })
}

/// Slots of numbers or of masks.
#[derive(Default)]
struct Slots {
    count: usize,
    /// Slots that no later statement reads, the last one freed last.
    free: Vec<u16>,
}

impl Slots {
    fn of(count: usize) -> Self {
        Self { count, free: Vec::new() }
    }

    fn take(&mut self) -> Result<u16, TooLarge> {
        if let Some(slot) = self.free.pop() {
            return Ok(slot);
        }
        self.count += 1;
        u16::try_from(self.count - 1).map_err(|_| TooLarge)
    }
}

#[derive(Default)]
struct Recorder {
    numbers: Slots,
    masks: Slots,
    tape: Tape,
    /// Slot of each statement's result.
    places: Vec<u16>,
}

impl Recorder {
    /// Gives inputs and constants slots that are never reused: they are filled once.
    fn place_fixed(&mut self, op: Op, inputs: &[Input]) -> Result<(), TooLarge> {
        let constant = match op {
            Op::Input(input) => {
                let slot = inputs.iter().position(|&other| other == input).expect("compiler bug: all inputs are given");
                self.places.push(u16::try_from(slot).map_err(|_| TooLarge)?);
                return Ok(());
            }
            Op::Truth(truth) => {
                let slot = self.masks.take()?;
                self.tape.truths.push((slot, truth));
                self.places.push(slot);
                return Ok(());
            }
            Op::Constant(bits) => Constant::Number(f64::from_bits(bits)),
            Op::Pi => Constant::Pi,
            _ => {
                self.places.push(0);
                return Ok(());
            }
        };
        let slot = self.numbers.take()?;
        self.tape.constants.push((slot, constant));
        self.places.push(slot);
        Ok(())
    }

    fn compute(&mut self, place: usize, step: &Step, list: &[Op], last_uses: &[usize]) -> Result<(), TooLarge> {
        let mut operands = [0; 6];
        for (slot, &operand) in operands.iter_mut().zip(&step.reads) {
            *slot = self.places[operand];
        }
        if let Op::IsModerate(_, degree) = list[place] {
            operands[1] = u16::from(degree);
        }
        for (number, &operand) in step.reads.iter().enumerate() {
            let is_last = last_uses[operand] == place && !step.reads[..number].contains(&operand);
            if is_last && !is_fixed(list[operand]) {
                let slot = self.places[operand];
                self.slots(list[operand]).free.push(slot);
            }
        }
        let target = self.slots(list[place]).take()?;
        self.places[place] = target;
        self.tape.instructions.push(Instruction { operation: step.operation, target, operands });
        // A result that nothing reads: a planted fault may leave one.
        if last_uses[place] == 0 {
            self.slots(list[place]).free.push(target);
        }
        Ok(())
    }

    /// Returns the slots for the result of an operation.
    fn slots(&mut self, op: Op) -> &mut Slots {
        if op.is_mask() { &mut self.masks } else { &mut self.numbers }
    }
}

pub(super) fn is_fixed(op: Op) -> bool {
    matches!(op, Op::Input(_) | Op::Constant(_) | Op::Pi | Op::Truth(_))
}

/// Returns the operation of a statement.
pub(super) fn operation(op: Op) -> Operation {
    op.on_tape().expect("compiler bug: inputs and constants have slots, rules are resolved and caution is decided")
}
