//! The tests of the public interface, one module a subject. What needs the kernels of fabrics is here: in a unit test, they
//! would be compiled once more, which takes five minutes.
#![allow(missing_docs)]

mod nodal_membrane;
mod plate;
mod schemes;
