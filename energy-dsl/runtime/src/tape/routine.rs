//! The routines of an element as tapes.

use super::general::GeneralPath;
use super::instruction::Tape;
use super::scalar::Values;
use crate::RoutineKind;
use crate::numbers::{Flags, Level, Mask, Number};

/// The source of an input number.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Input {
    /// Number of the unknowns: coordinate point · 3 + axis of points.
    Position(u16),
    /// Number of the velocities, by increments of the unknowns.
    Velocity(u16),
    /// Increment of a rotation, 0. Derivatives are taken with respect to it; nothing reads it.
    Increment(u16),
    /// Index among the parameter numbers.
    Parameter(u16),
    /// Index among the rest-shape numbers.
    Rest(u16),
    /// Index among the numbers that the `rest` block computes once for each element.
    Precomputed(u16),
}

/// The numbers of each term of a sum of like terms. Term q reads the stored numbers 0 to `shared` − 1, then its own
/// `stride` numbers, from `shared` + q · `stride`, then row q of the table.
#[derive(Clone, Debug, PartialEq)]
pub struct Repetition {
    /// Stored numbers that all terms read.
    pub shared: usize,
    /// Stored numbers that one term reads.
    pub stride: usize,
    /// Constants of each term.
    pub table: Vec<Vec<f64>>,
}

impl Repetition {
    /// Returns the number of terms.
    #[must_use]
    pub fn terms(&self) -> usize {
        self.table.len()
    }

    /// Returns the source of a number that a term reads.
    #[must_use]
    pub fn number(&self, term: usize, number: usize) -> TermNumber {
        match number.checked_sub(self.shared) {
            None => TermNumber::Stored(number),
            Some(own) if own < self.stride => TermNumber::Stored(self.shared + term * self.stride + own),
            Some(own) => TermNumber::Constant(self.table[term][own - self.stride]),
        }
    }
}

/// The source of a number that one term of a sum reads.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum TermNumber {
    /// Index among the stored numbers of the element.
    Stored(usize),
    /// A constant of the formula.
    Constant(f64),
}

/// A routine as tapes.
#[derive(Clone, Debug)]
pub struct Routine {
    /// Kind of the routine.
    pub kind: RoutineKind,
    /// The inputs, in the order of the first slots.
    pub inputs: Vec<Input>,
    /// The ordinary path.
    pub tape: Tape,
    /// Slots of the results, group by group: value, gradient, ….
    pub groups: Vec<Vec<u16>>,
    /// Mask slots of the flags of the ordinary path: degenerate, kink.
    pub flags: [Option<u16>; 2],
    /// The general path; `None` without precautions.
    pub general: Option<General>,
}

/// The general path of a routine, and where the routine takes it.
#[derive(Clone, Debug)]
pub struct General {
    /// Mask slot of the ordinary tape: where the ordinary path suffices.
    pub ordinary: u16,
    /// Indices among the inputs of the routine, in the order of the path's inputs.
    pub inputs: Vec<u16>,
    /// Tape, results and flags of the path.
    pub path: GeneralPath,
}

impl Routine {
    /// Returns the number of results in each group.
    #[must_use]
    pub fn sizes(&self) -> Vec<usize> {
        self.groups.iter().map(Vec::len).collect()
    }

    /// Runs the routine on one element of any number type, on the general path where that is needed. Returns all
    /// results and the flags.
    #[must_use]
    pub fn run<T: Number, L: Level>(&self, inputs: &[T]) -> (Vec<T>, Flags<T>) {
        let values = self.tape.run::<T, L>(inputs.iter().cloned());
        match &self.general {
            Some(general) if !values.mask(Some(general.ordinary)).all() => {
                general.run(|input| inputs[usize::from(input)].clone())
            }
            _ => {
                let results = self.groups.iter().flatten().map(|&slot| values.number(slot)).collect();
                (results, flags(&values, self.flags))
            }
        }
    }
}

impl General {
    /// Runs the path for one element. `input` returns a number by its index among the inputs of the routine.
    #[cold]
    pub(super) fn run<T: Number>(&self, input: impl Fn(u16) -> T) -> (Vec<T>, Flags<T>) {
        let inputs: Vec<T> = self.inputs.iter().map(|&number| input(number)).collect();
        let mut results = vec![T::from_f64(0.0); self.path.results.len()];
        let flags = self.path.run(&inputs, T::Mask::from_bits(1), &mut results);
        (results, flags)
    }
}

pub(super) fn flags<T: Number>(values: &Values<T>, slots: [Option<u16>; 2]) -> Flags<T> {
    Flags { degenerate: values.mask(slots[0]), kink: values.mask(slots[1]) }
}

/// The routines of an element as tapes.
#[derive(Clone, Debug)]
pub struct Routines {
    /// Name of the element.
    pub name: String,
    /// Coordinates of the points, or unknowns of a residual. They are the first inputs of every routine but `rest`;
    /// velocities follow, if the routine reads any.
    pub coordinates: usize,
    /// Number of velocities: the coordinates in which the unknowns move.
    pub increments: usize,
    /// Number of parameter numbers.
    pub parameters: usize,
    /// Number of rest-shape numbers.
    pub shape: usize,
    /// The `rest` block: its results are the stored numbers; where its first flag is set, the shape is degenerate.
    pub rest: Routine,
    /// The state at rest, from the rest shape and the parameters; `None` if it is given with each element.
    pub at_rest: Option<Routine>,
    /// The moving part, or one term of it.
    pub list: Vec<Routine>,
    /// Expands the results of the reduced Hessian, its inputs, to U, ∂U/∂x and the triangle of ∂²U/∂x².
    pub expansion: Option<Routine>,
    /// The numbers of each term, if the routines compute one term of a sum.
    pub repetition: Option<Repetition>,
}

impl Routines {
    /// Returns a routine.
    #[must_use]
    pub fn find(&self, kind: RoutineKind) -> Option<&Routine> {
        self.list.iter().find(|routine| routine.kind == kind)
    }

    /// Returns whether a routine can be evaluated: the full Hessian of an energy is expanded from the reduced one.
    #[must_use]
    pub fn has(&self, kind: RoutineKind) -> bool {
        self.find(kind).is_some() || kind == RoutineKind::Hessian && self.expansion.is_some()
    }

    /// Returns the routine to run, and the expansion of its results, if they need any.
    #[must_use]
    pub fn expanded(&self, kind: RoutineKind) -> (RoutineKind, Option<&Routine>) {
        match &self.expansion {
            Some(expansion) if kind == RoutineKind::Hessian => (RoutineKind::ReducedHessian, Some(expansion)),
            _ => (kind, None),
        }
    }
}
