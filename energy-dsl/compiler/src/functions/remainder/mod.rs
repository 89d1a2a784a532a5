//! Remainders of Taylor series over powers, such as (eˣ − 1 − x)/x². Written out they cancel near 0, and so do their
//! derivatives. All of them are one of
//!
//! ```text
//! exponential    φₖ(x) = Σ xʲ/(j + k)!            (eˣ − 1)/x = φ₁        (eˣ − 1 − x)/x² = φ₂
//! logarithm      Lₖ(x) = Σ (−x)ʲ/(j + k)          ln(1 + x)/x = L₁       (x − ln(1 + x))/x² = L₂
//! trigonometric  cₖ(x) = Σ (−x²)ʲ/(2j + k)!       sin x/x = c₁, (1 − cos x)/x² = c₂, (x − sin x)/x³ = c₃
//! incomplete Γ   γₖ(x) = e⁻ˣ φₖ(x)                (1 − e⁻ˣ (1 + x))/x² = γ₂
//! ```
//!
//! which are regular at 0. cₖ are Stumpff's functions. xᵏ γₖ(x) damps dispersion forces between atoms (Tang and
//! Toennies 1984).

mod incomplete_gamma;
mod monomial;
mod recognise;
mod series;

pub(super) use incomplete_gamma::{recognise_damped_difference, recognise_damped_sum};
pub(super) use recognise::{recognise_difference, recognise_quotient, recognise_sum};
