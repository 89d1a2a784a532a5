//! The inputs of an element, and the numbers that a caller binds to them.

use std::fmt;
use std::sync::Arc;

use super::Interpreted;
use super::elements::Elements;
use crate::check::{Input, Program};
use energy_runtime::tape::{Column, TapeElements};
use energy_runtime::{Float, Kind, RestError};

/// The kind of an input.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum InputKind {
    /// A point: three coordinates that derivatives are taken by.
    Point,
    /// Any other unknown, and all of those of a residual: derivatives are taken by its numbers, or by the three
    /// increments of a rotation.
    Unknown,
    /// Part of the rest shape, read once when an element is made.
    Rest,
    /// A parameter of the declaration.
    Parameter,
}

/// An input with its shape.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct InputNumbers {
    /// Name, as declared.
    pub name: String,
    /// Kind of the input.
    pub kind: InputKind,
    /// Length of each dimension, the outermost first; empty for a scalar.
    pub shape: Vec<usize>,
    /// Unit, as declared; empty if none was given.
    pub unit: String,
}

impl InputNumbers {
    /// Returns the number of scalars.
    #[must_use]
    pub fn size(&self) -> usize {
        self.shape.iter().product()
    }

    pub(super) fn of(program: &Program) -> Vec<Self> {
        let is_flat = program.kind == Kind::Residual || program.is_mixed();
        let moving = if is_flat { InputKind::Unknown } else { InputKind::Point };
        let list = |kind: InputKind, inputs: &[Input]| {
            let one = |input: &Input| Self {
                name: input.name.clone(),
                kind,
                shape: input.input_type.dimensions(),
                unit: input.unit.clone(),
            };
            inputs.iter().map(one).collect::<Vec<_>>()
        };
        let (rest, parameters) =
            (list(InputKind::Rest, &program.rest), list(InputKind::Parameter, &program.parameters));
        [list(moving, &program.moving), rest, parameters].concat()
    }
}

/// Numbers that cannot be bound to elements.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum BindError {
    /// More or fewer columns than inputs.
    Columns {
        /// Index of the element, from 0.
        element: String,
        /// Whether the columns are those of the rest shape; else of parameters.
        rest: bool,
        /// Names of the inputs that need a column.
        needed: Vec<String>,
        /// Number of columns.
        given: usize,
    },
    /// A column of another length than its input needs.
    Length {
        /// Index of the element, from 0.
        element: String,
        /// Name of the input.
        input: String,
        /// Numbers that all elements need.
        needed: usize,
        /// Length of the column.
        given: usize,
    },
    /// A degenerate rest shape.
    Rest {
        /// Index of the first element that has one.
        index: usize,
        /// The error of its rest shape.
        error: RestError,
    },
}

impl fmt::Display for BindError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Columns { element, rest, needed, given } => {
                let what = if *rest { "the rest shape" } else { "the parameters" };
                let needed = if needed.is_empty() { "none".to_owned() } else { needed.join(", ") };
                write!(f, "{element}: {given} columns for {what}; expected one for each input: {needed}")
            }
            Self::Length { element, input, needed, given } => {
                write!(f, "{element}: {given} numbers for `{input}`; expected {needed}")
            }
            Self::Rest { index, error } => write!(f, "element {index}: {error}"),
        }
    }
}

impl std::error::Error for BindError {}

impl Interpreted {
    /// Binds `count` elements to their rest shapes and parameters, one column per input in declared order. A column
    /// holds the numbers of one element, which all share, or those of each element, one after the other. Rest shapes
    /// are evaluated here, once.
    ///
    /// # Errors
    /// When columns are missing or have another length, or a rest shape is degenerate.
    pub fn elements<S: Float>(
        &self,
        count: usize,
        rest: &[Column<'_, S>],
        parameters: &[Column<'_, S>],
    ) -> Result<Elements<S>, BindError> {
        let rest = self.columns(InputKind::Rest, 0, count, rest)?;
        let parameters = self.columns(InputKind::Parameter, 0, count, parameters)?;
        let elements = TapeElements::new(Arc::clone(&self.routines), count, &rest, &parameters)
            .map_err(|(index, error)| BindError::Rest { index, error })?;
        Ok(Elements::new(self.clone(), elements))
    }

    /// Returns the states at rest of `count` elements, one element after the other, from columns as
    /// [`Interpreted::elements`] takes them, but for the state. `None` if the declaration has no values at rest.
    ///
    /// # Errors
    /// When columns are missing or have another length, or a state has no value.
    pub fn states_at_rest<S: Float>(
        &self,
        count: usize,
        rest: &[Column<'_, S>],
        parameters: &[Column<'_, S>],
    ) -> Result<Option<Vec<S>>, BindError> {
        let rest = self.columns(InputKind::Rest, 0, count, rest)?;
        let states = self.plan.declaration.state.len();
        let parameters = self.columns(InputKind::Parameter, states, count, parameters)?;
        TapeElements::states_at_rest(&self.routines, count, &rest, &parameters)
            .map_err(|(index, error)| BindError::Rest { index, error })
    }

    /// Returns the columns with the sizes of their inputs, but for the last ones.
    fn columns<'a, S: Float>(
        &self,
        kind: InputKind,
        without: usize,
        count: usize,
        given: &[Column<'a, S>],
    ) -> Result<Vec<(Column<'a, S>, usize)>, BindError> {
        let element = || self.plan.declaration.name.to_string();
        let mut inputs: Vec<&InputNumbers> = self.inputs.iter().filter(|input| input.kind == kind).collect();
        inputs.truncate(inputs.len() - without);
        if inputs.len() != given.len() {
            let needed = inputs.iter().map(|input| input.name.clone()).collect();
            return Err(BindError::Columns {
                element: element(),
                rest: kind == InputKind::Rest,
                needed,
                given: given.len(),
            });
        }
        let sized = |(input, &column): (&&InputNumbers, &Column<'a, S>)| {
            let (needed, given) = match column {
                Column::Same(numbers) => (input.size(), numbers.len()),
                Column::Each(numbers) => (count * input.size(), numbers.len()),
            };
            if needed == given {
                Ok((column, input.size()))
            } else {
                Err(BindError::Length { element: element(), input: input.name.clone(), needed, given })
            }
        };
        inputs.iter().zip(given).map(sized).collect()
    }
}
