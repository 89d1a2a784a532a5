//! All elements of the library behind function pointers, by name.

use energy_dsl::AnyElement;

macro_rules! entries {
    ($($name:ident),* $(,)?) => { &[$(AnyElement::of::<energy_elements::$name<f64>>()),*] };
}

/// Returns all elements of the library, in alphabetical order.
// `#[inline(never)]`: a crate that inlines this function compiles every element again.
#[inline(never)]
#[must_use]
pub fn elements() -> &'static [AnyElement] {
    const ELEMENTS: &[AnyElement] = energy_elements::for_each_element!(entries);
    ELEMENTS
}

/// Returns the element of this name; `None` if the library has no such element.
///
/// ```
/// let spring = verify_command::catalogue::find("Spring").unwrap();
/// assert!(spring.declaration.translation_invariant);
/// ```
#[must_use]
pub fn find(name: &str) -> Option<&'static AnyElement> {
    elements().iter().find(|entry| entry.declaration.name == name)
}
