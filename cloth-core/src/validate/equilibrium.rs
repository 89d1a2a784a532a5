use energy_dsl::Vector3;
use energy_solve::{BlockCholesky, BlockMatrix, Curvature, LinearisationOptions, State, System, Weights, dot};

use super::ValidateError;
use crate::integrator::if_finite;

/// A cloth in static equilibrium.
#[derive(Debug)]
pub(super) struct Equilibrium {
    /// The forces on the cloth.
    pub system: System,
    /// Positions, in m.
    pub x: Vec<Vector3<f64>>,
    /// Masses, in kg.
    pub masses: Vec<f64>,
    /// ∂²U/∂x² at the equilibrium.
    matrix: BlockMatrix,
    cholesky: BlockCholesky,
}

/// Newton iterations before the search fails.
const ITERATIONS: usize = 400;
/// Largest acceptable residual force, relative to the total weight.
const FORCE: f64 = 1e-10;
/// Residual force that is attributed to rounding if no step lowers the energy, relative to the total weight.
const ROUNDED: f64 = 1e-7;
/// Relative step length below which the search ends.
const SHORTEST: f64 = 1e-13;
/// Largest step per iteration, relative to the size of the cloth.
const STRIDE: f64 = 0.1;

impl Equilibrium {
    /// Finds an equilibrium near `start`: Newton's method on the energy, with a direct solver and a line search. Uses
    /// the exact Hessian if it is positive definite, otherwise clamps each element's.
    pub fn find(
        system: System,
        start: Vec<Vector3<f64>>,
        masses: Vec<f64>,
        weight: f64,
    ) -> Result<Self, ValidateError> {
        let free = system.dofs().free().to_vec();
        let matrix = system.matrix();
        let cholesky = BlockCholesky::new(matrix.pattern())?;
        let mut found = Self { matrix, cholesky, system, x: start, masses };
        let size = extent(&found.x);
        let mut energy = found.energy(&found.x.clone())?;
        let mut force = f64::INFINITY;
        for _ in 0..ITERATIONS {
            let down = found.linearise(Curvature::Exact)?;
            force = down.as_flattened().iter().fold(0.0, |largest, f| f.abs().max(largest));
            if force <= FORCE * weight {
                return Ok(found);
            }
            let direction = found.direction(&down)?;
            let longest = direction.as_flattened().iter().fold(0.0_f64, |longest, d| longest.max(d.abs()));
            if longest < SHORTEST * size {
                break;
            }
            let mut scale = (STRIDE * size / longest).min(1.0);
            let slope = dot(&down, &direction);
            let rounding = 1e-13 * (energy.1 + weight * size);
            let mut accepted = false;
            for _ in 0..40 {
                let moved = found.moved(&free, scale, &direction);
                let lower = found.energy(&moved)?;
                if lower.0 <= energy.0 - 1e-4 * scale * slope + rounding {
                    (found.x, energy, accepted) = (moved, lower, true);
                    break;
                }
                scale *= 0.5;
            }
            if !accepted {
                break;
            }
        }
        // Rounding of stiff membranes limits the accuracy of forces.
        if force <= ROUNDED * weight {
            found.linearise(Curvature::Exact)?;
            return Ok(found);
        }
        Err(ValidateError::NoEquilibrium { force, weight })
    }

    /// Returns U, and the sum of the magnitudes of its terms.
    fn energy(&mut self, x: &[Vector3<f64>]) -> Result<(f64, f64), ValidateError> {
        let Some(energies) = if_finite(self.system.energies(x))? else { return Ok((f64::INFINITY, 0.0)) };
        let all = energies.iter().filter_map(|term| term.energy);
        Ok(all.fold((0.0, 0.0), |(sum, size), energy| (sum + energy, size + energy.abs())))
    }

