//! Evaluation of a range of elements.

use std::ops::Range;
use std::slice;

use super::TAPE_BLOCK;
use super::packed::TapeElements;
use super::routine::Routine;
use super::runner::{Places, Runner};
use super::slots::{Results, Slots};
use crate::RoutineKind;
use crate::batch::{BatchError, Flagged};
use crate::numbers::{Flags, Float, Kernel, Lane, Level, Number, dispatch, prefetch_rows};

/// The numbers of one group of results that a caller wants, element by element.
#[derive(Debug)]
pub struct Output<'a, S> {
    /// Name, for messages.
    pub name: &'static str,
    /// Indices among the results of the routine, in the order of an element's numbers.
    pub layout: &'a [u16],
    /// Receives the numbers: as many per element as `layout` has.
    pub numbers: &'a mut [S],
}

/// The results of one block of elements.
#[derive(Debug)]
pub struct BlockResults<'a, S> {
    /// Index of the first element.
    pub first: usize,
    /// Number of elements, at most [`TAPE_BLOCK`].
    pub count: usize,
    /// The results of the routine, in the order of its groups.
    pub results: Results<'a, S>,
    /// Bits of the flagged elements: degenerate, kink.
    pub flags: [u64; 2],
}

impl<S: Float> TapeElements<S> {
    /// Calls `work` with the results of a routine, block by block, for ranges of elements that start at multiples of
    /// [`TAPE_BLOCK`]. [`Places::Rows`] start with the first range.
    ///
    /// # Panics
    /// When the element has no such routine, or a range or a slice does not fit.
    pub fn for_each_block(
        &self,
        routine: RoutineKind,
        ranges: &[Range<usize>],
        places: Places<'_, S>,
        velocities: Option<Places<'_, S>>,
        work: &mut impl FnMut(BlockResults<'_, S>),
    ) {
        let Some(routine) = self.routines.find(routine) else {
            panic!("{}: no {}", self.routines.name, routine.name())
        };
        let mut runner = Runner::new(self, routine);
        let rows = ranges.first().map_or(0, |range| range.start);
        for range in ranges {
            for first in range.clone().step_by(TAPE_BLOCK) {
                let count = TAPE_BLOCK.min(range.end - first);
                runner.run(rows, first, count, places, velocities);
                work(BlockResults { first, count, results: runner.results(), flags: runner.flags() });
            }
        }
        runner.finish();
    }

    /// Writes the results of a routine for a range of elements that starts at a multiple of [`TAPE_BLOCK`].
    ///
    /// Outputs belong to the range alone, and so do [`Places::Rows`].
    ///
    /// # Errors
    /// When range, places and outputs do not fit each other. Nothing was written then.
    ///
    /// # Panics
    /// When the element has no such routine, or a layout names a result that does not exist.
    pub fn evaluate(
        &self,
        routine: RoutineKind,
        range: Range<usize>,
        places: Places<'_, S>,
        velocities: Option<Places<'_, S>>,
        outputs: &mut [Output<'_, S>],
    ) -> Result<Flagged, BatchError> {
        self.check(&range, [Some(places), velocities].into_iter().flatten(), outputs)?;
        let (routine, expansion) = self.routines.expanded(routine);
        let mut expander = expansion.and_then(|_| Expander::new(self));
        let mut flagged = Vec::new();
        self.for_each_block(routine, slice::from_ref(&range), places, velocities, &mut |block| {
            let BlockResults { first, count, results, flags } = block;
            let results = match &mut expander {
                Some(expander) => expander.expand(count, results),
                None => results,
            };
            for Output { layout, numbers, .. } in outputs.iter_mut() {
                let rows = &mut numbers[(first - range.start) * layout.len()..];
                dispatch(StoreRows { results, layout, count, rows });
            }
            if flags != [0; 2] {
                note_flags(&mut flagged, first, flags);
            }
        });
        expander.into_iter().for_each(Expander::finish);
        Ok(flagged)
    }

    /// Returns the results of a routine for the first element, by group, and whether it is degenerate or at a kink.
    ///
    /// # Panics
    /// When the element has no such routine, or the places have another size.
    #[must_use]
    pub fn one(
        &self,
        routine: RoutineKind,
        places: Places<'_, S>,
        velocities: Option<Places<'_, S>>,
    ) -> (Vec<Vec<S>>, [bool; 2]) {
        let (routine, expansion) = self.routines.expanded(routine);
        let mut expander = expansion.and_then(|_| Expander::new(self));
        let sizes = expansion.or_else(|| self.routines.find(routine)).map(Routine::sizes).unwrap_or_default();
        let (mut groups, mut flagged) = (Vec::with_capacity(sizes.len()), [false; 2]);
        self.for_each_block(routine, slice::from_ref(&(0..1)), places, velocities, &mut |block| {
            let BlockResults { results, flags, .. } = block;
            let results = match &mut expander {
                Some(expander) => expander.expand(1, results),
                None => results,
            };
            let mut numbers = (0..results.len()).map(|result| results.number(result)[0]);
            groups.extend(sizes.iter().map(|&size| numbers.by_ref().take(size).collect::<Vec<_>>()));
            flagged = flags.map(|bits| bits & 1 == 1);
        });
        (groups, flagged)
    }

    fn check<'p>(
        &self,
        range: &Range<usize>,
        places: impl Iterator<Item = Places<'p, S>>,
        outputs: &[Output<'_, S>],
    ) -> Result<(), BatchError>
    where
        S: 'p,
    {
        if range.start > range.end || range.end > self.count || !range.start.is_multiple_of(TAPE_BLOCK) {
            return Err(BatchError::Range { range: range.clone(), elements: self.count, block: TAPE_BLOCK });
        }
        let input = |of, needed: usize, given: usize| match needed == given {
            true => Ok(()),
            false => Err(BatchError::Input { of, needed, given }),
        };
        // Positions come first, then velocities.
        let widths = [self.routines.coordinates, self.routines.increments];
        for (places, width) in places.into_iter().zip(widths) {
            match places {
                Places::Rows(rows) => input("coordinates", range.len() * width, rows.len())?,
                Places::Gathered { vectors, stencils } => {
                    let needed = self.count.next_multiple_of(TAPE_BLOCK) * self.routines.coordinates / 3;
                    input("stencils", needed, stencils.len())?;
                    if let Some(&last) = stencils.iter().max().filter(|&&last| last as usize >= vectors.len()) {
                        return Err(BatchError::Missing { needed: last as usize + 1, given: vectors.len() });
                    }
                }
            }
        }
        outputs.iter().try_for_each(|output| {
            let (of, needed, given) = (output.name, range.len() * output.layout.len(), output.numbers.len());
            if needed == given { Ok(()) } else { Err(BatchError::Output { of, needed, given }) }
        })
    }
}

/// Expands reduced derivatives of a block to points.
#[derive(Debug)]
pub struct Expander<'a, S> {
    elements: &'a TapeElements<S>,
    routine: &'a Routine,
    slots: Slots<S>,
}

impl<'a, S: Float> Expander<'a, S> {
    /// Prepares the expansion of energies; `None` if elements of this kind lack it.
    #[must_use]
    pub fn new(elements: &'a TapeElements<S>) -> Option<Self> {
        let routine = elements.routines.expansion.as_ref()?;
        let slots = elements.spare.take_expansion().unwrap_or_else(|| Slots::new(routine));
        Some(Self { elements, routine, slots })
    }

