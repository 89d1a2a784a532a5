//! Rigid motions over time, from keyframes.

use schemars::JsonSchema;
use serde::Deserialize;

use crate::bounded::{Direction, Number, Real, Reals};
use crate::geometry::Pose;

/// A rigid motion, linear in time between keys and constant before the first and after the last. It maps a point x to c
/// + R (x − c) + t, with the centre c, the rotation R about the axis, and the translation t.
///
/// ```
/// use cloth_core::motion::{Key, Motion};
///
/// let quarter = Key { time: 1.0, angle: 90.0, translate: [0.0, 0.0, 2.0] };
/// let motion = Motion { axis: [0.0, 0.0, 1.0], centre: [1.0, 0.0, 0.0], keys: vec![Key::default(), quarter] };
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
        let Key { angle, translate, .. } = self.key(time);
        Pose::rotation(self.axis, angle, self.centre).translated(translate)
    }

    /// Whether the pose at time `from` differs from that at time `to`, in s.
    #[must_use]
    pub fn moves(&self, from: f64, to: f64) -> bool {
        self.key(from) != Key { time: from, ..self.key(to) }
    }

    /// Interpolates the keys at a time.
    fn key(&self, time: f64) -> Key {
        let after = self.keys.partition_point(|key| key.time <= time);
        match (after.checked_sub(1).map(|before| self.keys[before]), self.keys.get(after)) {
            (Some(a), Some(b)) => {
                let fraction = (time - a.time) / (b.time - a.time);
                let between = |from: f64, to: f64| from + fraction * (to - from);
                let translate = std::array::from_fn(|axis| between(a.translate[axis], b.translate[axis]));
                Key { time, angle: between(a.angle, b.angle), translate }
            }
            (Some(only), None) => Key { time, ..only },
            (None, Some(first)) => Key { time, ..*first },
            (None, None) => Key { time, ..Key::default() },
        }
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
        };
        assert_eq!(motion.key(3.0), Key { time: 3.0, angle: 45.0, translate: [3.0, 0.0, 0.0] });
        assert_eq!(motion.key(0.0), Key { time: 0.0, ..key(1.0, 0.0) });
        assert!(!motion.moves(0.0, 1.0) && motion.moves(0.5, 1.5) && !motion.moves(4.0, 9.0));
    }
}
