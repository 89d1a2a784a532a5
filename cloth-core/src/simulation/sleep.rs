//! When an island falls asleep, and what wakes it.

use energy_dsl::Vector3;
use serde::{Deserialize, Serialize};

use crate::contact::{AnySolid, Obstacle};
use crate::geometry::{dot, norm, subtract};
use crate::motion::Motion;
use crate::scene::Sleep;

/// The test for stillness.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Stillness {
    /// The largest speed of a still vertex, in m/s.
    speed: f64,
    /// How long an island must be still before it sleeps, in s.
    duration: f64,
}

/// Whether an island sleeps.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(super) enum SleepState {
    /// The island moves.
    Awake {
        /// Consecutive steps below the speed limit.
        #[serde(rename = "still")]
        still_steps: u64,
        /// The velocities at the start of these steps; empty if the last step was too fast.
        #[serde(rename = "from")]
        reference: Vec<Vector3<f64>>,
    },
    /// The island is skipped. The sphere holds all its vertices.
    Asleep(BoundingSphere),
}

/// A sphere around all vertices of an island.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(super) struct BoundingSphere {
    centre: Vector3<f64>,
    radius: f64,
}

/// A time step, with the motions that take place during it.
#[derive(Debug)]
pub(super) struct StepContext<'a> {
    /// Time at the start of the step, in s.
    pub time: f64,
    /// Time at the end of the step, in s.
    pub end: f64,
    /// Step size, in s.
    pub dt: f64,
    /// Motions of the pins.
    pub motions: &'a [Motion],
    /// Obstacles of the scene.
    pub obstacles: &'a [Obstacle],
    /// Obstacles that move during the step: the solid at the start and at the end, and the thickness in m.
    moving: Vec<([AnySolid; 2], f64)>,
}

impl Stillness {
    /// The largest change of a velocity while an island falls asleep, over the speed limit. A vertex at a turning
    /// point, like that of a pendulum, is slow but changes its velocity by more.
    const CHANGE: f64 = 0.5;
    /// The default speed limit over the size of the island, in 1/s.
    const RATE: f64 = 1e-3;

    /// Creates the test for an island with these initial positions.
    pub(super) fn new(sleep: &Sleep, start: &[Vector3<f64>]) -> Self {
        let side = |axis: usize| {
            let all = || start.iter().map(|point| point[axis]);
            all().fold(f64::NEG_INFINITY, f64::max) - all().fold(f64::INFINITY, f64::min)
        };
        let speed = sleep.speed.unwrap_or_else(|| Self::RATE * norm([0, 1, 2].map(side)));
        Self { speed, duration: sleep.after }
    }
}

impl SleepState {
    /// Awake, before the first still step.
    pub(super) const AWAKE: Self = Self::Awake { still_steps: 0, reference: Vec::new() };

    pub(super) fn is_asleep(&self) -> bool {
        matches!(self, Self::Asleep(_))
    }

    /// Updates the stillness timer after a step. Returns `true`, and resets the timer, once the island has been
    /// still for long enough.
    pub(super) fn update(&mut self, v: &[Vector3<f64>], dt: f64, stillness: &Stillness) -> bool {
        let Self::Awake { still_steps, reference } = self else { return false };
        let within = |v: Vector3<f64>, limit: f64| dot(v, v) <= limit * limit;
        if !v.iter().all(|&v| within(v, stillness.speed)) {
            reference.clear();
            return false;
        }
        if reference.is_empty() {
            (*still_steps, *reference) = (0, v.to_vec());
            return false;
        }
        *still_steps = still_steps.saturating_add(1);
        // Half a step of slack: rounding of dt must not cost a whole step.
        if (*still_steps as f64 + 0.5) * dt < stillness.duration {
            return false;
        }
        let change = Stillness::CHANGE * stillness.speed;
        let steady = v.iter().zip(&*reference).all(|(&now, &then)| within(subtract(now, then), change));
        reference.clear();
        steady
    }
}

impl BoundingSphere {
    /// Returns the sphere about the centre of the bounding box.
    pub(super) fn around(x: &[Vector3<f64>]) -> Self {
        let middle = |axis: usize| {
            let all = || x.iter().map(|point| point[axis]);
            0.5 * (all().fold(f64::INFINITY, f64::min) + all().fold(f64::NEG_INFINITY, f64::max))
        };
        let centre = [0, 1, 2].map(middle);
        let radius = x.iter().map(|&point| norm(subtract(point, centre))).fold(0.0, f64::max);
        Self { centre, radius }
    }
}

