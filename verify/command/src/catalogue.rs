//! All elements of the library behind function pointers, by name.

use energy_dsl::AnyElement;

macro_rules! entries {
    ($($name:ident),* $(,)?) => { &[$(AnyElement::of::<energy_elements::$name<f64>>()),*] };
}

/// Returns all elements of points, and all residuals, of the library, in alphabetical order.
// `#[inline(never)]`: a crate that inlines this function compiles every element again.
#[inline(never)]
#[must_use]
pub fn elements() -> &'static [AnyElement] {
    const ELEMENTS: &[AnyElement] = energy_elements::for_each_element!(entries);
    ELEMENTS
}

/// Returns all elements of the library whose unknowns are not only points of their own, or which have a state.
#[inline(never)]
#[must_use]
pub fn mixed() -> &'static [AnyElement] {
    const MIXED: &[AnyElement] = energy_elements::for_each_mixed_element!(entries);
    MIXED
}

/// Returns all elements of the library.
#[must_use]
pub fn all() -> Vec<AnyElement> {
    elements().iter().chain(mixed()).copied().collect()
}

/// Returns the element of this name; `None` if the library has no such element.
///
/// ```
/// let spring = verify_command::catalogue::find("Spring").unwrap();
/// assert!(spring.declaration.translation_invariant);
/// ```
#[must_use]
pub fn find(name: &str) -> Option<&'static AnyElement> {
    elements().iter().chain(mixed()).find(|entry| entry.declaration.name == name)
}
