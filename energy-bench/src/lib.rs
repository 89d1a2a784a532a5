#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

pub mod agreement;
mod assembled;
pub mod coincident;
mod contender;
pub mod contenders;
mod dual;
pub mod formulas;
mod generated_c;
pub mod kernels;
pub mod measure;
pub mod near_rest;
mod random;
pub mod readme;
mod report;
mod run;
mod sample;
mod script;
mod served;
mod subject;
mod table;
mod uncompensated;
mod vector;
mod work;

pub use assembled::Assembled;
pub use contender::{CCompiler, Source};
pub use dual::Dual;
pub use random::Random;
pub use report::{KEYS, Options, Report, benchmark, write_inputs};
pub use sample::{Answer, Derivatives, Row, Sample};
pub use subject::{Subject, samples};
pub use table::table;
pub use uncompensated::Uncompensated;
pub use work::Work;
