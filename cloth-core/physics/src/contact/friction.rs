use energy_dsl::Vector3;
use energy_elements::SlidingFriction;
use energy_solve::{DissipationLaw, StepStart};

use super::solid::Solid;
use super::term::{surface_velocity, touches};

use crate::motion::Motion;

/// Coulomb friction on one solid, by [`SlidingFriction`]. Normals and normal forces are lagged: taken at the start of a
/// step, so that the friction of a step has a potential (Li et al. 2020, §5.5).
#[derive(Debug)]
pub(super) struct FrictionLaw<S> {
    pub solid: S,
    pub motion: Option<Motion>,
    pub thickness: f64,
    /// Contact stiffness of each vertex, in N/m.
    pub stiffness: Vec<f64>,
    /// Coefficient of friction μ.
    pub coefficient: f64,
    /// The sliding velocity at which friction is μ/√2 times the normal force, in m/s.
    pub sticking: f64,
}

impl<S: Solid> DissipationLaw for FrictionLaw<S> {
    type Element = SlidingFriction;

    fn elements(&self, start: &StepStart<'_>, is_free: &[bool]) -> Vec<(usize, SlidingFriction)> {
        let x = start.state.x;
        let now = self
            .motion
            .as_ref()
            .map_or_else(|| self.solid.clone(), |motion| self.solid.moved(&motion.pose(start.time)));
        let step = [start.time, start.time + start.dt];
        let element = |vertex: usize, normal: Vector3<f64>, force: f64| {
            let carried = surface_velocity(self.motion.as_ref(), step, x[vertex], false);
            SlidingFriction::new(normal, carried, self.coefficient * force, self.sticking)
        };
        let free = (0..x.len()).filter(|&vertex| is_free[vertex]);
        let touches = touches(&now, self.thickness, |vertex| self.stiffness[vertex], x, free);
        touches.iter().map(|touch| (touch.vertex, element(touch.vertex, touch.normal, touch.force))).collect()
    }
}
