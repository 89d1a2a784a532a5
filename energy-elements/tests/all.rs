//! The tests of the public interface, one module a subject. One program links once and shares all cores.
#![allow(confusable_idents, missing_docs, mixed_script_confusables, uncommon_codepoints)]

mod budgets;
mod catalogue;
mod ipctk;
mod lanes;
mod laws;
mod operations;
mod rigid_motions;
mod yarns;
