//! The function that Newton's method minimises.

use super::body::Unknown;
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
        if !(0..matrix.shared()).any(|shared| matrix.is_concave(shared)) {
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
            let rows = || (0..matrix.shared()).filter(|&shared| matrix.is_concave(shared));
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

    /// Returns the penalty of a step with these increments, along which the potential has this slope by all unknowns
    /// but the maximised ones. Without multipliers it is 0.
    pub(super) fn penalty(
        &mut self,
        u: &[f64],
        (increments, slope): (&[f64], f64),
        matrix: &mut BorderedMatrix,
    ) -> Result<Penalty, MixedError> {
        if !matrix.multipliers.contains(&true) {
            return Ok(Penalty { weights: Vec::new(), slope });
        }
        let constraints = self.constraints(u, matrix)?;
        let own = self.system.pattern().increments();
        let moves = &self.system.free_part(increments)[own..];
        let of_objective = slope + constraints.iter().map(|(_, p, c)| p * c).sum::<f64>();
        let broken: f64 = constraints.iter().map(|(.., c)| c.abs()).sum();
        // Weights above the multipliers make the penalty exact; uphill directions need more.
        let more = if broken > 0.0 && of_objective > 0.0 { 2.0 * of_objective / broken } else { 0.0 };
        let weights: Vec<f64> = constraints.iter().map(|&(row, p, _)| more + 2.0 * (p + moves[row]).abs()).collect();
        let slope =
            of_objective - weights.iter().zip(&constraints).map(|(weight, (.., c))| weight * c.abs()).sum::<f64>();
        Ok(Penalty { weights, slope })
    }

    /// Returns what a penalty adds to the potential: Σ ν |c| − p c.
    pub(super) fn penalised(
        &mut self,
        u: &[f64],
        penalty: &Penalty,
        matrix: &mut BorderedMatrix,
    ) -> Result<f64, MixedError> {
        if penalty.weights.is_empty() {
            return Ok(0.0);
        }
        let constraints = self.constraints(u, matrix)?;
        Ok(penalty.weights.iter().zip(constraints).map(|(weight, (_, p, c))| weight * c.abs() - p * c).sum())
    }

    /// Returns the dense row, the multiplier p and the value c = ∂U/∂p of each constraint.
    fn constraints(&mut self, u: &[f64], matrix: &mut BorderedMatrix) -> Result<Vec<(usize, f64, f64)>, MixedError> {
        let (_, gradient) = self.system.linearise_shared(u, matrix)?;
        let body = self.system.body();
        let shared = body.all()[body.len()..].iter().filter(|unknown| !unknown.fixed);
        let entries = shared.flat_map(|unknown| (0..unknown.kind.increments()).map(move |i| (unknown, i)));
        let value = |(row, (unknown, i)): (usize, (&Unknown, usize))| {
            matrix.multipliers[row].then(|| (row, u[unknown.number + i], gradient[unknown.increment + i]))
        };
        Ok(entries.enumerate().filter_map(value).collect())
    }
}

/// A penalty for broken constraints c = 0, by which steps with multipliers p are compared: U − p c is the objective f,
/// and f + Σ ν |c| has its minimum where f has one under the constraints, if ν > |p| (Han 1977).
pub(super) struct Penalty {
    /// ν of each constraint.
    weights: Vec<f64>,
    /// The derivative of f + Σ ν |c| along the step.
    pub(super) slope: f64,
}