    /// Returns the slots to the elements, for the next call.
    pub fn finish(self) {
        self.elements.spare.put_expansion(self.slots);
    }

    /// Returns U, ∂U/∂x and the triangle of ∂²U/∂x² for the results of the reduced Hessian.
    pub fn expand(&mut self, count: usize, reduced: Results<'_, S>) -> Results<'_, S> {
        for (slot, number) in self.slots.numbers_mut().iter_mut().zip(0..reduced.len()) {
            *slot = *reduced.number(number);
        }
        self.slots.run(self.routine, count);
        self.slots.results()
    }
}

#[cold]
fn note_flags(flagged: &mut Flagged, first: usize, [degenerate, kink]: [u64; 2]) {
    let is_set = |bits: u64, element: usize| bits >> element & 1 == 1;
    let elements = (0..TAPE_BLOCK).filter(|&element| is_set(degenerate | kink, element));
    let flags = |element| Flags { degenerate: is_set(degenerate, element), kink: is_set(kink, element) };
    flagged.extend(elements.map(|element| (first + element, flags(element))));
}

/// Writes results to rows, one per element.
struct StoreRows<'a, S> {
    results: Results<'a, S>,
    layout: &'a [u16],
    count: usize,
    rows: &'a mut [S],
}

/// Numbers that are transposed together: a cache line of doubles.
const TOGETHER: usize = 8;

impl<S: Float> Kernel for StoreRows<'_, S> {
    type Output = ();

    #[inline(always)]
    fn run<L: Level>(self) {
        let Self { results, layout, count, rows } = self;
        let (width, lanes) = (layout.len(), <S::Lanes<L> as Lane<S>>::LANES);
        if width == 1 {
            let numbers = results.number(usize::from(layout[0]));
            return rows[..count].copy_from_slice(&numbers[..count]);
        }
        let mut numbers = [S::Lanes::<L>::from_f64(0.0); TOGETHER];
        let mut first = 0;
        while first < count {
            let together = lanes.min(count - first);
            for (part, layout) in layout.chunks(TOGETHER).enumerate() {
                for (number, &result) in numbers.iter_mut().zip(layout) {
                    *number = S::Lanes::<L>::load(&results.number(usize::from(result))[first..]);
                }
                let rows = &mut rows[first * width + part * TOGETHER..];
                S::Lanes::<L>::store_transposed(&numbers[..layout.len()], together, rows, width);
            }
            first += lanes;
            let next = rows.get(first * width..).unwrap_or_default();
            prefetch_rows(&next[..next.len().min(lanes * width)], width);
        }
    }
}
