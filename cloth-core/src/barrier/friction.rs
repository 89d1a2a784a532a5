//! Friction of cloth with itself.
//!
//! A step of a pair in contact has the potential μ λ (√(‖t‖² + ε²) − ε) ([`SlidingFriction`]). The sliding t is the
//! tangential part of the displacement of the closest points relative to each other, since the start of the step.
//! Closest points, normal and normal force λ are lagged: taken at the start of the step, so that friction has a
//! potential (Li et al. 2020, "Incremental potential contact", §5.5). Sliding slower than ε per step sticks, but
//! creeps.

use energy_dsl::{Potential, Vector3};
use energy_elements::SlidingFriction;
use energy_solve::Contact;

use super::joined::Law;
use crate::collision::{Closest, Pair};
use crate::geometry::{add_scaled, subtract};

/// The sliding velocity at which friction is μ/√2 times the normal force, in m/s.
const STICKING: f64 = 1e-3;

/// The friction of a step.
#[derive(Debug, Default)]
pub(super) struct Friction {
    /// μ at each vertex; empty without friction.
    pub coefficients: Vec<f64>,
    /// Positions at the start of the step.
    pub start: Vec<Vector3<f64>>,
    /// The size of the step, in s.
    dt: f64,
    /// The pairs in contact at the start.
    sliding: Vec<Sliding>,
}

/// A pair in contact at the start of the step.
#[derive(Debug)]
struct Sliding {
    pair: Pair,
    /// The coefficients of the closest points at the start.
    weights: [f64; 4],
    element: SlidingFriction,
}

impl Friction {
    pub fn begin_step(&mut self, x: &[Vector3<f64>], dt: f64) {
        self.sliding.clear();
        if !self.coefficients.is_empty() {
            x.clone_into(&mut self.start);
            self.dt = dt;
        }
    }

    /// Takes the pairs in contact at the start, with their laws and closest points.
    pub fn take(&mut self, touching: Vec<(Pair, Law, Closest)>) {
        let Self { coefficients, start, dt, sliding } = self;
        let of = |(pair, law, closest): (Pair, Law, Closest)| {
            let [first, second] = [pair.vertices[0], pair.vertices[pair.first()]];
            let coefficient = 0.5 * (coefficients[first as usize] + coefficients[second as usize]);
            let limit = coefficient * law.force(law.apart(&closest));
            let between = combine(&closest.weights, &pair.corners(start));
            let element = SlidingFriction::new(closest.normal, between, limit, STICKING * *dt);
            (limit > 0.0).then_some(Sliding { pair, weights: closest.weights, element })
        };
        *sliding = touching.into_iter().filter_map(of).collect();
    }

    /// Returns Σ μ λ (√(‖t‖² + ε²) − ε), in J.
    pub fn energy(&self, x: &[Vector3<f64>]) -> f64 {
        self.sliding.iter().map(|one| one.element.value(&[one.between(x)]).value).sum()
    }

    /// Adds the forces of friction, in N.
    pub fn add_force(&self, x: &[Vector3<f64>], force: &mut [Vector3<f64>]) {
        for one in &self.sliding {
            let [slope] = one.element.gradient(&[one.between(x)]).gradient;
            one.pair.add(one.weights, slope.map(|component| -component), force);
        }
    }

    /// Adds the stiffness of friction. `row` is the row of a vertex in the matrix.
    pub fn add_contacts(&self, x: &[Vector3<f64>], row: impl Fn(&u32) -> u32, contacts: &mut Vec<Contact>) {
        contacts.extend(self.sliding.iter().map(|one| Contact {
            rows: one.pair.vertices.each_ref().map(&row),
            weights: one.weights,
            block: one.element.hessian(&[one.between(x)]).hessian.as_ref()[0],
        }));
    }
}

impl Sliding {
    /// The vector between the points that were closest at the start.
    fn between(&self, x: &[Vector3<f64>]) -> Vector3<f64> {
        combine(&self.weights, &self.pair.corners(x))
    }
}

/// Σ cᵢ xᵢ for coefficients with the sum 0. Differences to one corner lose fewer digits.
fn combine(weights: &[f64; 4], corners: &[Vector3<f64>; 4]) -> Vector3<f64> {
    let from_first = |corner: &Vector3<f64>| subtract(*corner, corners[0]);
    weights.iter().zip(corners).fold([0.0; 3], |sum, (weight, corner)| add_scaled(sum, *weight, from_first(corner)))
}
