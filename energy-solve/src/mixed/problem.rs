//! The function that Newton's method minimises.

use super::error::MixedError;
use super::inertia::InertialPotential;
use super::newton::MixedNewtonError;
use super::system::{MixedEnergy, MixedSystem};
use crate::linear::bordered::concave;
use crate::matrix::BorderedMatrix;
use crate::terms::Curvature;

/// Steps of the search for the maximum over the shared unknowns that are maximised.
const MOST_STEPS: usize = 60;

/// A system's potential, with the inertial potential of a time step if there is one.
pub(super) struct Problem<'a> {
    pub(super) system: &'a mut MixedSystem,
    pub(super) inertial: Option<&'a InertialPotential>,
}

impl Problem<'_> {
    pub(super) fn energy(&mut self, u: &[f64]) -> Result<MixedEnergy, MixedError> {
        let mut energy = self.system.energy(u)?;
        if let Some(inertial) = self.inertial {
            energy += inertial.energy(self.system.body(), u);
        }
        Ok(energy)
    }

    /// Assembles the Hessian. Returns energy and gradient.
    pub(super) fn linearise(
        &mut self,
        u: &[f64],
        curvature: Curvature,
        matrix: &mut BorderedMatrix,
    ) -> Result<(MixedEnergy, Vec<f64>), MixedError> {
        let (mut energy, mut gradient) = self.system.linearise(u, curvature, matrix)?;
        if let Some(inertial) = self.inertial {
            let (body, rows) = (self.system.body(), self.system.rows());
            energy += inertial.energy(body, u);
            inertial.add_gradient(body, u, &mut gradient);
            inertial.add_hessian(body, u, curvature, rows, matrix);
        }
        Ok((energy, gradient))
    }

    /// Moves the maximised unknowns to the maximum over them, by Newton's method, and returns the energy there: the
    /// potential that steps are compared by. Leaves u as it is if the energy is not finite.
    pub(super) fn maximise(
        &mut self,
        u: &mut Vec<f64>,
        matrix: &mut BorderedMatrix,
    ) -> Result<MixedEnergy, MixedNewtonError> {
        if !matrix.maximised.iter().any(|is| *is) {
            return Ok(self.energy(u)?);
        }
        let own = self.system.pattern().increments();
        let (mut best, mut step) = (None::<(f64, Vec<f64>, Vec<f64>)>, 1.0);
        for _ in 0..MOST_STEPS {
            let (energy, gradient) = self.system.linearise_shared(u, matrix)?;
            let slack = 1e-14 * energy.magnitude;
            if let Some((before, from, increments)) = &best
                && (energy.value.is_nan() || energy.value < before - slack)
            {
                step *= 0.5;
                *u = self.system.body().moved(from, step, increments);
                continue;
            }
            if !energy.value.is_finite() {
                break;
            }
            let gradient = self.system.free_part(&gradient);
            let rows = || (0..matrix.shared()).filter(|&shared| matrix.maximised[shared]);
            let mut direction: Vec<f64> = rows().map(|shared| -gradient[own + shared]).collect();
            concave(matrix)?.0.solve(&mut direction);
            let rise: f64 = rows().zip(&direction).map(|(shared, d)| gradient[own + shared] * d).sum();
            if 0.5 * rise <= 1e-16 * energy.magnitude {
                break;
            }
            let mut part = vec![0.0; own + matrix.shared()];
            rows().zip(&direction).for_each(|(shared, d)| part[own + shared] = *d);
            let increments = self.system.spread(&part);
            let moved = self.system.body().moved(u, 1.0, &increments);
            best = Some((energy.value, std::mem::replace(u, moved), increments));
            step = 1.0;
        }
        Ok(self.energy(u)?)
    }
}
