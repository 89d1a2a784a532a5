#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

pub mod accuracy;
mod assembled;
pub mod check;
pub mod contenders;
mod dual;
mod inputs;
pub mod kernels;
pub mod measure;
mod random;
mod run;
mod script;
mod subject;
mod table;
mod uncompensated;
mod vector;

pub use assembled::Assembled;
pub use dual::Dual;
pub use inputs::write_inputs;
pub use random::Random;
pub use run::Work;
pub use script::run_script;
pub use subject::{Answer, Derivatives, Row, Sample, Subject, samples};
pub use table::table;
pub use uncompensated::Uncompensated;
