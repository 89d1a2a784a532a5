//! Comparisons of numbers along rays.
//!
//! The outcome of a comparison may differ on a narrow cone of rays that no ray meets. So each one leaves a record, by
//! which [`narrow`](super::narrow) looks for such cones.

use std::cell::RefCell;

use super::bundle::Bundle;
use super::outcomes::{LANES, Outcomes};
use super::real::Mask;
use super::series::Term;

/// A comparison of two numbers along a ray: the largest term of their difference; `None` if that is 0 or undefined, or
/// if nothing asked for it.
pub(super) type Comparison = Option<Term>;

/// The comparison of a bundle of rays.
type Compared = [Comparison; LANES];

thread_local! {
    /// The comparisons of the bundle that this thread is computing, in the order of the routine.
    static MADE: RefCell<Vec<Compared>> = const { RefCell::new(Vec::new()) };
    /// Comparisons whose outcomes are reversed, and along which rays.
    static REVERSED: RefCell<Vec<(u32, Outcomes)>> = const { RefCell::new(Vec::new()) };
}

/// Registers a comparison, which may be made later. Returns its number.
pub(super) fn register() -> u32 {
    MADE.with_borrow_mut(|all| {
        all.push([None; LANES]);
        u32::try_from(all.len() - 1).expect("a routine has fewer than 2³² comparisons")
    })
}

/// Compares a difference with 0. Returns the rays along which it is negative, and those along which it is 0. The
/// outcome may be reversed.
pub(super) fn compare(comparison: u32, difference: &Bundle) -> [Outcomes; 2] {
    let terms = difference.first();
    MADE.with_borrow_mut(|all| all[comparison as usize] = terms);
    let reversed = REVERSED.with_borrow(|all| {
        let of_this = all.iter().filter(|(reversed, _)| *reversed == comparison);
        of_this.fold(Outcomes::none(), |rays, (_, ray)| rays | *ray)
    });
    let is_negative = |ray: usize| terms[ray].is_some_and(|term| term.is_negative() != reversed.lane(ray));
    [Outcomes::of(is_negative), Outcomes::of(|ray| terms[ray].is_none())]
}

/// Returns the comparisons that were made along each of the first rays, and forgets them.
pub(super) fn take(rays: usize) -> Vec<Vec<Comparison>> {
    let made = MADE.take();
    (0..rays).map(|ray| made.iter().map(|terms| terms[ray]).collect()).collect()
}

/// Evaluates with the outcomes of some comparisons reversed along some rays.
pub(super) fn reversed<R>(comparisons: Vec<(u32, Outcomes)>, evaluate: impl FnOnce() -> R) -> R {
    REVERSED.set(comparisons);
    let result = evaluate();
    REVERSED.take();
    result
}
