//! Forces and residuals of texts as terms of a system.

use std::sync::{Arc, Mutex, PoisonError};

use energy_compiler::Elements as Tapes;
use energy_dsl::Declaration;
use energy_solve::{Character, Order, OwnLaw, OwnResults};

/// Elements whose parameters change between evaluations.
pub type SharedElements = Arc<Mutex<Tapes<f64>>>;

/// A force law f(x, v) of a text.
#[derive(Debug)]
pub struct TextForce {
    declaration: Arc<Declaration>,
    elements: SharedElements,
}

impl TextForce {
    pub fn new(elements: SharedElements) -> Self {
        let declaration = Arc::clone(lock(&elements).element().declaration());
        Self { declaration, elements }
    }
}

impl OwnLaw for TextForce {
    fn declaration(&self) -> &Declaration {
        &self.declaration
    }

    fn character(&self) -> Character {
        let Declaration { symmetric, velocity_dependent, quadratic, curved, .. } = *self.declaration();
        Character { symmetric, velocity_dependent, quadratic, curved: curved || velocity_dependent }
    }

    fn has_energy(&self) -> bool {
        false
    }

    fn evaluate(&self, order: Order, x: &[f64], v: &[f64], results: &mut OwnResults) {
        let tapes = lock(&self.elements);
        let all = 0..tapes.len();
        // Laws without velocities are not given any.
        let still = vec![0.0; if v.is_empty() { x.len() } else { 0 }];
        let v = if v.is_empty() { &still } else { v };
        let OwnResults { forces, by_position, by_velocity, flagged, .. } = results;
        let evaluated = match order {
            Order::Energy => return,
            Order::Force => tapes.forces(all, x, v, forces),
            Order::Jacobians => {
                let size = forces.len() * forces.len() / tapes.len().max(1);
                let mut unused = [by_position.is_empty(), by_velocity.is_empty()].map(|unused| match unused {
                    true => vec![0.0; size],
                    false => Vec::new(),
                });
                let [spare_x, spare_v] = &mut unused;
                let by_position = if by_position.is_empty() { spare_x } else { by_position };
                let by_velocity = if by_velocity.is_empty() { spare_v } else { by_velocity };
                tapes.force_jacobians(all, x, v, forces, by_position, by_velocity)
            }
        };
        *flagged = evaluated.expect("a force, with slices of its size").len() as u64;
    }
}

/// The energy ½ ‖r‖² of residuals of a text, whose unknowns are the coordinates of vertices. Its Hessian is that of
/// Gauss and Newton, Jᵀ J.
#[derive(Debug)]
pub struct TextResidual {
    declaration: Arc<Declaration>,
    elements: SharedElements,
    /// Vertices of one element: a third of its unknowns.
    points: usize,
}

impl TextResidual {
    pub fn new(elements: SharedElements, points: usize) -> Self {
        let declaration = Arc::clone(lock(&elements).element().declaration());
        Self { declaration, elements, points }
    }
}

impl OwnLaw for TextResidual {
    fn declaration(&self) -> &Declaration {
        &self.declaration
    }

    fn points(&self) -> usize {
        self.points
    }

    fn character(&self) -> Character {
        Character { symmetric: true, velocity_dependent: false, quadratic: false, curved: true }
    }

    fn has_energy(&self) -> bool {
        true
    }

    fn evaluate(&self, order: Order, x: &[f64], _v: &[f64], results: &mut OwnResults) {
        let tapes = lock(&self.elements);
        let (count, rows, unknowns) = (tapes.len(), self.declaration.rows, 3 * self.points);
        let (mut r, mut jacobians) = (vec![0.0; count * rows], vec![0.0; count * rows * unknowns]);
        let evaluated = match order {
            Order::Energy => tapes.residuals(0..count, x, &mut r),
            _ => tapes.jacobians(0..count, x, &mut r, &mut jacobians),
        };
        results.flagged = evaluated.expect("a residual, with slices of its size").len() as u64;
        for (element, r) in r.chunks_exact(rows).enumerate() {
            results.energies[element] = 0.5 * r.iter().map(|r| r * r).sum::<f64>();
            if order == Order::Energy {
                continue;
            }
            let jacobian = &jacobians[element * rows * unknowns..][..rows * unknowns];
            for (row, r) in jacobian.chunks_exact(unknowns).zip(r) {
                for (i, entry) in row.iter().enumerate() {
                    results.forces[element * unknowns + i] -= r * entry;
                    if order == Order::Jacobians {
                        let to = &mut results.by_position[(element * unknowns + i) * unknowns..][..unknowns];
                        to.iter_mut().zip(row).for_each(|(sum, other)| *sum -= entry * other);
                    }
                }
            }
        }
    }
}

/// Returns elements for evaluation. They are never left half written.
pub fn lock(shared: &SharedElements) -> std::sync::MutexGuard<'_, Tapes<f64>> {
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}