    /// Assembles the Hessian and returns −∇U of the free vertices.
    fn linearise(&mut self, curvature: Curvature) -> Result<Vec<Vector3<f64>>, ValidateError> {
        let still = vec![[0.0; 3]; self.x.len()];
        let weights = Weights { position: -1.0, velocity: 0.0 };
        let options = LinearisationOptions::new(weights, curvature);
        let linear = self.system.linearise(State { x: &self.x, v: &still }, options, &mut self.matrix)?;
        Ok(self.system.dofs().gather(&linear.force))
    }

    /// Returns a descent direction.
    fn direction(&mut self, down: &[Vector3<f64>]) -> Result<Vec<Vector3<f64>>, ValidateError> {
        if self.factor(0.0) {
            return Ok(self.solve(down));
        }
        self.linearise(Curvature::Clamped)?;
        let mut shift = 1e-9 * self.stiffest();
        while !self.factor(shift) {
            shift *= 100.0;
        }
        Ok(self.solve(down))
    }

    /// Returns the largest stiffness over mass.
    fn stiffest(&self) -> f64 {
        let free = self.system.dofs().free();
        let one = |(row, &vertex): (usize, &usize)| self.matrix.diagonal(row)[0][0].abs() / self.masses[vertex];
        free.iter().enumerate().map(one).fold(0.0, f64::max)
    }

    /// Factors the Hessian + `shift` M; `false` if the sum is not positive definite.
    pub fn factor(&mut self, shift: f64) -> bool {
        let mut sum = self.matrix.clone();
        for (row, &vertex) in self.system.dofs().free().iter().enumerate() {
            (0..3).for_each(|axis| sum.diagonal_mut(row)[axis][axis] += shift * self.masses[vertex]);
        }
        self.cholesky.factor(&sum).is_ok()
    }

    /// Returns A⁻¹ b for the last factored sum A.
    fn solve(&self, b: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
        let mut x = vec![[0.0; 3]; b.len()];
        self.cholesky.solve(b, &mut x);
        x
    }

    /// Returns the smallest ω² of small motions about the equilibrium, by inverse iteration; `None` if it is unstable.
    pub fn lowest_mode(&mut self) -> Option<f64> {
        if !self.factor(0.0) {
            return None;
        }
        let free = self.system.dofs().free();
        let masses: Vec<f64> = free.iter().map(|&vertex| self.masses[vertex]).collect();
        // Any start vector that is not orthogonal to the mode.
        let mut u: Vec<Vector3<f64>> =
            (0..free.len()).map(|row| [1.0, 0.7, 1.3].map(|c| c + 0.1 * ((row * 37 % 101) as f64 / 101.0))).collect();
        let mut omega_squared = f64::INFINITY;
        for _ in 0..2000 {
            let right: Vec<Vector3<f64>> = u.iter().zip(&masses).map(|(u, m)| u.map(|c| m * c)).collect();
            let next = self.solve(&right);
            let heavy: Vec<Vector3<f64>> = next.iter().zip(&masses).map(|(u, m)| u.map(|c| m * c)).collect();
            let (squared, mixed) = (dot(&next, &heavy), dot(&next, &right));
            let before = omega_squared;
            omega_squared = mixed / squared;
            u = next.into_iter().map(|u| u.map(|c| c / squared.sqrt())).collect();
            if (omega_squared / before - 1.0).abs() < 1e-10 {
                break;
            }
        }
        Some(omega_squared)
    }

    fn moved(&self, free: &[usize], scale: f64, direction: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
        let mut moved = self.x.clone();
        for (&vertex, d) in free.iter().zip(direction) {
            (0..3).for_each(|axis| moved[vertex][axis] += scale * d[axis]);
        }
        moved
    }
}

/// Returns the longest side of the bounding box.
fn extent(points: &[Vector3<f64>]) -> f64 {
    let side = |axis: usize| {
        let (low, high) = points
            .iter()
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), p| (low.min(p[axis]), high.max(p[axis])));
        high - low
    };
    (0..3).map(side).fold(0.0, f64::max)
}
