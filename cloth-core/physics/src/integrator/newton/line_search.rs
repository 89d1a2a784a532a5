use energy_dsl::Vector3;
use energy_solve::{BlockMatrix, Curvature, EvaluationError};

use super::super::if_finite;
use super::incremental_potential::{Energy, IncrementalPotential};
use super::iterate::Direction;

/// Halvings of a step before it counts as stuck: the last step is 2⁻⁴⁰ of the first.
const HALVINGS: usize = 40;
/// The longest step, in units of the search direction.
const LONGEST: f64 = 1024.0;
/// The fraction of the decrease predicted by the slope that a step must achieve (Armijo).
const DECREASE: f64 = 1e-4;
/// Tolerance for the rounding error of a difference of energies, relative to their magnitude.
const ROUNDING: f64 = 1e-13;

/// Quantities to evaluate at the full step, before it is known to be accepted. The energy is nearly free with them.
pub(super) enum Prefetch<'a> {
    Nothing,
    /// −∇E, to test for convergence.
    Gradient,
    /// −∇E and the Hessian of the next iteration.
    Matrix(&'a mut BlockMatrix<f32>),
}

/// The step that a line search accepted.
pub(super) struct AcceptedStep {
    /// Length of the step, in units of the search direction.
    pub scale: f64,
    /// The length of the first step that was tried: 1, or less if contact allows no more.
    pub allowed: f64,
    /// E after the step.
    pub energy: Energy,
    /// −∇E after the step, if it was prefetched without the Hessian.
    pub gradient: Option<Vec<Vector3<f64>>>,
    /// −∇E after the step, if it was prefetched with the Hessian.
    pub linearised: Option<Vec<Vector3<f64>>>,
}

impl IncrementalPotential<'_> {
    /// Returns the first of x + s d, x + s d/2, … that decreases E sufficiently (Armijo); `None` if none does. s is 1,
    /// or less if contact allows no more. Directions of projected Hessians are too short, if anything: a full step
    /// along one is doubled while that lowers E.
    pub(super) fn line_search(
        &mut self,
        x: &[Vector3<f64>],
        energy: Energy,
        direction: &Direction,
        mut prefetch: Prefetch<'_>,
    ) -> Result<Option<AcceptedStep>, EvaluationError> {
        let end = self.moved(x, 1.0, &direction.vectors);
        let allowed = self.filter_step(x, &end);
        let (mut scale, mut end) = (allowed, Some(end));
        if allowed == 0.0 {
            return Ok(None);
        }
        for _ in 0..=HALVINGS {
            let end = end.take().filter(|_| scale == 1.0);
            let moved = end.unwrap_or_else(|| self.moved(x, scale, &direction.vectors));
            let (mut gradient, mut linearised) = (None, None);
            match std::mem::replace(&mut prefetch, Prefetch::Nothing) {
                Prefetch::Nothing => {}
                Prefetch::Gradient => gradient = if_finite(self.gradient(&moved))?,
                Prefetch::Matrix(matrix) => linearised = if_finite(self.linearise(&moved, Curvature::Exact, matrix))?,
            }
            let trial = self.energy(&moved)?;
            let rounding = ROUNDING * energy.magnitude.min(trial.magnitude);
            if trial.value <= energy.value + DECREASE * scale * direction.slope + rounding {
                drop(moved);
                let accepted = AcceptedStep { scale, allowed, energy: trial, gradient, linearised };
                let may_be_short = direction.is_projected && scale == 1.0;
                return Ok(Some(if may_be_short { self.lengthen(x, accepted, direction)? } else { accepted }));
            }
            scale *= 0.5;
            self.report.halvings += 1;
        }
        Ok(None)
    }

    /// Doubles a step as long as that lowers E.
    fn lengthen(
        &mut self,
        x: &[Vector3<f64>],
        mut accepted: AcceptedStep,
        direction: &Direction,
    ) -> Result<AcceptedStep, EvaluationError> {
        while accepted.scale < LONGEST {
            let scale = 2.0 * accepted.scale;
            let moved = self.moved(x, scale, &direction.vectors);
            // A certificate costs more than an energy.
            let without_contact = self.energy_without_contact(&moved)?;
            if without_contact.value >= accepted.energy.value || self.filter_step(x, &moved) < 1.0 {
                break;
            }
            let energy = self.with_contact(without_contact, &moved);
            if energy.value >= accepted.energy.value {
                break;
            }
            accepted = AcceptedStep { scale, energy, gradient: None, linearised: None, ..accepted };
        }
        Ok(accepted)
    }
}

#[cfg(test)]
mod tests {
    use energy_solve::{SolveReport, System};

    use super::super::forcing::Forcing;
    use super::*;
    use crate::body::Body;

    /// Searches along a step to 2 − `shortfall` times the distance of the minimum of E = ½ m ‖x − x̂‖², on which E
    /// falls by about half the shortfall times what the slope promises. Returns the accepted scale.
    fn accepted(shortfall: f64) -> f64 {
        let system = System::new(Vec::new(), &[false]).unwrap();
        let mut body = Body { x: vec![[0.0; 3]], v: vec![[2.0, -1.0, 0.5]], masses: vec![3.0], system };
        let mut potential = IncrementalPotential::new(&mut body, None, 0.1);
        let x = vec![[0.0; 3]];
        let away = potential.inertial(0);
        let energy = potential.energy(&x).unwrap();
        let vectors = vec![away.map(|component| (2.0 - shortfall) * component)];
        let downhill = [away.map(|component| 3.0 * component)];
        let forcing = Forcing { gradient: 1.0, tolerance: 0.1, is_first: true };
        let direction = Direction::new(&downhill, vectors, Curvature::Exact, forcing, SolveReport::indefinite());
        let step = potential.line_search(&x, energy, &direction, Prefetch::Nothing).unwrap().unwrap();
        assert!(step.energy.value < energy.value);
        step.scale
    }

    #[test]
    fn a_step_must_lower_the_energy_by_a_part_of_what_the_slope_promises() {
        assert_eq!(accepted(2.2 * DECREASE), 1.0);
        assert_eq!(accepted(1.8 * DECREASE), 0.5);
        assert_eq!(accepted(1.0), 1.0);
    }
}
