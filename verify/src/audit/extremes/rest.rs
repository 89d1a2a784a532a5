//! Inputs near rest: near the rest shape, or with a parameter near the value at which the energy vanishes.

use energy_dsl::{Declaration, Kind};
use fastrand::Rng;

use super::{Extreme, dyadic};
use crate::audit::subject::Subject;
use crate::formula::rows;
use crate::sample::{Sample, has_points};

/// Binary exponents of the strains: 1e-3 to 2e-12.
const STRAINS: [i32; 4] = [-30, -20, -39, -10];

/// A rest shape with one point for each point.
pub(super) struct RestShape {
    /// Coordinates per rest point, 2 or 3.
    pub(super) dimension: usize,
    /// Coordinates, as multiples of 2⁻¹⁰.
    pub(super) points: Vec<f64>,
}

impl RestShape {
    /// Returns the rest shape of an input, rounded; `None` for elements without.
    pub(super) fn of(declaration: &Declaration, sample: &Sample) -> Option<Self> {
        let (dimension, count) = declaration.rest_points()?;
        let fits = count == declaration.points.len() && has_points(declaration);
        fits.then(|| Self { dimension, points: sample.rest.iter().map(|&x| dyadic(x)).collect() })
    }

    /// Returns the input whose rest shape is this one, with the points where `place` moves them.
    pub(super) fn moved(&self, sample: &Sample, place: impl Fn(&[f64]) -> [f64; 3]) -> Sample {
        let positions = self.points.chunks(self.dimension).flat_map(place).collect();
        Sample { positions, rest: self.points.clone(), ..sample.clone() }
    }
}

/// Returns rest shapes with small displacement gradients. Displacements are multiples of powers of two, and so are the
/// edges.
pub(super) fn near(rest: &RestShape, ordinary: &Sample, random: &mut Rng) -> Vec<Extreme> {
    let strained = |&exponent: &i32| {
        let strain = f64::from(exponent).exp2();
        let gradient = [(); 9].map(|()| f64::from(random.i32(-8..=8)) / 8.0 * strain);
        let sample = rest.moved(ordinary, |point| {
            std::array::from_fn(|row| {
                let at = |column: usize| point.get(column).copied().unwrap_or(0.0);
                at(row) + (0..3).map(|column| gradient[3 * row + column] * at(column)).sum::<f64>()
            })
        });
        Extreme::new(format!("near rest, at a strain of {strain:.0e}"), sample)
    };
    STRAINS.iter().map(strained).collect()
}

/// Returns inputs with a scalar parameter near the value at which an energy is a zero minimum: a rest length or a rest
/// angle.
pub(super) fn near_parameter(subject: &Subject, ordinary: &Sample) -> Vec<Extreme> {
    if !matches!(subject.declaration.kind, Kind::Energy | Kind::Constraint) {
        return Vec::new();
    }
    let mut first = 0;
    let scalars: Vec<(usize, &str)> = (subject.declaration.parameters.iter())
        .filter_map(|field| {
            first += field.size;
            (field.size == 1).then_some((first - 1, &*field.name))
        })
        .collect();
    let exact = Sample { positions: ordinary.positions.iter().map(|&x| dyadic(x)).collect(), ..ordinary.clone() };
    let found =
        scalars.into_iter().find_map(|(number, name)| Some((number, name, rest_value(subject, &exact, number)?)));
    let Some((number, name, value)) = found else { return Vec::new() };
    let strained = |&exponent: &i32| {
        let strain = f64::from(exponent).exp2();
        let mut sample = exact.clone();
        sample.parameters[number] = value * (1.0 + strain);
        Extreme::new(format!("near rest, with `{name}` {strain:.0e} from its rest value"), sample)
    };
    STRAINS.iter().map(strained).collect()
}

/// Returns the value of a parameter at which ½ ‖rows‖² or the energy has its minimum 0.
fn rest_value(subject: &Subject, sample: &Sample, number: usize) -> Option<f64> {
    const GRID: usize = 96;
    let energy = |value: f64| {
        let mut moved = sample.clone();
        moved.parameters[number] = value;
        let rows = rows(&subject.formula, &moved);
        match subject.declaration.kind {
            Kind::Constraint => rows.iter().map(|c| c * c).sum::<f64>(),
            _ => rows[0],
        }
    };
    // Lengths from 1/16 to 16, and angles of both signs.
    let positive = (0..=GRID).map(|k| (8.0 * k as f64 / GRID as f64 - 4.0).exp2());
    let angles = (0..=GRID).map(|k| (2.0 * k as f64 / GRID as f64 - 1.0) * std::f64::consts::PI);
    [positive.collect::<Vec<f64>>(), angles.collect()].into_iter().find_map(|grid| {
        let values: Vec<f64> = grid.iter().map(|&value| energy(value)).collect();
        if !values.iter().all(|value| value.is_finite()) {
            return None;
        }
        let largest = values.iter().fold(0.0, |most: f64, value| most.max(value.abs()));
        let least = (1..GRID).min_by(|&a, &b| values[a].total_cmp(&values[b]))?;
        let is_minimum = values[least] < values[least - 1] && values[least] < values[least + 1];
        if !is_minimum || largest == 0.0 {
            return None;
        }
        let (mut low, mut high) = (grid[least - 1], grid[least + 1]);
        // Ternary search. The square root of the energy is linear on both sides, so the minimum is found to a roundoff.
        for _ in 0..200 {
            let third = (high - low) / 3.0;
            let (a, b) = (low + third, high - third);
            if energy(a) < energy(b) { high = b } else { low = a }
        }
        let value = f64::midpoint(low, high);
        (energy(value).abs() <= 1e-24 * largest && value != 0.0).then_some(value)
    })
}
