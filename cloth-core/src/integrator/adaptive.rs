use energy_solve::EvaluationError;

use super::substep::Substep;
use super::{Integrator, IntegratorMemory, StepError, StepReport};
use crate::body::Body;

/// Another scheme with a step of its own choice: a step that fails is rejected and tried again at half its size; after
/// [`Adaptive::PATIENCE`] successes in a row the size doubles, up to that asked for. A step fails when it cannot be completed with
/// finite numbers: NaN, a triangle turned over under a material that forbids it, a line search that is stuck, too many
/// iterations.
#[derive(Debug)]
pub struct Adaptive {
    inner: Box<dyn Integrator>,
    /// The size of the next step over that asked for, a power of ½.
    halvings: u32,
    successes: u32,
    last_rejection: Option<Rejection>,
}

/// A step that was rejected.
#[derive(Clone, Debug, PartialEq)]
pub struct Rejection {
    /// Its size, in s.
    pub dt: f64,
    /// Why.
    pub reason: StepError,
}

impl Adaptive {
    /// Successes before the step grows.
    pub const PATIENCE: u32 = 4;
    /// Halvings after which a step counts as hopeless: a millionth of that asked for.
    pub const MOST_HALVINGS: u32 = 20;

    /// Steps of `inner`.
    #[must_use]
    pub fn new(inner: Box<dyn Integrator>) -> Self {
        Self { inner, halvings: 0, successes: 0, last_rejection: None }
    }

    /// The last step that was rejected, and why.
    #[must_use]
    pub fn last_rejection(&self) -> Option<&Rejection> {
        self.last_rejection.as_ref()
    }

    /// The part of a whole step that is tried next.
    #[must_use]
    pub fn part(&self) -> f64 {
        0.5_f64.powi(self.halvings as i32)
    }
}

impl Integrator for Adaptive {
    fn name(&self) -> &'static str {
        self.inner.name()
    }

    /// Advances by `dt`, in as many steps as it takes.
    fn step(&mut self, body: &mut Body, dt: f64) -> Result<StepReport, StepError> {
        let start = Substep::of(body);
        let mut report = StepReport::default();
        // The time done, in units of the smallest step, so that parts add up exactly.
        let (mut done, whole) = (0_u64, 1_u64 << Self::MOST_HALVINGS);
        while done < whole {
            let mut part = whole >> self.halvings;
            // A longer step fits only where it ends on a multiple of itself.
            while done % part != 0 {
                part /= 2;
            }
            let size = dt * part as f64 / whole as f64;
            match self.inner.step(body, size) {
                Ok(one) => {
                    report += one;
                    done += part;
                    self.successes += 1;
                    if self.successes >= Self::PATIENCE && self.halvings > 0 {
                        (self.halvings, self.successes) = (self.halvings - 1, 0);
                    }
                }
                Err(reason) => {
                    self.last_rejection = Some(Rejection { dt: size, reason: reason.clone() });
                    report.rejected += 1;
                    self.successes = 0;
                    self.halvings = (whole / part).ilog2() + 1;
                    if self.halvings > Self::MOST_HALVINGS {
                        (body.x, body.v) = (start.x, start.v);
                        self.halvings = 0;
                        return Err(StepError::Hopeless { dt: size, reason: Box::new(reason) });
                    }
                }
            }
        }
        Ok(report)
    }

    fn memory(&self) -> IntegratorMemory {
        IntegratorMemory { adaptive: [self.halvings, self.successes], ..self.inner.memory() }
    }

    fn restore(&mut self, memory: IntegratorMemory) {
        [self.halvings, self.successes] = memory.adaptive;
        self.inner.restore(memory);
    }

    /// None: it finds its own.
    fn stable_step(&self, _: &mut Body) -> Result<Option<f64>, EvaluationError> {
        Ok(None)
    }
}
