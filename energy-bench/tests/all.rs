//! The tests of the public interface, one module a subject. One program links once and shares all cores.

mod agreement;
mod formulas;
mod json;
mod readme;
