//! Numbers that generated code runs on: floating-point numbers, SIMD lanes of them, and numbers with an extended
//! exponent.

mod block_sum;
mod bundle;
mod coefficients;
mod comparisons;
mod cpu;
mod elementary;
mod flags;
mod float;
mod lane;
mod level;
mod limits;
mod narrow;
mod outcomes;
mod ray;
mod real;
mod recording;
mod rows;
mod series;
mod trace;
mod unbounded;

pub use block_sum::{BLOCK_NUMBERS, BlockSum};
pub(crate) use cpu::{Fused, prefetch_rows, read_alone};
pub use cpu::{LevelName, UnknownLevel, available, dispatch, dispatch_at, level};
pub use flags::{Flag, Flags};
pub use float::Float;
pub use lane::Lane;
pub use level::{Baseline, Kernel, Level};
pub(crate) use limits::{Care, Roles, fill_outside, settle};
pub use ray::Ray;
pub use real::{Mask, Number, Real};
pub use trace::{MASKS, Trace, TraceStep, elementary_functions};
pub use unbounded::{Settle, Settled, Unbounded};
