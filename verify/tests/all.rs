//! The tests of the public interface, one module a subject. One program links once and shares all cores.
#![allow(confusable_idents, missing_docs, mixed_script_confusables, uncommon_codepoints)]

mod accuracy;
mod bound_names;
mod broken_elements;
mod claims;
mod dual;
mod elementary_functions;
mod foreign_potentials;
mod functions;
mod near_singularities;
mod printed_mistakes;
mod random_programs;
mod random_unknowns;
mod sampling;
mod series_remainders;
mod singular_programs;
mod spectral_accuracy;
mod structure;
mod uncompensated;
mod unknowns;
mod user_formulas;
