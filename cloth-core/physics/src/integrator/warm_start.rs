use energy_dsl::Vector3;
use serde::{Deserialize, Serialize};

use super::moved_by_velocities;
use crate::body::Body;

/// Extrapolates the first iterate of Newton's method from the accelerations of the last step: x̂ + h² a/n, where the
/// last step took n iterations.
///
/// Accelerations of soft modes persist from step to step; those of stiff modes do not. A step with many iterations had
/// stiff modes. This is why the factor is 1/n.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct WarmStart {
    /// Accelerations of all vertices, in m/s²; empty before the first step.
    acceleration: Vec<Vector3<f64>>,
    /// Iterations of the last step.
    iterations: u64,
}

impl WarmStart {
    /// Records a step that changes the body's velocities to `v`.
    pub(super) fn after(body: &Body, v: &[Vector3<f64>], dt: f64, iterations: u64) -> Self {
        let change = |(v, before): (&Vector3<f64>, &Vector3<f64>)| -> Vector3<f64> {
            std::array::from_fn(|axis| (v[axis] - before[axis]) / dt)
        };
        Self { acceleration: v.iter().zip(&body.v).map(change).collect(), iterations }
    }

    /// Returns the first iterate. Pinned vertices move by their velocities.
    pub(super) fn begin(&self, body: &Body, dt: f64) -> Vec<Vector3<f64>> {
        let mut x = moved_by_velocities(body, dt);
        if self.acceleration.len() == x.len() {
            let scale = dt * dt / self.iterations.max(1) as f64;
            for &vertex in body.system.dofs().free() {
                for axis in 0..3 {
                    x[vertex][axis] += scale * self.acceleration[vertex][axis];
                }
            }
        }
        x
    }
}
