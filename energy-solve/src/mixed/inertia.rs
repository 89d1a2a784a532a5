//! Inertia, and the potential whose minimum is a time step.

use energy_dsl::{Block, Vector3};

use super::body::{MixedBody, UnknownKind};
use super::error::MixedError;
use super::rotation::{self, Quaternion};
use super::scatter::Rows;
use super::system::{EnergySum, MixedEnergy};
use crate::linear::block_jacobi::{inverse, is_positive_definite};
use crate::matrix::{BorderedMatrix, index};
use crate::terms::Curvature;

/// The inertia of an unknown.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Inertia {
    /// None: the unknown is in equilibrium with the others at all times.
    #[default]
    None,
    /// A mass m, in kg, of a point; or the moment of inertia, in kg m², of an angle: ρ I_p times the length of a rod
    /// for its twist.
    Mass(f64),
    /// The inertia tensor of a rigid body about its centre of mass, in kg m², in the body's frame: that in space is R J
    /// Rᵀ.
    Tensor(Block<f64>),
}

/// Checks that each unknown has an inertia of its kind.
pub(super) fn check(body: &MixedBody, inertia: &[Inertia]) -> Result<(), MixedError> {
    if inertia.len() != body.len() {
        let (what, expected, found) = ("inertias", body.len(), inertia.len());
        return Err(MixedError::WrongLength { what, expected, found });
    }
    for (unknown, given) in inertia.iter().enumerate() {
        let (fits, expected) = match (body.kind(unknown), given) {
            (_, Inertia::None) => (true, ""),
            (UnknownKind::Rotation, Inertia::Tensor(tensor)) => {
                (is_inertia(tensor), "a symmetric positive definite tensor")
            }
            (UnknownKind::Rotation, Inertia::Mass(_)) => (false, "an inertia tensor"),
            (_, Inertia::Mass(mass)) => (mass.is_finite() && *mass >= 0.0, "a finite mass of 0 or more"),
            (_, Inertia::Tensor(_)) => (false, "a mass"),
        };
        if !fits {
            return Err(MixedError::WrongInertia { unknown, expected, found: format!("{given:?}") });
        }
    }
    Ok(())
}

/// Whether a tensor is symmetric, positive definite, and invertible in double precision.
fn is_inertia(tensor: &Block<f64>) -> bool {
    let symmetric = (0..3).all(|row| (0..row).all(|column| tensor[row][column] == tensor[column][row]));
    symmetric && is_positive_definite(tensor) && inverse(tensor).is_some()
}

/// Σ ½ m ‖x − x̃‖²/τ² over flat unknowns and Σ (2/τ²) vᵀ J v over rotations, where v is the vector part of q q̃⁻¹.
///
/// x̃ and q̃ are where free motion leads within the time τ. For a small difference φ of rotations, v = φ/2: the
/// potential is ½ φᵀ J φ/τ², like that of points. Its gradient times τ is the change of momentum within the step.
#[derive(Debug)]
pub(super) struct InertialPotential {
    time: f64,
    /// The mass of each flat unknown that has one.
    masses: Vec<(u32, f64)>,
    /// Numbers of the unknowns with a mass.
    flat: Vec<Flat>,
    turning: Vec<Turning>,
}

/// Target of free motion for a number of a flat unknown.
#[derive(Clone, Copy, Debug)]
struct Flat {
    mass: f64,
    at: f64,
    /// Its position in configurations.
    number: u32,
    /// Its position in gradients.
    increment: u32,
}

/// Target of free motion for a rotation, and the inertia tensor in space there.
#[derive(Clone, Copy, Debug)]
struct Turning {
    unknown: usize,
    tensor: Block<f64>,
    at: Quaternion,
}

impl InertialPotential {
    /// Creates the potential of a step of length `time` from u with these rates. `reference` is the time, as a fraction
    /// of the step, at which the inertia tensor gives the angular velocity: ½ is the midpoint rule.
    pub(super) fn new(
        body: &MixedBody,
        inertia: &[Inertia],
        (u, rates): (&[f64], &[f64]),
        time: f64,
        reference: f64,
    ) -> Self {
        let (mut masses, mut flat, mut turning) = (Vec::new(), Vec::new(), Vec::new());
        let free = body.all().iter().zip(inertia).enumerate().filter(|(_, (unknown, _))| !unknown.fixed);
        for (number, (unknown, inertia)) in free {
            let (u, rates) = (&u[unknown.number..], &rates[unknown.increment..]);
            match *inertia {
                Inertia::None => {}
                Inertia::Mass(mass) => {
                    masses.push((index(number), mass));
                    flat.extend((0..unknown.kind.increments()).map(|i| Flat {
                        mass,
                        at: u[i] + time * rates[i],
                        number: index(unknown.number + i),
                        increment: index(unknown.increment + i),
                    }));
                }
                Inertia::Tensor(tensor) => {
                    let (q, rate) = (std::array::from_fn(|i| u[i]), std::array::from_fn(|i| rates[i]));
                    let at = free_rotation(&tensor, q, rate, time, reference);
                    turning.push(Turning { unknown: number, tensor: rotation::turned(&tensor, at), at });
                }
            }
        }
        Self { time, masses, flat, turning }
    }

