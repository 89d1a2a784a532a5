//! The tests of the public interface, one module a subject. One program links once and shares all cores.
#![allow(confusable_idents, missing_docs, mixed_script_confusables)]

mod assembly;
mod contacts;
mod curvature;
mod dissipation;
mod domain;
mod elements;
mod export;
mod hinges;
mod least_squares;
mod memory;
mod mixed;
mod multigrid;
mod solvers;
mod tapes;
mod threads;
