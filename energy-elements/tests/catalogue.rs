//! All elements of the library behind function pointers, by name.

use energy_dsl::AnyElement;

macro_rules! entries {
    ($($name:ident),* $(,)?) => { &[$(AnyElement::of::<energy_elements::$name<f64>>()),*] };
}

pub static ELEMENTS: &[AnyElement] = energy_elements::for_each_element!(entries);

pub fn find(name: &str) -> Option<&'static AnyElement> {
    ELEMENTS.iter().find(|entry| entry.declaration.name == name)
}
