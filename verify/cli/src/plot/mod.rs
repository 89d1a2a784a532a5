//! Plots as SVG.

mod linear;
mod logarithmic;

pub use linear::{Axes, Line, linear};
pub use logarithmic::{Curve, logarithmic};
