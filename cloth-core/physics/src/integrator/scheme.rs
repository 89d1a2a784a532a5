use schemars::JsonSchema;
use serde::Deserialize;

use super::{
    Bdf2, ExplicitEuler, ImplicitEuler, ImplicitMidpoint, Integrator, LinearSolverChoice, Newton, NewtonOptions,
    SymplecticEuler, Trapezoid, Verlet,
};
use crate::bounded::{Fraction, MaybeCount, MaybeReal, Positive};

/// The built-in integrators.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Scheme {
    /// Linearised implicit Euler, one linear solve per step (default).
    #[default]
    ImplicitEuler,
    /// Implicit Euler by Newton's method with line search.
    Newton,
    /// The two-step backward differentiation formula, implicit.
    Bdf2,
    /// The implicit midpoint rule.
    ImplicitMidpoint,
    /// The trapezoidal rule, implicit: Newmark's average acceleration.
    Trapezoid,
    /// Symplectic Euler, explicit.
    SymplecticEuler,
    /// Velocity Verlet, explicit.
    Verlet,
    /// Explicit Euler.
    ExplicitEuler,
    /// Explicit Euler as printed in the paper of the mass–spring cloth model, without the step size in x' = x + v.
    ExplicitEulerAsPrinted,
}

impl Scheme {
    /// All schemes, in the order of the documentation.
    pub const ALL: [Self; 9] = [
        Self::ImplicitEuler,
        Self::Newton,
        Self::Bdf2,
        Self::ImplicitMidpoint,
        Self::Trapezoid,
        Self::SymplecticEuler,
        Self::Verlet,
        Self::ExplicitEuler,
        Self::ExplicitEulerAsPrinted,
    ];

    /// Creates the integrator with default options.
    #[must_use]
    pub fn integrator(self) -> Box<dyn Integrator> {
        self.with_options(Tolerances::default(), LinearSolverChoice::Auto)
    }

    /// Creates the integrator with these tolerances and this linear solver, if it uses them.
    #[must_use]
    pub fn with_options(self, tolerances: Tolerances, linear_solver: LinearSolverChoice) -> Box<dyn Integrator> {
        let applied = |default: NewtonOptions| NewtonOptions { linear_solver, ..tolerances.applied(default) };
        let (first, second) = (applied(NewtonOptions::default()), applied(second_order_tolerances()));
        match self {
            Self::ImplicitEuler => Box::new(ImplicitEuler::solved_by(linear_solver)),
            Self::Newton => Box::new(Newton::with_options(first)),
            Self::Bdf2 => Box::new(Bdf2::with_options(second)),
            Self::ImplicitMidpoint => Box::new(ImplicitMidpoint::with_options(second)),
            Self::Trapezoid => Box::new(Trapezoid::with_options(second)),
            Self::SymplecticEuler => Box::new(SymplecticEuler),
            Self::Verlet => Box::new(Verlet::default()),
            Self::ExplicitEuler => Box::new(ExplicitEuler::default()),
            Self::ExplicitEulerAsPrinted => Box::new(ExplicitEuler::as_printed()),
        }
    }
}

/// Convergence criteria of Newton's method. Keys that are not given keep the integrator's default.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
#[non_exhaustive]
pub struct Tolerances {
    /// A step converges once an iteration changes no velocity by more than this, in m/s. Default 1e-4 for `newton`,
    /// 1e-7 for schemes of second order.
    #[serde(with = "MaybeReal::<Positive>")]
    pub velocity: Option<f64>,
    /// Residual of each linear system relative to its right-hand side. Default 0.01 for `newton`, 1e-3 for schemes of
    /// second order.
    #[serde(with = "MaybeReal::<Fraction>")]
    pub linear: Option<f64>,
    /// The largest number of iterations; a step that needs more fails. Default 100.
    #[serde(with = "MaybeCount::<1, 1_000_000>")]
    pub iterations: Option<usize>,
}

impl Tolerances {
    /// Returns tolerances with `factor` times the velocity at which a step of this scheme converges, and ten times the
    /// iterations.
    #[must_use]
    pub fn tightened(self, scheme: Scheme, factor: f64) -> Self {
        let first_order = matches!(scheme, Scheme::Newton);
        let default = if first_order { NewtonOptions::default() } else { second_order_tolerances() };
        let NewtonOptions { velocity_tolerance, iteration_limit, .. } = self.applied(default);
        Self { velocity: Some(factor * velocity_tolerance), iterations: Some(10 * iteration_limit), ..self }
    }

    fn applied(self, default: NewtonOptions) -> NewtonOptions {
        NewtonOptions {
            velocity_tolerance: self.velocity.unwrap_or(default.velocity_tolerance),
            linear_tolerance: self.linear.unwrap_or(default.linear_tolerance),
            iteration_limit: self.iterations.unwrap_or(default.iteration_limit),
            ..default
        }
    }
}

/// Tolerances for schemes of second order: 10⁻⁷ m/s keeps the solver's error below the scheme's.
pub(super) fn second_order_tolerances() -> NewtonOptions {
    NewtonOptions { velocity_tolerance: 1e-7, linear_tolerance: 1e-3, ..NewtonOptions::default() }
}
