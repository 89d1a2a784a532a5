//! The tests of the public interface, one module a subject. One program links once and shares all cores.
#![allow(missing_docs, mixed_script_confusables)]

mod arrays;
mod batch;
mod computed_as;
mod constants;
mod domain;
mod include;
mod kinds;
mod lanes;
mod limits;
mod matrices;
mod polar;
mod quadrature;
mod range;
mod recognition;
mod reference;
mod singular;
mod ui;
mod unknowns;
mod vertex;
mod weighted_sums;
