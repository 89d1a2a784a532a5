//! When an island falls asleep, and what wakes it.

use energy_dsl::Vector3;
use serde::{Deserialize, Serialize};

use crate::contact::{AnySolid, Obstacle};
use crate::mesh::{dot, norm, subtract};
use crate::motion::Motion;
use crate::scene::Sleep;

/// What counts as still.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Stillness {
    /// In m/s.
    speed: f64,
    /// For that long, in s.
    after: f64,
}

/// Whether an island sleeps.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) enum Rest {
    /// It moves; since so many steps so slowly that it may fall asleep, from these velocities on. Without velocities it was too fast.
    Awake { still: u64, from: Vec<Vector3<f64>> },
    /// It does not, and all of it lies in here.
    Asleep(Extent),
}

/// A ball around vertices.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Extent {
    centre: Vector3<f64>,
    radius: f64,
}

/// A step, and what moves in it.
#[derive(Debug)]
pub(crate) struct Moment<'a> {
    /// When it starts, in s.
    pub time: f64,
    /// When it ends, in s.
    pub end: f64,
    /// Its size, in s.
    pub dt: f64,
    /// How pins move.
    pub motions: &'a [Motion],
    /// All solids.
    pub obstacles: &'a [Obstacle],
    /// Those that move in this step: at its start, at its end, and how far they reach, in m.
    moved: Vec<([AnySolid; 2], f64)>,
}

impl Stillness {
    /// How much velocities may change while they are watched, over the speed that counts as still: what turns back, as a pendulum does, changes more.
    const CHANGE: f64 = 0.5;
    /// The speed that counts as still by default over the size of an island, in 1/s.
    const RATE: f64 = 1e-3;

    /// What counts as still of vertices that are there at the start.
    pub(crate) fn of(sleep: &Sleep, start: &[Vector3<f64>]) -> Self {
        let side = |axis: usize| {
            let all = || start.iter().map(|point| point[axis]);
            all().fold(f64::NEG_INFINITY, f64::max) - all().fold(f64::INFINITY, f64::min)
        };
        let speed = sleep.speed.unwrap_or_else(|| Self::RATE * norm([0, 1, 2].map(side)));
        Self { speed, after: sleep.after }
    }
}

impl Rest {
    /// Awake, and not still so far.
    pub(crate) const AWAKE: Self = Self::Awake { still: 0, from: Vec::new() };

    pub(crate) fn is_asleep(&self) -> bool {
        matches!(self, Self::Asleep(_))
    }

    /// Told the velocities after a step: whether it was still for long enough. Then it is watched from anew.
    pub(crate) fn is_still(&mut self, v: &[Vector3<f64>], dt: f64, stillness: &Stillness) -> bool {
        let Self::Awake { still, from } = self else { return false };
        let within = |v: Vector3<f64>, limit: f64| dot(v, v) <= limit * limit;
        if !v.iter().all(|&v| within(v, stillness.speed)) {
            from.clear();
            return false;
        }
        if from.is_empty() {
            (*still, *from) = (0, v.to_vec());
            return false;
        }
        *still += 1;
        // The last step counts whole, however its size is rounded.
        if (*still as f64 + 0.5) * dt < stillness.after {
            return false;
        }
        let change = Stillness::CHANGE * stillness.speed;
        let steady = v.iter().zip(&*from).all(|(&now, &then)| within(subtract(now, then), change));
        from.clear();
        steady
    }
}

impl Extent {
    /// The ball about the middle of their box.
    pub(crate) fn of(x: &[Vector3<f64>]) -> Self {
        let middle = |axis: usize| {
            let all = || x.iter().map(|point| point[axis]);
            0.5 * (all().fold(f64::INFINITY, f64::min) + all().fold(f64::NEG_INFINITY, f64::max))
        };
        let centre = [0, 1, 2].map(middle);
        let radius = x.iter().map(|&point| norm(subtract(point, centre))).fold(0.0, f64::max);
        Self { centre, radius }
    }
}

