//! Rigid motions over time, from keyframes.

use std::sync::{Arc, PoisonError, RwLock};

use schemars::JsonSchema;
use serde::Deserialize;

use crate::bounded::{Direction, Number, Real, Reals};
use crate::geometry::Pose;

/// A rigid motion, interpolated between keys and constant before the first and after the last. It maps a point x to c +
/// R (x − c) + t, with the centre c, the rotation R about the axis, and the translation t.
///
/// ```
/// use cloth_physics::motion::{Key, Motion};
///
/// let quarter = Key { time: 1.0, angle: 90.0, translate: [0.0, 0.0, 2.0] };
/// let keys = vec![Key::default(), quarter];
/// let motion = Motion { axis: [0.0, 0.0, 1.0], centre: [1.0, 0.0, 0.0], keys, ..Motion::default() };
/// let [x, y, z] = motion.pose(7.0).transform([2.0, 0.0, 0.0]);
/// assert!((x - 1.0).abs() < 1e-15 && (y - 1.0).abs() < 1e-15 && z == 2.0);
/// assert_eq!(motion.pose(0.5).transform([1.0, 0.0, 0.0]), [1.0, 0.0, 1.0]);
/// ```
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Motion {
    /// Direction of the axis of rotation, right-handed. Default [0, 0, 1].
    #[serde(default = "third_axis", with = "Direction")]
    pub axis: [f64; 3],
    /// A point on the axis, in m. Default the origin.
    #[serde(default, with = "Reals::<Number, 3>")]
    pub centre: [f64; 3],
    /// Keyframes, with increasing times.
    #[serde(deserialize_with = "keys")]
    #[schemars(length(min = 1))]
    pub keys: Vec<Key>,
    /// Poses that a program sets while a simulation runs, in place of the keys; `None` for the motion of the keys.
    #[serde(skip)]
    pub steering: Option<Steering>,
    /// Motion between keys: `linear` (the default), `smoothstep`, which stops at every key, or `cubic`, which passes
    /// through keys with a continuous velocity and without overshoot.
    #[serde(default)]
    pub interpolation: Interpolation,
}

/// How a motion proceeds between two keys.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Interpolation {
    /// At constant velocity.
    #[default]
    Linear,
    /// Follows 3 s² − 2 s³ in the elapsed part s of the time between the keys: at rest at every key.
    Smoothstep,
    /// Follows cubic Hermite polynomials with the slopes of Fritsch and Butland (1984), which keep monotone keys
    /// monotone. At rest at the first and the last key.
    Cubic,
}

impl Default for Motion {
    /// Rest, about the third axis through the origin.
    fn default() -> Self {
        let (axis, keys) = (third_axis(), vec![Key::default()]);
        Self { axis, centre: [0.0; 3], keys, steering: None, interpolation: Interpolation::Linear }
    }
}

/// The pose of a motion at one time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Key {
    /// Time, in s.
    #[serde(with = "Real::<Number>")]
    pub time: f64,
    /// Angle of rotation, in degrees. Default 0.
    #[serde(default, with = "Real::<Number>")]
    pub angle: f64,
    /// Translation, in m. Default none.
    #[serde(default, with = "Reals::<Number, 3>")]
    pub translate: [f64; 3],
}

/// The pose of a motion that a program steers: one until a time, and another from a later time on. Clones share it.
#[derive(Clone, Debug)]
pub struct Steering(Arc<RwLock<SteeredPoses>>);

/// Two poses of a [`Steering`], with their times in s.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SteeredPoses {
    /// The time until which the first pose holds.
    pub start: f64,
    /// The first pose.
    pub from: Pose,
    /// The time from which the second pose holds.
    pub end: f64,
    /// The second pose.
    pub to: Pose,
}

impl PartialEq for Steering {
    /// Whether both are one.
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}

impl Steering {
    /// Rests at a pose.
    #[must_use]
    pub fn new(pose: Pose) -> Self {
        Self(Arc::new(RwLock::new(SteeredPoses { start: 0.0, from: pose, end: 0.0, to: pose })))
    }

    /// Moves to a pose between two times, in s, from where it is at the first.
    pub fn steer(&self, start: f64, end: f64, to: Pose) {
        let from = self.pose(start);
        self.set_poses(SteeredPoses { start, from, end, to });
    }

    /// Returns the two poses.
    #[must_use]
    pub fn poses(&self) -> SteeredPoses {
        *self.0.read().unwrap_or_else(PoisonError::into_inner)
    }

    /// Replaces both poses.
    pub fn set_poses(&self, poses: SteeredPoses) {
        *self.0.write().unwrap_or_else(PoisonError::into_inner) = poses;
    }

    /// Returns the pose at a time. Simulations ask for the times at which steps start and end only, so the pose between
    /// is that of the nearer end.
    fn pose(&self, time: f64) -> Pose {
        let SteeredPoses { start, from, end, to } = self.poses();
        if time >= end || (time > start && time - start >= end - time) { to } else { from }
    }
}

fn third_axis() -> [f64; 3] {
    [0.0, 0.0, 1.0]
}

fn keys<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<Vec<Key>, D::Error> {
    let keys = Vec::<Key>::deserialize(deserializer)?;
    if keys.is_empty() {
        return Err(serde::de::Error::custom("expected at least one key, such as { time = 0.0, angle = 0.0 }"));
    }
    match keys.windows(2).position(|pair| pair[0].time >= pair[1].time) {
        Some(at) => Err(serde::de::Error::custom(format!(
            "the times of keys must increase: key {} is at {} s, the next at {} s",
            at,
            keys[at].time,
            keys[at + 1].time
        ))),
        None => Ok(keys),
    }
}

