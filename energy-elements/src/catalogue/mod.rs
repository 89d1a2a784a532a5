//! All elements of this crate behind function pointers, for tools that take an element by name.
//!
//! It is behind the feature `catalogue` because this table compiles every routine of every element. A simulator uses
//! some of the elements and compiles those.

mod batches;
#[cfg(feature = "batches")]
mod kernels;
#[cfg(feature = "batches")]
mod matrices;

use energy_dsl::AnyElement;

pub use batches::{CompiledBatch, Scalar, bind};

macro_rules! entries {
    ($($name:ident),* $(,)?) => { &[$(AnyElement::of::<crate::$name<f64>>()),*] };
}

/// Returns all elements of the library, in alphabetical order.
// `#[inline(never)]`: a crate that inlines this function compiles every element again.
#[inline(never)]
#[must_use]
pub fn elements() -> &'static [AnyElement] {
    const ELEMENTS: &[AnyElement] = crate::for_each_element!(entries);
    ELEMENTS
}

/// Returns the element of this name; `None` if the library has no such element.
///
/// ```
/// let spring = energy_elements::catalogue::find("Spring").unwrap();
/// assert!(spring.declaration.translation_invariant);
/// ```
#[must_use]
pub fn find(name: &str) -> Option<&'static AnyElement> {
    elements().iter().find(|entry| entry.declaration.name == name)
}
