//! Wind: an even flow of air, constant or in gusts, that pushes and drags triangles.

use std::f64::consts::TAU;

use energy_dsl::Vector3;
use energy_elements::WindDrag;
use energy_solve::{StepStart, Term};
use schemars::JsonSchema;
use serde::Deserialize;

use crate::bounded::{finite_triple, non_negative, number, positive};
use crate::dissipation_term::{DissipationLaw, DissipativeTerm};
use crate::geometry::{cross, norm, subtract};

/// Wind. Each triangle is pushed by ½ ρ C A u² across and along its surface, u the velocity of the air relative to it in that direction: by the
/// element [`WindDrag`], with normals and areas as at the start of a step. Air that cloth stops or turns is not followed.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Wind {
    /// The velocity of the air, in m/s.
    #[serde(deserialize_with = "finite_triple")]
    pub velocity: [f64; 3],
    /// What is added to the velocity, each as a sine of time. Default nothing.
    #[serde(default)]
    pub gusts: Vec<Gust>,
    /// The density ρ of the air, in kg/m³. Default 1.2.
    #[serde(default = "air", deserialize_with = "positive")]
    pub density: f64,
    /// C across the surface. Default 1.2, a flat plate's.
    #[serde(default = "plate", deserialize_with = "non_negative")]
    pub across: f64,
    /// C along the surface. Default 0.02.
    #[serde(default = "skin", deserialize_with = "non_negative")]
    pub along: f64,
}

/// A part of the wind that comes and goes: amplitude × sin(2π (t/period + phase)).
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Gust {
    /// The largest velocity, in m/s.
    #[serde(deserialize_with = "finite_triple")]
    pub amplitude: [f64; 3],
    /// The time from one gust to the next, in s.
    #[serde(deserialize_with = "positive")]
    pub period: f64,
    /// Where in the period it starts, as a part of it. Default 0.
    #[serde(default, deserialize_with = "number")]
    pub phase: f64,
}

fn air() -> f64 {
    1.2
}

fn plate() -> f64 {
    1.2
}

fn skin() -> f64 {
    0.02
}

impl Wind {
    /// The velocity of the air at a time in s, in m/s.
    ///
    /// ```
    /// use cloth_core::wind::{Gust, Wind};
    /// let gust = Gust { amplitude: [0.0, 1.0, 0.0], period: 4.0, phase: 0.0 };
    /// let wind = Wind { velocity: [3.0, 0.0, 0.0], gusts: vec![gust], density: 1.2, across: 1.2, along: 0.02 };
    /// assert_eq!(wind.at(1.0), [3.0, 1.0, 0.0]);
    /// ```
    #[must_use]
    pub fn at(&self, time: f64) -> Vector3<f64> {
        let add = |velocity: Vector3<f64>, gust: &Gust| {
            let strength = (TAU * (time / gust.period + gust.phase)).sin();
            std::array::from_fn(|axis| velocity[axis] + strength * gust.amplitude[axis])
        };
        self.gusts.iter().fold(self.velocity, add)
    }

    /// The term of the wind on these triangles.
    #[must_use]
    pub fn term(&self, triangles: &[[usize; 3]]) -> Box<dyn Term> {
        let law = WindLaw { wind: self.clone(), triangles: triangles.to_vec() };
        Box::new(DissipativeTerm::new("wind".to_owned(), law, triangles))
    }
}

#[derive(Debug)]
struct WindLaw {
    wind: Wind,
    triangles: Vec<[usize; 3]>,
}

impl DissipationLaw for WindLaw {
    type Element = WindDrag;

    fn elements(&self, start: &StepStart<'_>, is_free: &[bool]) -> Vec<(usize, WindDrag)> {
        let air = self.wind.at(start.time + 0.5 * start.dt);
        let element = |(number, corners): (usize, &[usize; 3])| {
            let [a, b, c] = corners.map(|corner| start.state.x[corner]);
            let across = cross(subtract(b, a), subtract(c, a));
            let twice = norm(across);
            // A triangle without area is not pushed.
            let per_coefficient = 0.25 * self.wind.density * twice;
            (twice > 0.0).then(|| {
                let normal = across.map(|component| component / twice);
                let [c_n, c_t] = [self.wind.across, self.wind.along].map(|coefficient| coefficient * per_coefficient);
                (number, WindDrag::new(normal, air, c_n, c_t))
            })
        };
        let free = self.triangles.iter().enumerate().filter(|(number, _)| is_free[*number]);
        free.filter_map(element).collect()
    }
}
