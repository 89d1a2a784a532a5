//! Extension against force between two pins or groups of pins.

use serde::Serialize;

use super::SurveyError;
use crate::geometry::{dot, norm, subtract};
use crate::measure::{Measurements, PinReading};

/// How two pins, or groups of pins, pull a cloth apart.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Pull {
    /// Labels of the two, such as `pin 0` and `group jaw`.
    pub between: [String; 2],
    /// Distance of their mean positions at the first reading, in m.
    pub gauge_length: f64,
    /// One point per reading.
    pub points: Vec<PullPoint>,
}

/// Extension and force at one time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PullPoint {
    /// Time, in s.
    pub time: f64,
    /// Change of the distance since the first reading, in m.
    pub extension: f64,
    /// The same relative to the gauge length.
    pub strain: f64,
    /// Pull along the line between the two, in N: the mean of the forces on both; positive if the cloth pulls them
    /// together.
    pub force: f64,
}

impl Pull {
    /// Returns the pull between two labels; by default between the only two groups, or the only two pins without
    /// groups. `None` if there are others, or no reading.
    ///
    /// # Errors
    /// Returns an error if no pin or group has one of the labels.
    pub fn of(all: &Measurements, between: Option<&[String; 2]>) -> Result<Option<Self>, SurveyError> {
        let Some(first) = all.readings.first() else { return Ok(None) };
        let labels: Vec<String> = all.loads(first).into_iter().map(|(label, _)| label).collect();
        let groups = &labels[all.pins.len()..];
        let [one, other] = match (between, groups, &labels[..]) {
            (Some(pair), ..) => pair.clone(),
            (None, [one, other], _) | (None, [], [one, other]) => [one.clone(), other.clone()],
            _ => return Ok(None),
        };
        let place = |wanted: &String| {
            let found = labels.iter().position(|label| label == wanted || label.strip_prefix("group ") == Some(wanted));
            found.ok_or_else(|| SurveyError::NoSuchPin { name: wanted.clone(), known: labels.clone() })
        };
        let (one, other) = (place(&one)?, place(&other)?);
        let ends = |number: usize| {
            let loads = all.loads(&all.readings[number]);
            [loads[one].1, loads[other].1]
        };
        let between = [one, other].map(|number| labels[number].clone());
        let gauge_length = distance(ends(0));
        let point = |number: usize| {
            let (ends, time) = (ends(number), all.readings[number].time);
            let extension = distance(ends) - gauge_length;
            PullPoint { time, extension, strain: extension / gauge_length, force: tension(ends) }
        };
        let points = (0..all.readings.len()).map(point).collect();
        Ok(Some(Self { between, gauge_length, points }))
    }
}

fn distance([one, other]: [PinReading; 2]) -> f64 {
    norm(subtract(other.position, one.position))
}

fn tension([one, other]: [PinReading; 2]) -> f64 {
    let way = subtract(other.position, one.position);
    let length = norm(way);
    // The cloth pulls each end towards the other.
    if length > 0.0 { 0.5 * dot(subtract(one.force, other.force), way) / length } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::Reading;

    fn all(names: [Option<&str>; 3]) -> Measurements {
        let pin = |x: f64, force: f64| PinReading::of(&[[force, 0.5, 0.0]], &[[x, 0.0, 0.0]]);
        let reading = |time: f64| Reading {
            time,
            pins: vec![pin(0.0, 3.0 * time), pin(0.2 + 0.1 * time, -2.0 * time), pin(0.2 + 0.1 * time, -time)],
            strains: Vec::new(),
        };
        let pins = names.map(|name| name.map(str::to_owned)).to_vec();
        Measurements { pins, garments: Vec::new(), readings: vec![reading(0.0), reading(1.0)] }
    }

    #[test]
    fn the_extension_is_that_of_the_distance_and_the_force_that_along_it() {
        let pull = Pull::of(&all([Some("left"), Some("right"), Some("right")]), None).unwrap().unwrap();
        let last = pull.points[1];
        assert_eq!(pull.between, ["group left", "group right"]);
        assert!((last.extension - 0.1).abs() < 1e-15 && (last.strain - 0.5).abs() < 1e-14);
        assert!((last.force - 3.0).abs() < 1e-14, "{last:?}");
        let unnamed = all([None; 3]);
        assert_eq!(Pull::of(&unnamed, None).unwrap(), None);
        let pair = ["pin 0".to_owned(), "pin 2".to_owned()];
        assert!((Pull::of(&unnamed, Some(&pair)).unwrap().unwrap().points[1].force - 2.0).abs() < 1e-14);
        let wrong = ["pin 0".to_owned(), "jaw".to_owned()];
        let message = Pull::of(&unnamed, Some(&wrong)).unwrap_err().to_string();
        assert_eq!(message, "there is no pin or group `jaw`; there are pin 0, pin 1, pin 2");
    }
}
