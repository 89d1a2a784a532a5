//! Readings of pins and garments at each frame of a run.

use std::collections::BTreeMap;

use energy_dsl::Vector3;
use serde::{Deserialize, Serialize};

use super::{Distribution, Strain};
use crate::geometry::{add_scaled, cross, subtract};

/// The load on a pin, or on a group of pins.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct PinReading {
    /// Force of the cloth on the pin, in N; see [`crate::Simulation::reading`].
    pub force: Vector3<f64>,
    /// Moment of these forces about `position`, in N m.
    pub moment: Vector3<f64>,
    /// Mean position of the vertices, in m.
    pub position: Vector3<f64>,
    /// Number of vertices that the pin chose.
    pub vertices: usize,
}

impl PinReading {
    /// Adds the forces, in N, on vertices at some positions, in m.
    #[must_use]
    pub fn of(forces: &[Vector3<f64>], x: &[Vector3<f64>]) -> Self {
        let part = |(force, x): (&Vector3<f64>, &Vector3<f64>)| Self {
            force: *force,
            moment: [0.0; 3],
            position: *x,
            vertices: 1,
        };
        Self::sum(forces.iter().zip(x).map(part))
    }

    /// Adds readings. The moment is about the common mean position.
    #[must_use]
    pub fn sum(parts: impl Iterator<Item = Self> + Clone) -> Self {
        let vertices: usize = parts.clone().map(|part| part.vertices).sum();
        let weighted = |sum: Vector3<f64>, part: Self| add_scaled(sum, part.vertices as f64, part.position);
        let position = parts.clone().fold([0.0; 3], weighted).map(|sum| sum / vertices.max(1) as f64);
        let mut sum = Self { position, vertices, ..Self::default() };
        for part in parts {
            let lever = cross(subtract(part.position, position), part.force);
            sum.force = add_scaled(sum.force, 1.0, part.force);
            sum.moment = add_scaled(add_scaled(sum.moment, 1.0, part.moment), 1.0, lever);
        }
        sum
    }
}

/// The measurements at one time.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Reading {
    /// Time, in s.
    pub time: f64,
    /// One reading per entry of `[[pins]]`.
    pub pins: Vec<PinReading>,
    /// One strain per garment; `None` if no triangle of the garment has a warp direction.
    pub strains: Vec<Option<Strain>>,
}

impl Reading {
    /// Whether all numbers are finite. JSON has no others.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        let of_pins = self.pins.iter().flat_map(|pin| [pin.force, pin.moment, pin.position].concat());
        let of_strains = self.strains.iter().flatten().flat_map(|strain| {
            [strain.warp, strain.weft, strain.shear].map(|of| of.mean + of.largest + of.low + of.high)
        });
        of_pins.chain(of_strains).all(f64::is_finite)
    }
}

/// Components of the load on a pin.
const LOADS: [&str; 9] = ["Fx [N]", "Fy [N]", "Fz [N]", "Mx [N m]", "My [N m]", "Mz [N m]", "x [m]", "y [m]", "z [m]"];

/// The readings of a run, one per frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Measurements {
    /// The name of each pin; `None` without one.
    pub pins: Vec<Option<String>>,
    /// The names of the garments.
    pub garments: Vec<String>,
    /// One reading per frame.
    pub readings: Vec<Reading>,
}

impl Measurements {
    /// Names of the groups of pins, in the order of their first pins.
    #[must_use]
    pub fn groups(&self) -> Vec<&str> {
        self.numbered().0
    }

    /// Returns the names of the groups, and the number of the group of each pin.
    fn numbered(&self) -> (Vec<&str>, Vec<Option<usize>>) {
        let (mut names, mut known, mut numbers) = (Vec::new(), BTreeMap::new(), Vec::new());
        for name in self.pins.iter().map(Option::as_deref) {
            let number = name.map(|name| *known.entry(name).or_insert(names.len()));
            if number == Some(names.len()) {
                names.extend(name);
            }
            numbers.push(number);
        }
        (names, numbers)
    }

    /// Returns the load on each pin and then on each group of a reading, with a label: `pin 0`, `group jaw`.
    #[must_use]
    pub fn loads(&self, reading: &Reading) -> Vec<(String, PinReading)> {
        let (names, numbers) = self.numbered();
        let mut members: Vec<Vec<PinReading>> = vec![Vec::new(); names.len()];
        for (number, pin) in numbers.iter().zip(&reading.pins) {
            number.iter().for_each(|&number| members[number].push(*pin));
        }
        let pins = reading.pins.iter().enumerate().map(|(number, pin)| (format!("pin {number}"), *pin));
        let groups = names.iter().zip(&members);
        let sum =
            |(name, pins): (&&str, &Vec<PinReading>)| (format!("group {name}"), PinReading::sum(pins.iter().copied()));
        pins.chain(groups.map(sum)).collect()
    }

