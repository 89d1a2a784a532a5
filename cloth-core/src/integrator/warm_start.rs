use energy_dsl::Vector3;
use serde::{Deserialize, Serialize};

use super::moved_by_velocities;
use crate::body::Body;

/// Where Newton's method begins a step: near where vertices get to with the accelerations of the last.
///
/// Accelerations of stiff modes change from step to step, those of soft ones do not. So they are trusted the less the harder the last step was:
/// x̂ + h² a/n after a step of n iterations.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct WarmStart {
    /// Of all vertices, in m/s²; none before the first step.
    acceleration: Vec<Vector3<f64>>,
    /// Of the last step.
    iterations: u64,
}

impl WarmStart {
    /// After a step that changes the body's velocities to `v`.
    pub(super) fn after(body: &Body, v: &[Vector3<f64>], dt: f64, iterations: u64) -> Self {
        let change = |(v, before): (&Vector3<f64>, &Vector3<f64>)| -> Vector3<f64> {
            std::array::from_fn(|axis| (v[axis] - before[axis]) / dt)
        };
        Self { acceleration: v.iter().zip(&body.v).map(change).collect(), iterations }
    }

    /// Where to begin. Pinned vertices are where their velocities bring them: they move as they are told.
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
