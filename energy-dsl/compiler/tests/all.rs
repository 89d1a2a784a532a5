//! The tests of the public interface, one module a subject. One program links once and shares all cores.
#![allow(missing_docs)]

mod differences;
mod golden;
mod growth;
mod language;
mod names;
mod random;
mod range;
mod rest_parts;
mod run_time;
mod short_hessians;
mod singular_values;
mod token_soup;
