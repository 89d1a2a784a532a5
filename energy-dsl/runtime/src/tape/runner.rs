//! Runs one routine of many elements, block by block.

use std::sync::{Mutex, MutexGuard, PoisonError};

use super::TAPE_BLOCK;
use super::lanes::Slot;
use super::packed::TapeElements;
use super::routine::{Input, Routine, TermNumber};
use super::slots::{Results, Slots};
use crate::RoutineKind;
use crate::numbers::{Float, Kernel, Lane, Level, dispatch};

/// Places of the points (or unknowns) of elements, or of the velocities of these points.
#[derive(Clone, Copy, Debug)]
pub enum Places<'a, S> {
    /// All coordinates of each element, one element after the other.
    Rows(&'a [S]),
    /// Vectors of a mesh and their indices, as [`stencil_blocks`] arranges them.
    Gathered {
        /// One vector per vertex.
        vectors: &'a [[S; 3]],
        /// Indices by block, point, element.
        stencils: &'a [u32],
    },
}

/// Arranges the stencils of elements with `points` points for [`Places::Gathered`]: by block of [`TAPE_BLOCK`]
/// elements, point, element. Surplus elements of the last block repeat the last one. `vertex(element, point)` is an
/// index.
#[must_use]
pub fn stencil_blocks(count: usize, points: usize, vertex: impl Fn(usize, usize) -> u32) -> Vec<u32> {
    let mut stencils = Vec::with_capacity(count.next_multiple_of(TAPE_BLOCK) * points);
    for first in (0..count).step_by(TAPE_BLOCK) {
        for point in 0..points {
            stencils.extend((first..first + TAPE_BLOCK).map(|element| vertex(element.min(count - 1), point)));
        }
    }
    stencils
}

impl<S: Float> Places<'_, S> {
    /// Fills the slots of `slots.len()` coordinates, for the `count` elements from `first` on, a multiple of
    /// [`TAPE_BLOCK`]. `rows` is the index of the first row.
    fn fill(self, rows: usize, first: usize, count: usize, slots: &mut [Slot<S>]) {
        match self {
            Self::Rows(numbers) => {
                let width = slots.len();
                for element in 0..TAPE_BLOCK {
                    let row = &numbers[(first - rows + element.min(count - 1)) * width..][..width];
                    for (slot, &number) in slots.iter_mut().zip(row) {
                        slot[element] = number;
                    }
                }
            }
            Self::Gathered { vectors, stencils } => {
                let per_block = slots.len() / 3 * TAPE_BLOCK;
                dispatch(Gather { vectors, stencils: &stencils[first / TAPE_BLOCK * per_block..][..per_block], slots });
            }
        }
    }
}

/// Gathers the vectors of a block.
struct Gather<'a, S> {
    vectors: &'a [[S; 3]],
    stencils: &'a [u32],
    slots: &'a mut [Slot<S>],
}

impl<S: Float> Kernel for Gather<'_, S> {
    type Output = ();

    #[inline(always)]
    fn run<L: Level>(self) {
        let axes = self.slots.as_chunks_mut::<3>().0;
        for (slots, indices) in axes.iter_mut().zip(self.stencils.as_chunks::<TAPE_BLOCK>().0) {
            let mut at = 0;
            while at < TAPE_BLOCK {
                let [x, y, z] = S::Lanes::<L>::gather(self.vectors, &indices[at..]);
                x.store(&mut slots[0][at..]);
                y.store(&mut slots[1][at..]);
                z.store(&mut slots[2][at..]);
                at += <S::Lanes<L> as Lane<S>>::LANES;
            }
        }
    }
}

/// One routine of some elements, with the slots that it runs on.
#[derive(Debug)]
pub(super) struct Runner<'a, S> {
    elements: &'a TapeElements<S>,
    routine: &'a Routine,
    state: State<S>,
}