    /// Returns the energy.
    pub(super) fn energy(&self, body: &MixedBody, u: &[f64]) -> MixedEnergy {
        let mut sum = EnergySum::default();
        let squared = self.time * self.time;
        let factor = 0.5 / squared;
        for flat in &self.flat {
            let moved = flat.moved(u);
            sum.add(factor * flat.mass * moved * moved);
        }
        for Turning { unknown, tensor, at } in &self.turning {
            let (_, v) = difference(&u[body.first_number(*unknown)..], *at);
            sum.add(2.0 * dot(v, times(tensor, v)) / squared);
        }
        sum.energy()
    }

    /// Adds the gradient.
    pub(super) fn add_gradient(&self, body: &MixedBody, u: &[f64], gradient: &mut [f64]) {
        let squared = self.time * self.time;
        let factor = 1.0 / squared;
        for flat in &self.flat {
            gradient[flat.increment as usize] += factor * flat.mass * flat.moved(u);
        }
        for Turning { unknown, tensor, at } in &self.turning {
            let (w, v) = difference(&u[body.first_number(*unknown)..], *at);
            let (g, product) = (derivative(w, v), times(tensor, v));
            let own = &mut gradient[body.first_increment(*unknown)..][..3];
            for (i, sum) in own.iter_mut().enumerate() {
                *sum += 4.0 * (0..3).map(|k| g[k][i] * product[k]).sum::<f64>() / squared;
            }
        }
    }

    /// Adds the Hessian. A `curvature` other than exact leaves out the only term that may be negative, −¼ (vᵀ J v) 1.
    pub(super) fn add_hessian(
        &self,
        body: &MixedBody,
        u: &[f64],
        curvature: Curvature,
        rows: &Rows,
        matrix: &mut BorderedMatrix,
    ) {
        let squared = self.time * self.time;
        let row = |unknown: usize| rows.of[unknown].expect("a fixed unknown has no prediction") as usize;
        for &(unknown, mass) in &self.masses {
            let (row, entry) = (row(unknown as usize), mass / squared);
            matrix.kinds.add(row, row, |i, j| if i == j { entry } else { 0.0 });
        }
        for Turning { unknown, tensor, at } in &self.turning {
            let (w, v) = difference(&u[body.first_number(*unknown)..], *at);
            let g = derivative(w, v);
            let along = if curvature == Curvature::Exact { 0.25 * dot(v, times(tensor, v)) } else { 0.0 };
            let column = |j: usize| [g[0][j], g[1][j], g[2][j]];
            let entry = |i: usize, j: usize| {
                // Symmetric bit by bit.
                let square = dot(column(i.min(j)), times(tensor, column(i.max(j))));
                4.0 * (square - if i == j { along } else { 0.0 }) / squared
            };
            matrix.kinds.add(row(*unknown), row(*unknown), entry);
        }
    }

    /// Returns the rates at the end of a step that lasts `time` and whose forces are those at the minimum: the rates
    /// before, plus the impulse over the inertia. Unknowns without inertia get their mean rate.
    pub(super) fn rates_after(
        &self,
        body: &MixedBody,
        inertia: &[Inertia],
        (before, rates): (&[f64], &[f64]),
        (minimum, end): (&[f64], &[f64]),
        time: f64,
    ) -> Vec<f64> {
        let mut after = mean_rates(body, before, end, time);
        let mut impulse = vec![0.0; body.increments()];
        self.add_gradient(body, minimum, &mut impulse);
        impulse.iter_mut().for_each(|entry| *entry *= time);
        for flat in self.flat.iter().filter(|flat| flat.mass > 0.0) {
            let i = flat.increment as usize;
            after[i] = rates[i] + impulse[i] / flat.mass;
        }
        for &Turning { unknown, .. } in &self.turning {
            let (number, first) = (body.first_number(unknown), body.first_increment(unknown));
            if let Inertia::Tensor(tensor) = inertia[unknown] {
                let q = |u: &[f64]| std::array::from_fn(|i| u[number + i]);
                let rate = std::array::from_fn(|i| rates[first + i]);
                let momentum = times(&rotation::turned(&tensor, q(before)), rate);
                let momentum = std::array::from_fn(|i| momentum[i] + impulse[first + i]);
                after[first..first + 3].copy_from_slice(&angular_velocity(&tensor, q(end), momentum));
            }
        }
        after
    }
}

impl Flat {
    /// Returns x − x̃.
    fn moved(&self, u: &[f64]) -> f64 {
        u[self.number as usize] - self.at
    }
}