impl Motion {
    /// Returns the pose at a time, in s.
    #[must_use]
    pub fn pose(&self, time: f64) -> Pose {
        if let Some(steering) = &self.steering {
            return steering.pose(time);
        }
        let Key { angle, translate, .. } = self.key(time);
        Pose::rotation(self.axis, angle, self.centre).translated(translate)
    }

    /// Whether the pose at time `from` differs from that at time `to`, in s.
    #[must_use]
    pub fn moves(&self, from: f64, to: f64) -> bool {
        if let Some(steering) = &self.steering {
            return steering.pose(from) != steering.pose(to);
        }
        self.key(from) != Key { time: from, ..self.key(to) }
    }

    /// Interpolates the keys at a time.
    fn key(&self, time: f64) -> Key {
        let after = self.keys.partition_point(|key| key.time <= time);
        match (after.checked_sub(1).map(|before| self.keys[before]), self.keys.get(after)) {
            (Some(_), Some(_)) => self.between(after, time),
            (Some(only), None) => Key { time, ..only },
            (None, Some(first)) => Key { time, ..*first },
            (None, None) => Key { time, ..Key::default() },
        }
    }

    /// Interpolates between the key with index `after` and the one before it.
    fn between(&self, after: usize, time: f64) -> Key {
        let number = |of: &dyn Fn(&Key) -> f64| -> f64 {
            let (from, to) = (&self.keys[after - 1], &self.keys[after]);
            let span = to.time - from.time;
            let s = (time - from.time) / span;
            let way = of(to) - of(from);
            match self.interpolation {
                Interpolation::Linear => of(from) + s * way,
                Interpolation::Smoothstep => of(from) + s * s * (3.0 - 2.0 * s) * way,
                Interpolation::Cubic => {
                    let [start, end] = [after - 1, after].map(|key| span * self.slope(key, of));
                    // The cubic Hermite polynomial, as the line plus a part that vanishes at both ends.
                    let bow = s * (1.0 - s) * ((1.0 - s) * (start - way) - s * (end - way));
                    of(from) + s * way + bow
                }
            }
        };
        let angle = number(&|key| key.angle);
        let translate = std::array::from_fn(|axis| number(&|key| key.translate[axis]));
        Key { time, angle, translate }
    }

    /// Returns the slope of a number at a key, per s: a weighted harmonic mean of those before and after it, or 0 if
    /// they differ in sign.
    fn slope(&self, key: usize, of: &dyn Fn(&Key) -> f64) -> f64 {
        if key == 0 || key + 1 == self.keys.len() {
            return 0.0;
        }
        let secant = |at: usize| {
            let (from, to) = (&self.keys[at], &self.keys[at + 1]);
            ((of(to) - of(from)) / (to.time - from.time), to.time - from.time)
        };
        let ((before, short), (after, long)) = (secant(key - 1), secant(key));
        if before * after <= 0.0 {
            return 0.0;
        }
        let (first, second) = (2.0 * long + short, long + 2.0 * short);
        (first + second) / (first / before + second / after)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn between_keys_it_is_linear_and_outside_it_rests() {
        let key = |time, angle| Key { time, angle, translate: [time, 0.0, 0.0] };
        let motion = Motion {
            axis: [0.0, 0.0, 1.0],
            centre: [0.0; 3],
            keys: vec![key(1.0, 0.0), key(2.0, 90.0), key(4.0, 0.0)],
            ..Motion::default()
        };
        assert_eq!(motion.key(3.0), Key { time: 3.0, angle: 45.0, translate: [3.0, 0.0, 0.0] });
        assert_eq!(motion.key(0.0), Key { time: 0.0, ..key(1.0, 0.0) });
        assert!(!motion.moves(0.0, 1.0) && motion.moves(0.5, 1.5) && !motion.moves(4.0, 9.0));
    }

    #[test]
    fn smooth_keys_are_reached_without_jumps_of_the_velocity_or_overshoot() {
        let key = |time, angle| Key { time, angle, translate: [0.0, 0.0, angle] };
        let keys = vec![key(0.0, 0.0), key(1.0, 10.0), key(1.5, 40.0), key(3.0, 40.0), key(4.0, 20.0)];
        for interpolation in [Interpolation::Smoothstep, Interpolation::Cubic] {
            let motion = Motion { keys: keys.clone(), interpolation, ..Motion::default() };
            let velocity = |time: f64| (motion.key(time + 1e-6).angle - motion.key(time - 1e-6).angle) / 2e-6;
            for key in &keys {
                let time = key.time;
                assert!((motion.key(time).angle - key.angle).abs() < 1e-12);
                assert!((velocity(time + 1e-4) - velocity(time - 1e-4)).abs() < 0.2, "{interpolation:?} at {time}");
            }
            // Monotone between keys: nothing leaves the range of the two.
            for step in 0..400 {
                let (time, angle) = (0.01 * f64::from(step), motion.key(0.01 * f64::from(step)).angle);
                let after = keys.partition_point(|key| key.time <= time).clamp(1, 4);
                let [low, high] = [keys[after - 1].angle, keys[after].angle];
                assert!(angle >= low.min(high) - 1e-12 && angle <= low.max(high) + 1e-12, "{time}: {angle}");
            }
            let through = velocity(1.0);
            assert_eq!(through > 1.0, interpolation == Interpolation::Cubic, "{interpolation:?}: {through}");
        }
    }
}