    /// Names of the numbers of a reading, with units: `time [s]`; force, moment and position of each pin and group
    /// (`pin 0 Fx [N]`); strains of each garment (`shirt warp 95%`).
    #[must_use]
    pub fn columns(&self) -> Vec<String> {
        let mut columns = vec!["time [s]".to_owned()];
        let empty = Reading { pins: vec![PinReading::default(); self.pins.len()], ..Reading::default() };
        for (label, _) in self.loads(&empty) {
            columns.extend(LOADS.map(|column| format!("{label} {column}")));
        }
        for garment in &self.garments {
            for (quantity, unit) in [("warp", ""), ("weft", ""), ("shear", " [deg]")] {
                let statistics = ["mean", "largest", "5%", "95%"];
                columns.extend(statistics.map(|statistic| format!("{garment} {quantity} {statistic}{unit}")));
            }
        }
        columns
    }

    /// Returns the numbers of a reading, in the order of [`Self::columns`]; NaN for a strain that does not exist.
    #[must_use]
    pub fn row(&self, reading: &Reading) -> Vec<f64> {
        let mut row = vec![reading.time];
        for (_, PinReading { force, moment, position, .. }) in self.loads(reading) {
            row.extend([force, moment, position].concat());
        }
        for strain in &reading.strains {
            let of = |strain: Strain| [strain.warp, strain.weft, strain.shear];
            let numbers = |Distribution { mean, largest, low, high }: Distribution| [mean, largest, low, high];
            row.extend(strain.map_or([f64::NAN; 12].to_vec(), |strain| of(strain).map(numbers).concat()));
        }
        row
    }

    /// Formats the readings as CSV, one line per reading. A strain that does not exist is an empty cell.
    #[must_use]
    pub fn csv(&self) -> String {
        let quoted = |name: &String| name.replace(['"', ',', '\n', '\r'], " ");
        let mut text = self.columns().iter().map(quoted).collect::<Vec<_>>().join(",");
        let cell = |number: &f64| if number.is_nan() { String::new() } else { format!("{number:e}") };
        for reading in &self.readings {
            text.push('\n');
            text.push_str(&self.row(reading).iter().map(cell).collect::<Vec<_>>().join(","));
        }
        text.push('\n');
        text
    }

    /// Returns forces and strains at the last reading, by column, for tables of many runs. Pins are left out if there
    /// are more than 16; their groups stay.
    #[must_use]
    pub fn at_end(&self) -> Vec<(String, f64)> {
        let Some(last) = self.readings.last() else { return Vec::new() };
        let is_shown = |name: &str| {
            let is_pin = name.starts_with("pin ") && self.pins.len() > 16;
            let is_other = name == "time [s]" || LOADS[3..].iter().any(|column| name.ends_with(column));
            !is_pin && !is_other
        };
        self.columns().into_iter().zip(self.row(last)).filter(|(name, _)| is_shown(name)).collect()
    }

    /// Returns at most about `most` numbers of pins: all readings, or every second, third and so on, and the last one.
    #[must_use]
    pub fn thinned(&self, most: usize) -> Self {
        let numbers = self.readings.len().saturating_mul(self.pins.len());
        let stride = numbers.div_ceil(most.max(1)).max(1);
        let last = self.readings.len().saturating_sub(1);
        let kept = self.readings.iter().enumerate().filter(|(at, _)| at.is_multiple_of(stride) || *at == last);
        Self {
            pins: self.pins.clone(),
            garments: self.garments.clone(),
            readings: kept.map(|(_, reading)| reading.clone()).collect(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn groups_add_forces_and_moments_about_their_common_middle() {
        // Two opposite forces 2 m apart are a couple of 2 N × 1 m on either side of the middle.
        let pin = |x: f64, force: f64| PinReading::of(&[[0.0, force, 0.0]], &[[x, 0.0, 0.0]]);
        let jaw = || Some("jaw".to_owned());
        let reading =
            Reading { time: 0.5, pins: vec![pin(-1.0, -2.0), pin(5.0, 1.0), pin(1.0, 2.0)], ..Reading::default() };
        let all = Measurements { pins: vec![jaw(), None, jaw()], garments: Vec::new(), readings: vec![reading] };
        let loads = all.loads(&all.readings[0]);
        let group = loads[3].1;
        assert_eq!((group.force, group.moment, group.position), ([0.0; 3], [0.0, 0.0, 4.0], [0.0; 3]));
        let csv = all.csv();
        let rows: Vec<Vec<&str>> = csv.lines().map(|line| line.split(',').collect()).collect();
        assert_eq!((rows.len(), rows[0].len(), rows[1].len()), (2, 37, 37));
        let column = rows[0].iter().position(|name| *name == "group jaw Mz [N m]").unwrap();
        assert_eq!((rows[1][column], rows[0][20]), ("4e0", "pin 2 Fy [N]"));
    }

    #[test]
    fn a_long_record_keeps_its_first_and_last_readings() {
        let reading =
            |number: usize| Reading { time: number as f64, pins: vec![PinReading::default(); 3], ..Reading::default() };
        let all = Measurements { pins: vec![None; 3], garments: Vec::new(), readings: (0..100).map(reading).collect() };
        assert_eq!(all.thinned(300), all);
        let thin = all.thinned(40);
        let times: Vec<f64> = thin.readings.iter().map(|reading| reading.time).collect();
        assert!(times.len() <= 15 && times[0] == 0.0 && times.last() == Some(&99.0), "{times:?}");
    }
}
