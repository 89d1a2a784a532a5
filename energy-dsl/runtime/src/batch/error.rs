//! Errors of a call for many elements, and the flags that it returns.

use std::fmt;
use std::ops::Range;

use crate::numbers::{Flags, Mask};

/// Index among the packed elements and flags of each flagged element, in ascending order.
pub type Flagged = Vec<(usize, Flags<f64>)>;

/// The arguments of a call for many elements do not fit each other. Nothing was written.
#[derive(Clone, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum BatchError {
    /// A range that starts within a block or ends after the last element.
    Range {
        /// The range that was asked for.
        range: Range<usize>,
        /// Number of packed elements.
        elements: usize,
        /// Elements per block.
        block: usize,
    },
    /// Stencils of another size than the element.
    Stencil {
        /// Points of the element, or unknowns of the residual.
        needed: usize,
        /// Indices per stencil.
        given: usize,
    },
    /// A stencil names a point or an unknown that is not given.
    Missing {
        /// One more than the largest index.
        needed: usize,
        /// Number of points or unknowns.
        given: usize,
    },
    /// A slice of inputs of another length than the elements need.
    Input {
        /// Content of the slice.
        of: &'static str,
        /// Numbers that the elements need.
        needed: usize,
        /// Length of the slice.
        given: usize,
    },
    /// A slice of results of another length than the range needs.
    Output {
        /// The results that the slice receives.
        of: &'static str,
        /// Numbers that the range needs.
        needed: usize,
        /// Length of the slice.
        given: usize,
    },
}

impl fmt::Display for BatchError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Range { range, elements, block } => write!(
                f,
                "{range:?} of {elements} elements: a range starts at a multiple of {block} and ends at {elements} or \
                 before"
            ),
            Self::Stencil { needed, given } => {
                write!(
                    f,
                    "stencils of {given} indices for an element of {needed}: a stencil has as many as the element"
                )
            }
            Self::Missing { needed, given } => {
                write!(f, "point {needed} of {given}: a stencil names a point or unknown that is not given")
            }
            Self::Input { of, needed, given } => {
                write!(f, "{given} numbers for the {of}: expected {needed}")
            }
            Self::Output { of, needed, given } => {
                write!(f, "{given} places for {needed} numbers of the {of}: outputs belong to the range alone")
            }
        }
    }
}

impl std::error::Error for BatchError {}

/// Checks that a slice has room for `per_element` numbers per element, and no more.
pub(super) fn check_output(of: &'static str, given: usize, elements: usize, per: usize) -> Result<(), BatchError> {
    let needed = elements * per;
    if given == needed { Ok(()) } else { Err(BatchError::Output { of, needed, given }) }
}

/// Kept out of line: flags are rare.
#[cold]
#[inline(never)]
pub(super) fn note_flags<M: Mask>(flagged: &mut Flagged, first: usize, count: usize, degenerate: M, kink: M) {
    let flags = (0..count).map(|lane| Flags { degenerate: degenerate.lane(lane), kink: kink.lane(lane) });
    flagged.extend((first..).zip(flags).filter(|(_, flags)| flags.any()));
}