impl<'a> StepContext<'a> {
    /// Creates the context of step number `step`, counted from 1. Moving obstacles are collected only if islands may
    /// sleep.
    pub(super) fn new(step: u64, dt: f64, motions: &'a [Motion], obstacles: &'a [Obstacle], may_sleep: bool) -> Self {
        let (time, end) = ((step - 1) as f64 * dt, step as f64 * dt);
        let moves = |one: &&Obstacle| one.moves(time, end);
        let swept = |one: &Obstacle| ([time, end].map(|time| one.at(time)), one.thickness);
        let moving = if may_sleep { obstacles.iter().filter(moves).map(swept).collect() } else { Vec::new() };
        Self { time, end, dt, motions, obstacles, moving }
    }

    /// Whether a pin with one of these motions moves.
    pub(super) fn moves_any_of(&self, motions: &[usize]) -> bool {
        motions.iter().any(|&motion| self.motions[motion].moves(self.time, self.end))
    }

    /// Whether a moving obstacle may touch a vertex in the sphere. Conservative: a signed distance changes by at most
    /// the distance that the point moves.
    pub(super) fn may_touch(&self, bounds: &BoundingSphere) -> bool {
        let near = |solid: &AnySolid, reach: f64| solid.signed_distance(bounds.centre) <= bounds.radius + reach;
        self.moving.iter().any(|(solids, reach)| solids.iter().any(|solid| near(solid, *reach)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Coulomb;
    use crate::contact::Ball;
    use crate::motion::Key;

    const STILL: Stillness = Stillness { speed: 1e-3, duration: 0.5 };

    /// The step of 0.1 s, among the first 20, after which a vertex with this speed over time falls asleep.
    fn asleep_after(speed: impl Fn(f64) -> f64) -> Option<usize> {
        let mut state = SleepState::AWAKE;
        (0..20).find(|&step| state.update(&[[0.0; 3], [speed(0.1 * step as f64), 0.0, 0.0]], 0.1, &STILL))
    }

    #[test]
    fn slow_and_steady_islands_fall_asleep() {
        assert_eq!(asleep_after(|_| 0.0), Some(5));
        assert_eq!(asleep_after(|time| if time < 0.55 { 0.1 } else { 9e-4 }), Some(11));
        assert_eq!(asleep_after(|_| 1.1e-3), None);
        assert_eq!(asleep_after(|_| f64::NAN), None);
        // A turning point is slow for a while, but not steady.
        assert_eq!(asleep_after(|time| 3.9e-3 * (time - 0.25)), None);
    }

    #[test]
    fn the_default_speed_limit_scales_with_size() {
        let of = |speed| Stillness::new(&Sleep { speed, after: 0.2 }, &[[0.0; 3], [2.0, 1.0, 2.0]]);
        assert_eq!(of(None), Stillness { speed: 3e-3, duration: 0.2 });
        assert_eq!(of(Some(0.1)).speed, 0.1);
    }

    #[test]
    fn moving_obstacles_are_felt_where_a_step_starts_and_ends() {
        let key = |time, far| Key { time, angle: 0.0, translate: [far, 0.0, 0.0] };
        let keys = vec![key(0.0, 0.0), key(1.0, 10.0), key(2.0, 10.0)];
        let obstacle = Obstacle {
            deformation: None,
            name: "ball".to_owned(),
            solid: AnySolid::Ball(Ball { centre: [0.0; 3], radius: 1.0 }),
            motion: Some(Motion { keys, ..Motion::default() }),
            thickness: 0.1,
            stiffness: 1.0,
            friction: Coulomb::default(),
            sticking: 1e-3,
        };
        let obstacles = [obstacle];
        let bounds = |at: f64| BoundingSphere::around(&[[at - 0.5, 0.0, 0.0], [at + 0.5, 0.0, 0.0]]);
        let near = |step, at| StepContext::new(step, 1.0, &[], &obstacles, true).may_touch(&bounds(at));
        assert!(near(1, 1.5) && near(1, 8.5) && !near(1, 1.7) && !near(1, 5.0));
        assert!(!near(2, 8.5), "the obstacle has stopped");
    }
}
