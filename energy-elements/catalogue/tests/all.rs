//! The tests of the public interface, one module a subject. One program links once and shares all cores.
#![allow(missing_docs, mixed_script_confusables)]

mod laws;
mod operations;
