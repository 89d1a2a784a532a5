//! Elements of one declaration with their numbers, as blocks.

use std::sync::Arc;

use super::TAPE_BLOCK;
use super::lanes::Slot;
use super::routine::{Input, Routine, Routines};
use super::runner::Spare;
use super::slots::Slots;
use crate::aligned::Aligned;
use crate::element::RestError;
use crate::numbers::{Float, Number};

/// The numbers of one parameter or one part of the rest shape.
#[derive(Clone, Copy, Debug)]
pub enum Column<'a, S> {
    /// The numbers that all elements share.
    Same(&'a [S]),
    /// The numbers of each element, one element after the other.
    Each(&'a [S]),
}

/// Elements of one declaration with their parameters and stored numbers, ready to be evaluated at any positions.
#[derive(Clone, Debug)]
pub struct TapeElements<S = f64> {
    pub(super) routines: Arc<Routines>,
    pub(super) count: usize,
    /// The parameters, then the stored numbers.
    pub(super) numbers: Numbers<S>,
    pub(super) spare: Spare<S>,
}

/// Numbers of elements. Those that all elements share are held once.
#[derive(Clone, Debug)]
pub(super) struct Numbers<S> {
    sources: Vec<Source<S>>,
    /// Numbers that differ between elements.
    columns: usize,
    /// Indexed by block, column, element. Surplus elements of the last block repeat the last one.
    blocks: Aligned<S>,
}

#[derive(Clone, Copy, Debug)]
enum Source<S> {
    Same(S),
    /// Index of a column.
    Each(usize),
}

impl<S: Float> Numbers<S> {
    /// Creates the numbers of `count` elements from a list of columns.
    fn new(count: usize, columns: &[(Column<'_, S>, usize)]) -> Self {
        let mut sources = Vec::new();
        let mut each = Vec::new();
        for &(column, size) in columns {
            for number in 0..size {
                sources.push(match column {
                    Column::Same(numbers) => Source::Same(numbers[number]),
                    Column::Each(numbers) => {
                        each.push((numbers, size, number));
                        Source::Each(each.len() - 1)
                    }
                });
            }
        }
        let blocks = count.div_ceil(TAPE_BLOCK);
        let mut stored = Aligned::new(blocks * each.len() * TAPE_BLOCK, S::from_f64(0.0));
        for (place, slot) in stored.as_chunks_mut::<TAPE_BLOCK>().0.iter_mut().enumerate() {
            let (block, (numbers, size, number)) = (place / each.len(), each[place % each.len()]);
            for (element, stored) in slot.iter_mut().enumerate() {
                *stored = numbers[(block * TAPE_BLOCK + element).min(count - 1) * size + number];
            }
        }
        Self { sources, columns: each.len(), blocks: stored }
    }

    /// Returns the number that all elements share; `None` if it differs.
    pub(super) fn shared(&self, number: usize) -> Option<S> {
        match self.sources[number] {
            Source::Same(value) => Some(value),
            Source::Each(_) => None,
        }
    }

    /// Replaces a number by one that all elements share.
    fn share(&mut self, number: usize, value: S) {
        match &mut self.sources[number] {
            Source::Same(shared) => *shared = value,
            &mut Source::Each(column) => self.fill_column(column, |_| value),
        }
    }

    /// Replaces a number by a function of the `count` elements. It gets a column if they shared it.
    fn set_each(&mut self, number: usize, count: usize, value: impl Fn(usize) -> S) {
        let column = match self.sources[number] {
            Source::Each(column) => column,
            Source::Same(_) => self.add_column(count.div_ceil(TAPE_BLOCK)),
        };
        self.sources[number] = Source::Each(column);
        self.fill_column(column, |element| value(element.min(count.saturating_sub(1))));
    }

    /// Replaces a column by a function of the elements, with surplus ones of the last block.
    fn fill_column(&mut self, column: usize, value: impl Fn(usize) -> S) {
        let slots = self.blocks.as_chunks_mut::<TAPE_BLOCK>().0.iter_mut();
        for (block, slot) in slots.skip(column).step_by(self.columns).enumerate() {
            slot.iter_mut().enumerate().for_each(|(at, stored)| *stored = value(block * TAPE_BLOCK + at));
        }
    }

    /// Adds a column of zeros for this many blocks, and returns its index.
    fn add_column(&mut self, count: usize) -> usize {
        let old = self.columns;
        let mut blocks = Aligned::new(count * (old + 1) * TAPE_BLOCK, S::from_f64(0.0));
        for (place, slot) in blocks.as_chunks_mut::<TAPE_BLOCK>().0.iter_mut().enumerate() {
            let (block, column) = (place / (old + 1), place % (old + 1));
            if column < old {
                *slot = self.blocks.as_chunks::<TAPE_BLOCK>().0[block * old + column];
            }
        }
        (self.blocks, self.columns) = (blocks, old + 1);
        old
    }

    /// Returns a number of an element.
    fn of(&self, number: usize, element: usize) -> S {
        match self.sources[number] {
            Source::Same(value) => value,
            Source::Each(column) => {
                self.blocks.as_chunks::<TAPE_BLOCK>().0[element / TAPE_BLOCK * self.columns + column]
                    [element % TAPE_BLOCK]
            }
        }
    }

    /// Fills a slot with a number of a block's elements.
    #[inline]
    pub(super) fn fill(&self, number: usize, block: usize, slot: &mut Slot<S>) {
        match self.sources[number] {
            Source::Same(value) => slot.fill(value),
            Source::Each(column) => *slot = self.blocks.as_chunks().0[block * self.columns + column],
        }
    }
}

impl<S: Float> TapeElements<S> {
    /// Creates `count` elements from their rest shapes and parameters, each a list of columns with their sizes.
    ///
    /// # Errors
    /// Returns the index of the first element with a degenerate rest shape.
    ///
    /// # Panics
    /// When the columns do not have the declared sizes.
    pub fn new(
        routines: Arc<Routines>,
        count: usize,
        rest: &[(Column<'_, S>, usize)],
        parameters: &[(Column<'_, S>, usize)],
    ) -> Result<Self, (usize, RestError)> {
        let total = |columns: &[(Column<'_, S>, usize)]| columns.iter().map(|(_, size)| size).sum::<usize>();
        assert_eq!(total(rest), routines.shape, "{}: the columns of the rest shape", routines.name);
        assert_eq!(total(parameters), routines.parameters, "{}: the columns of parameters", routines.name);
        let stored = Stored::of(&routines, &routines.rest, count, rest, parameters)?;
        let mut columns = parameters.to_vec();
        columns.push((stored.column(), routines.rest.groups[0].len()));
        let numbers = Numbers::new(count, &columns);
        Ok(Self { routines, count, numbers, spare: Spare::default() })
    }

    /// Returns the states at rest of `count` elements, one element after the other, from their rest shapes and their
    /// parameters without the state, each a list of columns with their sizes. `None` if the declaration gives none.
    ///
    /// # Errors
    /// Returns the index of the first element whose state has no value.
    ///
    /// # Panics
    /// When the columns do not have the declared sizes.
    pub fn states_at_rest(
        routines: &Routines,
        count: usize,
        rest: &[(Column<'_, S>, usize)],
        parameters: &[(Column<'_, S>, usize)],
    ) -> Result<Option<Vec<S>>, (usize, RestError)> {
        let Some(routine) = &routines.at_rest else { return Ok(None) };
        Ok(Some(match Stored::of(routines, routine, count, rest, parameters)? {
            Stored::Same(state) => state.repeat(count),
            Stored::Each(states) => states,
        }))
    }

    /// Replaces consecutive numbers of the parameters, from `first` on. The numbers of the `rest` block do not change.
    ///
    /// # Panics
    /// When the column does not have `size` numbers, of each element or of all, or the parameters end before.
    pub fn set_parameters(&mut self, first: usize, size: usize, column: Column<'_, S>) {
        let (of_one, count) = match column {
            Column::Same(numbers) => (numbers, 1),
            Column::Each(numbers) => (numbers, self.count),
        };
        assert_eq!(of_one.len(), count * size, "{}: a column of parameters", self.routines.name);
        assert!(first + size <= self.routines.parameters, "{}: numbers of the parameters", self.routines.name);
        for number in 0..size {
            match column {
                Column::Same(numbers) => self.numbers.share(first + number, numbers[number]),
                Column::Each(numbers) => {
                    self.numbers.set_each(first + number, self.count, |element| numbers[element * size + number]);
                }
            }
        }
        // Slots know which numbers are shared.
        self.spare = Spare::default();
    }

    /// Returns the number of elements.
    #[must_use]
    pub fn len(&self) -> usize {
        self.count
    }

    /// Returns whether the list is empty.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.count == 0
    }

    /// Returns the parameters and the stored numbers of an element.
    ///
    /// # Panics
    /// When the index is too large.
    #[must_use]
    pub fn numbers_of(&self, element: usize) -> Vec<S> {
        assert!(element < self.count, "element {element} of {}", self.count);
        (0..self.numbers.sources.len()).map(|number| self.numbers.of(number, element)).collect()
    }

    /// Returns the elements at some indices.
    ///
    /// # Panics
    /// When the index is too large.
    #[must_use]
    pub fn selected(&self, indices: &[usize]) -> Self {
        let blocks = indices.len().div_ceil(TAPE_BLOCK);
        let columns = self.numbers.columns;
        let mut stored = Aligned::new(blocks * columns * TAPE_BLOCK, S::from_f64(0.0));
        let old = self.numbers.blocks.as_chunks::<TAPE_BLOCK>().0;
        for (place, slot) in stored.as_chunks_mut::<TAPE_BLOCK>().0.iter_mut().enumerate() {
            let (block, column) = (place / columns, place % columns);
            for (element, number) in slot.iter_mut().enumerate() {
                let index = indices[(block * TAPE_BLOCK + element).min(indices.len() - 1)];
                *number = old[index / TAPE_BLOCK * columns + column][index % TAPE_BLOCK];
            }
        }
        let numbers = Numbers { sources: self.numbers.sources.clone(), columns, blocks: stored };
        Self { routines: Arc::clone(&self.routines), count: indices.len(), numbers, spare: Spare::default() }
    }

    /// Returns the routines.
    #[must_use]
    pub fn routines(&self) -> &Routines {
        &self.routines
    }
}

/// The stored numbers of elements, one element after the other.
enum Stored<S> {
    Same(Vec<S>),
    Each(Vec<S>),
}

impl<S: Float> Stored<S> {
    fn column(&self) -> Column<'_, S> {
        match self {
            Self::Same(numbers) => Column::Same(numbers),
            Self::Each(numbers) => Column::Each(numbers),
        }
    }

    /// Runs the `rest` block of all elements, or what else is computed once; of one, if they all share its inputs.
    fn of(
        routines: &Routines,
        routine: &Routine,
        count: usize,
        rest: &[(Column<'_, S>, usize)],
        parameters: &[(Column<'_, S>, usize)],
    ) -> Result<Self, (usize, RestError)> {
        let size = routine.groups[0].len();
        let inputs = Numbers::new(count, &[rest, parameters].concat());
        let place = |input: &Input| match *input {
            Input::Rest(number) => usize::from(number),
            Input::Parameter(number) => routines.shape + usize::from(number),
            _ => unreachable!("compiler bug: the rest block reads rest shape and parameters only"),
        };
        let is_same = count > 0 && routine.inputs.iter().all(|input| inputs.shared(place(input)).is_some());
        let elements = if is_same { 1 } else { count };
        let mut numbers = vec![S::from_f64(0.0); elements * size];
        let mut slots = Slots::new(routine);
        for first in (0..elements).step_by(TAPE_BLOCK) {
            let block = elements.min(first + TAPE_BLOCK) - first;
            for (input, slot) in routine.inputs.iter().zip(slots.numbers_mut()) {
                inputs.fill(place(input), first / TAPE_BLOCK, slot);
            }
            slots.run(routine, block);
            let results = slots.results();
            for element in 0..block {
                let stored = &mut numbers[(first + element) * size..][..size];
                stored.iter_mut().enumerate().for_each(|(number, stored)| *stored = results.number(number)[element]);
                if slots.flags[0] >> element & 1 == 1 || !stored.iter().all(Number::is_representable) {
                    return Err((first + element, RestError { element: routines.name.clone().into() }));
                }
            }
        }
        Ok(if is_same { Self::Same(numbers) } else { Self::Each(numbers) })
    }
}
