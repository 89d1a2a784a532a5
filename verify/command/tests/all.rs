//! The tests of the public interface, one module a subject. One program links once and shares all cores.
#![allow(missing_docs)]

mod bench;
mod c;
mod c_mixed;
mod command_line;
mod cover;
mod cuda_on_host;
mod elements;
mod embedded;
mod errata;
mod fusion_reference;
mod multiprecision;
mod ptx;
mod tape;
mod tracked_skirt;
mod warp;
