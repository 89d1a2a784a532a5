//! Wind: a uniform flow of air, constant or with gusts, that acts on triangles.

use std::f64::consts::TAU;
use std::sync::{Arc, Mutex, PoisonError};

use energy_dsl::Vector3;
use energy_elements::WindDrag;
use energy_solve::{DissipationLaw, DissipationTerm, StepStart, Term};
use schemars::JsonSchema;
use serde::de::Error as _;
use serde::{Deserialize, Deserializer};

use crate::bounded::{NonNegative, Number, Positive, Real, Reals, Speed};

use crate::geometry::{cross, norm, subtract};

/// Wind pushes each triangle with ½ ρ C A u² across and along its surface, where u is the relative velocity of the air
/// in that direction (element [`WindDrag`]). Normals and areas are those at the start of a step. Cloth does not change
/// the flow.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Wind {
    /// The velocity of the air, in m/s.
    #[serde(with = "Reals::<Speed, 3>")]
    pub velocity: [f64; 3],
    /// Gusts added to the velocity, at most 64. Default none.
    #[serde(default, deserialize_with = "few_gusts")]
    #[schemars(length(max = 64))]
    pub gusts: Vec<Gust>,
    /// Density ρ of the air, in kg/m³. Default 1.2.
    #[serde(default = "air", with = "Real::<Positive>")]
    pub density: f64,
    /// Drag coefficient C across the surface. Default 1.2, that of a flat plate.
    #[serde(default = "plate", with = "Real::<NonNegative>")]
    pub across: f64,
    /// Drag coefficient C along the surface. Default 0.02.
    #[serde(default = "skin", with = "Real::<NonNegative>")]
    pub along: f64,
    /// A velocity that a program sets while a simulation runs, in place of `velocity`; `None` for that of the scene.
    #[serde(skip)]
    pub steering: Option<SteeredVelocity>,
}

/// A velocity of the air, in m/s, that a program sets. Clones share it.
#[derive(Clone, Debug)]
pub struct SteeredVelocity(Arc<Mutex<Vector3<f64>>>);

impl PartialEq for SteeredVelocity {
    /// Whether both are one.
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}

impl SteeredVelocity {
    /// Begins with a velocity, in m/s.
    #[must_use]
    pub fn new(velocity: Vector3<f64>) -> Self {
        Self(Arc::new(Mutex::new(velocity)))
    }

    /// Returns the velocity, in m/s.
    #[must_use]
    pub fn get(&self) -> Vector3<f64> {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Sets the velocity of the next steps, in m/s.
    pub fn set(&self, velocity: Vector3<f64>) {
        *self.0.lock().unwrap_or_else(PoisonError::into_inner) = velocity;
    }
}

/// A sinusoidal gust: amplitude × sin(2π (t/period + phase)).
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Gust {
    /// The largest velocity, in m/s.
    #[serde(with = "Reals::<Speed, 3>")]
    pub amplitude: [f64; 3],
    /// The time between gusts, in s.
    #[serde(with = "Real::<Positive>")]
    pub period: f64,
    /// Phase at time 0, as a fraction of the period. Default 0.
    #[serde(default, with = "Real::<Number>")]
    pub phase: f64,
}

/// The largest number of gusts: all are summed in every step.
const MOST_GUSTS: usize = 64;

fn few_gusts<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<Gust>, D::Error> {
    let gusts = Vec::deserialize(deserializer)?;
    match gusts.len() <= MOST_GUSTS {
        true => Ok(gusts),
        false => Err(D::Error::custom(format!("expected at most {MOST_GUSTS} gusts, got {}", gusts.len()))),
    }
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
    /// Returns the velocity of the air at a time in s, in m/s.
    ///
    /// ```
    /// use cloth_physics::wind::{Gust, Wind};
    /// let gust = Gust { amplitude: [0.0, 1.0, 0.0], period: 4.0, phase: 0.0 };
    /// let (velocity, gusts) = ([3.0, 0.0, 0.0], vec![gust]);
    /// let wind = Wind { velocity, gusts, density: 1.2, across: 1.2, along: 0.02, steering: None };
    /// assert_eq!(wind.at(1.0), [3.0, 1.0, 0.0]);
    /// ```
    #[must_use]
    pub fn at(&self, time: f64) -> Vector3<f64> {
        let add = |velocity: Vector3<f64>, gust: &Gust| {
            let strength = (TAU * (time / gust.period + gust.phase)).sin();
            std::array::from_fn(|axis| velocity[axis] + strength * gust.amplitude[axis])
        };
        let velocity = self.steering.as_ref().map_or(self.velocity, SteeredVelocity::get);
        self.gusts.iter().fold(velocity, add)
    }

    /// Creates the term of the wind on these triangles.
    #[must_use]
    pub fn term(&self, triangles: &[[usize; 3]]) -> Box<dyn Term> {
        let law = WindLaw { wind: self.clone(), triangles: triangles.to_vec() };
        Box::new(DissipationTerm::new("wind".to_owned(), law, triangles))
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
            // A degenerate triangle feels no wind.
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