/// Returns the moves from one configuration to another over the time between them.
pub(super) fn mean_rates(body: &MixedBody, from: &[f64], to: &[f64], time: f64) -> Vec<f64> {
    let mut rates = vec![0.0; body.increments()];
    for unknown in body.all() {
        let (from, to) = (&from[unknown.number..], &to[unknown.number..]);
        let rates = &mut rates[unknown.increment..][..unknown.kind.increments()];
        if unknown.kind == UnknownKind::Rotation {
            let [from, to]: [Quaternion; 2] = [from, to].map(|q| std::array::from_fn(|i| q[i]));
            let turn = rotation::logarithm(rotation::product(to, rotation::inverse(from)));
            rates.iter_mut().zip(turn).for_each(|(rate, turn)| *rate = turn / time);
        } else {
            rates.iter_mut().zip(from).zip(to).for_each(|((rate, from), to)| *rate = (to - from) / time);
        }
    }
    rates
}

/// Returns the scalar part and the vector part of q q̃⁻¹.
fn difference(q: &[f64], at: Quaternion) -> (f64, Vector3<f64>) {
    let [w, x, y, z] = rotation::product(std::array::from_fn(|i| q[i]), rotation::inverse(at));
    (w, [x, y, z])
}

/// Returns ∂v/∂δ = ½ (w 1 − [v]×) of the vector part of exp(δ) d.
fn derivative(w: f64, [x, y, z]: Vector3<f64>) -> Block<f64> {
    [[w, z, -y], [-z, w, x], [y, -x, w]].map(|row| row.map(|entry| 0.5 * entry))
}

/// Returns where a rotation without torque is after some time: exp(t ω) q, where the angular momentum is R J Rᵀ ω at
/// the reference. Solved by fixed-point iteration, which contracts while the turn is well below a radian.
fn free_rotation(tensor: &Block<f64>, q: Quaternion, rate: Vector3<f64>, time: f64, reference: f64) -> Quaternion {
    let momentum = times(&rotation::turned(tensor, q), rate);
    let mut mean = rate;
    for _ in 0..50 {
        let at = rotation::moved(q, mean.map(|c| reference * time * c));
        let next = angular_velocity(tensor, at, momentum);
        let change = rotation::length(std::array::from_fn(|i| next[i] - mean[i]));
        mean = next;
        if change <= 1e-15 * rotation::length(mean) {
            break;
        }
    }
    rotation::moved(q, mean.map(|c| time * c))
}

/// Returns (R J Rᵀ)⁻¹ ℓ.
fn angular_velocity(tensor: &Block<f64>, q: Quaternion, momentum: Vector3<f64>) -> Vector3<f64> {
    let inverse = inverse(tensor).expect("tensors were checked");
    times(&rotation::turned(&inverse, q), momentum)
}

fn times(matrix: &Block<f64>, v: Vector3<f64>) -> Vector3<f64> {
    matrix.map(|row| dot(row, v))
}

fn dot(a: Vector3<f64>, b: Vector3<f64>) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mixed::MixedSystem;

    #[test]
    fn derivatives_are_those_of_the_energy() {
        let body = MixedBody::new(&[UnknownKind::Rotation, UnknownKind::Vector2], 1.0);
        let inertia = [Inertia::Tensor([[1.0, 0.2, 0.0], [0.2, 2.0, 0.1], [0.0, 0.1, 3.0]]), Inertia::Mass(0.7)];
        let (start, rates) = ([0.6, 0.0, 0.8, 0.0, 1.0, -1.0], [0.3, 1.0, -0.5, 0.2, 0.4]);
        let potential = InertialPotential::new(&body, &inertia, (&start, &rates), 0.5, 0.5);
        let u = body.moved(&start, 1.0, &[0.5, -0.2, 0.7, 0.3, 0.1]);
        let system = MixedSystem::new(body.clone(), Vec::new()).unwrap();
        let mut matrix = system.matrix();
        potential.add_hessian(&body, &u, Curvature::Exact, system.rows(), &mut matrix);
        let mut gradient = [0.0; 5];
        potential.add_gradient(&body, &u, &mut gradient);
        let at = |i: usize, by_i: f64, j: usize, by_j: f64| {
            let mut delta = [0.0; 5];
            delta[i] += by_i;
            delta[j] += by_j;
            potential.energy(&body, &body.moved(&u, 1.0, &delta)).value
        };
        let h = 1e-3;
        for i in 0..5 {
            let slope = (at(i, h, i, 0.0) - at(i, -h, i, 0.0)) / (2.0 * h);
            assert!((slope - gradient[i]).abs() < 1e-5, "{i}: {slope} against {}", gradient[i]);
            let (mut unit, mut column) = ([0.0; 5], [0.0; 5]);
            unit[i] = 1.0;
            matrix.multiply(&system.free_part(&unit), &mut column);
            let column = system.spread(&column);
            for j in 0..5 {
                let second = (at(i, h, j, h) - at(i, h, j, -h) - at(i, -h, j, h) + at(i, -h, j, -h)) / (4.0 * h * h);
                assert!((second - column[j]).abs() < 1e-4, "({i}, {j}): {second} against {}", column[j]);
            }
        }
    }
}
