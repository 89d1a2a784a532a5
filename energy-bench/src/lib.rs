#![doc = include_str!("../README.md")]
#![forbid(unsafe_code)]

pub mod accuracy;
mod assembled;
pub mod check;
mod contender;
pub mod contenders;
mod dual;
mod inputs;
pub mod kernels;
pub mod measure;
mod random;
mod run;
mod sample;
mod script;
mod subject;
mod table;
mod uncompensated;
mod vector;
mod work;

pub use assembled::Assembled;
pub use dual::Dual;
pub use inputs::write_inputs;
pub use random::Random;
pub use sample::{Answer, Derivatives, Row, Sample};
pub use script::run_script;
pub use subject::{Subject, samples};
pub use table::table;
pub use uncompensated::Uncompensated;
pub use work::Work;
