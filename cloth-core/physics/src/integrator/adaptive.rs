use energy_solve::EvaluationError;

use super::substep::Substep;
use super::{Integrator, IntegratorMemory, Rejection, StepError, StepReport};
use crate::body::Body;

/// Adaptive step sizes for another integrator. A failed step is rejected and retried at half its size. After
/// [`Adaptive::PATIENCE`] successes in a row the size doubles, up to the requested one.
///
/// The report counts the work of rejected steps, too.
///
/// A step fails if it cannot be completed with finite numbers: NaN, an inverted triangle under a material that forbids
/// it, a line search without success, too many iterations.
#[derive(Debug)]
pub struct Adaptive {
    inner: Box<dyn Integrator>,
    /// The next step is 2^−halvings of the requested one.
    halvings: u32,
    successes: u32,
    last_rejection: Option<Rejection>,
}

impl Adaptive {
    /// Successes in a row before the step size doubles.
    pub const PATIENCE: u32 = 4;
    /// Halvings before a step fails for good: about a millionth of the requested size.
    pub const MOST_HALVINGS: u32 = 20;

    /// Wraps an integrator.
    #[must_use]
    pub fn new(inner: Box<dyn Integrator>) -> Self {
        Self { inner, halvings: 0, successes: 0, last_rejection: None }
    }

    /// The last rejected step; `None` if no step was rejected.
    #[must_use]
    pub fn last_rejection(&self) -> Option<&Rejection> {
        self.last_rejection.as_ref()
    }

    /// The size of the next step over the requested one.
    #[must_use]
    pub fn part(&self) -> f64 {
        0.5_f64.powi(self.halvings as i32)
    }
}

impl Integrator for Adaptive {
    fn name(&self) -> &'static str {
        self.inner.name()
    }

    /// Advances by `dt` in one or more steps.
    fn step(&mut self, body: &mut Body, dt: f64) -> Result<StepReport, StepError> {
        let start = Substep::of(body);
        let mut report = StepReport::default();
        let mut first = None;
        // Time in units of the smallest step, so that parts add up exactly.
        let (mut done, whole) = (0_u64, 1_u64 << Self::MOST_HALVINGS);
        while done < whole {
            let mut part = whole >> self.halvings;
            // Steps end on multiples of their size, so that a doubled step still fits.
            while done % part != 0 {
                part /= 2;
            }
            let size = dt * part as f64 / whole as f64;
            match self.inner.step(body, size) {
                Ok(one) => {
                    report += one;
                    done += part;
                    self.successes = self.successes.saturating_add(1);
                    if self.successes >= Self::PATIENCE && self.halvings > 0 {
                        (self.halvings, self.successes) = (self.halvings - 1, 0);
                    }
                }
                Err(reason) => {
                    report += self.inner.take_failed_work();
                    let rejection = Rejection { dt: size, reason: reason.clone() };
                    let first = first.get_or_insert_with(|| rejection.clone());
                    self.last_rejection = Some(rejection);
                    report.rejected += 1;
                    self.successes = 0;
                    self.halvings = (whole / part).ilog2() + 1;
                    if self.halvings > Self::MOST_HALVINGS {
                        (body.x, body.v) = (start.x, start.v);
                        self.halvings = 0;
                        let (first, reason) = (Box::new(first.clone()), Box::new(reason));
                        return Err(StepError::Hopeless { dt: size, first, reason });
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
        let [halvings, successes] = memory.adaptive;
        // A damaged checkpoint may have any number.
        (self.halvings, self.successes) = (halvings.min(Self::MOST_HALVINGS), successes);
        self.inner.restore(memory);
    }

    /// `None`: unstable steps are rejected.
    fn stable_step(&self, _: &mut Body) -> Result<Option<f64>, EvaluationError> {
        Ok(None)
    }
}

#[cfg(test)]
mod tests {
    use energy_solve::System;

    use super::*;

    /// An integrator whose steps all fail, for a reason that depends on their size.
    #[derive(Debug)]
    struct Failing;

    impl Integrator for Failing {
        fn name(&self) -> &'static str {
            "failing"
        }

        fn step(&mut self, _: &mut Body, dt: f64) -> Result<StepReport, StepError> {
            Err(match dt {
                1.0 => StepError::PinsBlocked { moves: 1, part: 0.5, pressed: None },
                _ => StepError::NotConverged { iterations: 100, change: 1.0, pressed: None },
            })
        }

        fn stable_step(&self, _: &mut Body) -> Result<Option<f64>, EvaluationError> {
            Ok(None)
        }
    }

    #[test]
    fn a_step_that_fails_at_every_size_keeps_its_first_reason() {
        let system = System::new(Vec::new(), &[]).unwrap();
        let mut body = Body { x: Vec::new(), v: Vec::new(), masses: Vec::new(), system };
        let error = Adaptive::new(Box::new(Failing)).step(&mut body, 1.0).unwrap_err();
        let StepError::Hopeless { dt, first, reason } = error else { panic!("{error}") };
        assert!(dt < 1e-6 && first.dt == 1.0 && matches!(first.reason, StepError::PinsBlocked { .. }), "{first:?}");
        assert!(matches!(*reason, StepError::NotConverged { .. }), "{reason}");
    }
}