impl<'a> Moment<'a> {
    /// Step number `step`, from 1; what moves is of interest where something may sleep.
    pub(crate) fn new(step: u64, dt: f64, motions: &'a [Motion], obstacles: &'a [Obstacle], may_sleep: bool) -> Self {
        let (time, end) = ((step - 1) as f64 * dt, step as f64 * dt);
        let moves = |one: &&Obstacle| one.motion.as_ref().is_some_and(|motion| motion.moves(time, end));
        let moved = |one: &Obstacle| ([time, end].map(|time| one.at(time)), one.thickness);
        let moved = if may_sleep { obstacles.iter().filter(moves).map(moved).collect() } else { Vec::new() };
        Self { time, end, dt, motions, obstacles, moved }
    }

    /// Whether a pin with one of these motions moves.
    pub(crate) fn moves_one_of(&self, motions: &[usize]) -> bool {
        motions.iter().any(|&motion| self.motions[motion].moves(self.time, self.end))
    }

    /// Whether an obstacle that moves may touch something in there: distances change by no more than a point does.
    pub(crate) fn comes_near(&self, extent: &Extent) -> bool {
        let near = |solid: &AnySolid, reach: f64| solid.signed_distance(extent.centre) <= extent.radius + reach;
        self.moved.iter().any(|(solids, reach)| solids.iter().any(|solid| near(solid, *reach)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::Ball;
    use crate::motion::Key;

    const STILL: Stillness = Stillness { speed: 1e-3, after: 0.5 };

    /// After how many steps of 0.1 s something falls asleep, of the first 20.
    fn asleep_after(speed: impl Fn(f64) -> f64) -> Option<usize> {
        let mut rest = Rest::AWAKE;
        (0..20).find(|&step| rest.is_still(&[[0.0; 3], [speed(0.1 * step as f64), 0.0, 0.0]], 0.1, &STILL))
    }

    #[test]
    fn what_is_slow_and_steady_for_long_falls_asleep() {
        assert_eq!(asleep_after(|_| 0.0), Some(5));
        assert_eq!(asleep_after(|time| if time < 0.55 { 0.1 } else { 9e-4 }), Some(11));
        assert_eq!(asleep_after(|_| 1.1e-3), None);
        assert_eq!(asleep_after(|_| f64::NAN), None);
        // What turns back is slow for a while, but not steady.
        assert_eq!(asleep_after(|time| 3.9e-3 * (time - 0.25)), None);
    }

    #[test]
    fn the_speed_that_counts_as_still_goes_with_the_size() {
        let of = |speed| Stillness::of(&Sleep { speed, after: 0.2 }, &[[0.0; 3], [2.0, 1.0, 2.0]]);
        assert_eq!(of(None), Stillness { speed: 3e-3, after: 0.2 });
        assert_eq!(of(Some(0.1)).speed, 0.1);
    }

    #[test]
    fn obstacles_are_felt_where_they_come_from_and_where_they_go() {
        let key = |time, far| Key { time, angle: 0.0, translate: [far, 0.0, 0.0] };
        let keys = vec![key(0.0, 0.0), key(1.0, 10.0), key(2.0, 10.0)];
        let obstacle = Obstacle {
            name: "ball".to_owned(),
            solid: AnySolid::Ball(Ball { centre: [0.0; 3], radius: 1.0 }),
            motion: Some(Motion { axis: [0.0, 0.0, 1.0], centre: [0.0; 3], keys }),
            thickness: 0.1,
            stiffness: 1.0,
            friction: 0.0,
            sticking: 1e-3,
        };
        let obstacles = [obstacle];
        let extent = |at: f64| Extent::of(&[[at - 0.5, 0.0, 0.0], [at + 0.5, 0.0, 0.0]]);
        let near = |step, at| Moment::new(step, 1.0, &[], &obstacles, true).comes_near(&extent(at));
        assert!(near(1, 1.5) && near(1, 8.5) && !near(1, 1.7) && !near(1, 5.0));
        assert!(!near(2, 8.5), "it has stopped");
    }
}