/// The slots of a routine, ready for blocks of the elements that they belong to.
#[derive(Debug)]
struct State<S> {
    routine: RoutineKind,
    slots: Slots<S>,
    /// Slots and numbers of the inputs that differ between elements, but not between terms.
    stored: Vec<(usize, usize)>,
    /// Slots of the inputs that differ between terms, and their indices among the numbers of a term.
    of_term: Vec<(usize, usize)>,
    /// The sum over all terms; `None` if the element is not a sum of like terms.
    sum: Option<Sum<S>>,
}

/// Slots that no thread uses. Filling new ones costs as much as some blocks.
#[derive(Debug)]
pub(super) struct Spare<S> {
    states: Mutex<Vec<State<S>>>,
    /// Slots of the expansion.
    expansions: Mutex<Vec<Slots<S>>>,
}

impl<S> Default for Spare<S> {
    fn default() -> Self {
        Self { states: Mutex::default(), expansions: Mutex::default() }
    }
}

/// A copy starts without slots.
impl<S> Clone for Spare<S> {
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl<S> Spare<S> {
    fn take(&self, routine: RoutineKind) -> Option<State<S>> {
        let mut states = lock(&self.states);
        states.iter().position(|state| state.routine == routine).map(|found| states.swap_remove(found))
    }

    pub(super) fn take_expansion(&self) -> Option<Slots<S>> {
        lock(&self.expansions).pop()
    }

    pub(super) fn put_expansion(&self, slots: Slots<S>) {
        lock(&self.expansions).push(slots);
    }
}

fn lock<T>(list: &Mutex<T>) -> MutexGuard<'_, T> {
    list.lock().unwrap_or_else(PoisonError::into_inner)
}

impl<S: Float> State<S> {
    fn new(elements: &TapeElements<S>, routine: &Routine) -> Self {
        let mut slots = Slots::new(routine);
        let repetition = elements.routines.repetition.as_ref();
        let (mut stored, mut of_term) = (Vec::new(), Vec::new());
        for (slot, input) in routine.inputs.iter().enumerate() {
            let number = match *input {
                Input::Position(_) | Input::Velocity(_) => continue,
                Input::Increment(_) => unreachable!("compiler bug: increments are 0, and nothing reads them"),
                Input::Parameter(number) => usize::from(number),
                Input::Precomputed(number) if repetition.is_some_and(|all| usize::from(number) >= all.shared) => {
                    of_term.push((slot, usize::from(number)));
                    continue;
                }
                Input::Precomputed(number) => elements.routines.parameters + usize::from(number),
                Input::Rest(_) => unreachable!("compiler bug: the rest shape is read when an element is made"),
            };
            match elements.numbers.shared(number) {
                Some(value) => slots.numbers_mut()[slot].fill(value),
                None => stored.push((slot, number)),
            }
        }
        let sum = repetition.map(|_| Sum::new(routine));
        Self { routine: routine.kind, slots, stored, of_term, sum }
    }
}

impl<'a, S: Float> Runner<'a, S> {
    pub(super) fn new(elements: &'a TapeElements<S>, routine: &'a Routine) -> Self {
        let state = elements.spare.take(routine.kind).unwrap_or_else(|| State::new(elements, routine));
        Self { elements, routine, state }
    }

    /// Returns the slots to the elements, for the next call.
    pub(super) fn finish(self) {
        lock(&self.elements.spare.states).push(self.state);
    }

    /// Runs the routine on the `count` elements from `first` on, a multiple of [`TAPE_BLOCK`]. Rows of `places` and
    /// `velocities` start with element `rows`.
    pub(super) fn run(
        &mut self,
        rows: usize,
        first: usize,
        count: usize,
        places: Places<'_, S>,
        velocities: Option<Places<'_, S>>,
    ) {
        let Self { elements, routine, state: State { slots, stored, of_term, sum, .. } } = self;
        let coordinates = elements.routines.coordinates;
        let (positions, others) = slots.numbers_mut().split_at_mut(coordinates);
        places.fill(rows, first, count, positions);
        if let Some(velocities) = velocities.filter(|_| reads_velocities(routine, coordinates)) {
            velocities.fill(rows, first, count, &mut others[..elements.routines.increments]);
        }
        let block = first / TAPE_BLOCK;
        for &(slot, number) in &*stored {
            elements.numbers.fill(number, block, &mut slots.numbers_mut()[slot]);
        }
        let (Some(sum), Some(repetition)) = (sum, &elements.routines.repetition) else {
            return slots.run(routine, count);
        };
        sum.clear();
        for term in 0..repetition.terms() {
            for &(slot, number) in &*of_term {
                let slot = &mut slots.numbers_mut()[slot];
                match repetition.number(term, number) {
                    TermNumber::Stored(number) => {
                        elements.numbers.fill(elements.routines.parameters + number, block, slot);
                    }
                    TermNumber::Constant(value) => slot.fill(S::from_f64(value)),
                }
            }
            slots.run(routine, count);
            sum.add(slots);
        }
        sum.note_overflow(routine, count);
    }

    /// Returns the results of the last block.
    pub(super) fn results(&self) -> Results<'_, S> {
        self.state.sum.as_ref().map_or_else(|| self.state.slots.results(), Sum::results)
    }

    /// Returns the bits of the last block's flagged elements: degenerate, kink.
    pub(super) fn flags(&self) -> [u64; 2] {
        self.state.sum.as_ref().map_or(self.state.slots.flags, |sum| sum.flags)
    }
}

fn reads_velocities(routine: &Routine, coordinates: usize) -> bool {
    matches!(routine.inputs.get(coordinates), Some(Input::Velocity(_)))
}

/// The sum of a routine's results over like terms.
#[derive(Debug)]
struct Sum<S> {
    numbers: Vec<Slot<S>>,
    identity: Vec<u16>,
    flags: [u64; 2],
}

impl<S: Float> Sum<S> {
    fn new(routine: &Routine) -> Self {
        let count = routine.groups.iter().map(Vec::len).sum();
        let numbers = vec![[S::from_f64(0.0); TAPE_BLOCK]; count];
        Self { numbers, identity: (0..=u16::MAX).take(count).collect(), flags: [0; 2] }
    }

    fn clear(&mut self) {
        self.numbers.as_flattened_mut().fill(S::from_f64(0.0));
        self.flags = [0; 2];
    }

    fn add(&mut self, term: &Slots<S>) {
        dispatch(Add { sum: &mut self.numbers, term: term.results() });
        self.flags = [0, 1].map(|flag| self.flags[flag] | term.flags[flag]);
    }

    /// Flags elements whose sum overflows, in the order of summation of generated code.
    fn note_overflow(&mut self, routine: &Routine, count: usize) {
        let is_reduced = routine.kind == RoutineKind::ReducedHessian;
        for element in 0..count {
            let (mut sum, mut first) = (S::from_f64(0.0), 0);
            for size in routine.sizes() {
                let group = &self.numbers[first..first + size];
                first += size;
                let mut all = S::from_f64(0.0);
                for vector in group.chunks(if is_reduced || size == 1 { 1 } else { 3 }) {
                    let of_vector = vector.iter().skip(1).fold(vector[0][element], |sum, number| sum + number[element]);
                    all = all + of_vector;
                }
                sum = sum + all;
            }
            self.flags[0] |= u64::from(!sum.is_representable()) << element;
        }
    }

    fn results(&self) -> Results<'_, S> {
        Results::new(&self.numbers, &self.identity)
    }
}

/// Adds the results of one term.
struct Add<'a, S> {
    sum: &'a mut [Slot<S>],
    term: Results<'a, S>,
}

impl<S: Float> Kernel for Add<'_, S> {
    type Output = ();

    #[inline(always)]
    fn run<L: Level>(self) {
        for (number, sum) in self.sum.iter_mut().enumerate() {
            let term = self.term.number(number);
            let mut at = 0;
            while at < TAPE_BLOCK {
                let total = S::Lanes::<L>::load(&sum[at..]) + S::Lanes::<L>::load(&term[at..]);
                total.store(&mut sum[at..]);
                at += <S::Lanes<L> as Lane<S>>::LANES;
            }
        }
    }
}
