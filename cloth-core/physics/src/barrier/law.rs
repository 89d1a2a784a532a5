//! The barrier of each pair, in lanes.

use energy_dsl::{Kernel, Lane, Level, Potential, Real, Vector3, dispatch};
use energy_elements::DistanceBarrier;

use super::spacing::Spacing;
use crate::collision::{Closest, MeasuredPart};

/// Stiffness of the barrier at half the gap over the resistance of the vertices. Factors from 3 to 30 need about the
/// same number of iterations.
pub const STIFFNESS_RATIO: f64 = 10.0;
/// β″(½).
pub const CURVATURE_AT_HALF: f64 = 6.386_294_361_119_89;

/// The barrier of a pair.
#[derive(Clone, Copy, Debug)]
pub(super) struct Law {
    /// ξ, in m.
    thickness: f64,
    /// The activation gap g, in m.
    gap: f64,
    /// K/g², in N/m.
    pub stiffness: f64,
}

/// A barrier at a distance of the surfaces. Quantities that were not requested are zero.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Barrier {
    /// The energy, in J; infinite where the surfaces touch.
    pub energy: f64,
    /// The normal force, in N.
    pub force: f64,
    /// The stiffness along the normal, in N/m.
    pub curvature: f64,
}

/// The quantities to evaluate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Order {
    Energy,
    Force,
    Curvature,
}

impl Law {
    /// The law of a pair with this spacing, and this resistance to a displacement along its normal, in N/m.
    pub fn new(Spacing { thickness, gap }: Spacing, resistance: f64) -> Self {
        Self { thickness, gap, stiffness: STIFFNESS_RATIO / CURVATURE_AT_HALF * resistance }
    }

    /// Whether the barrier acts at a distance of the pair, in m.
    pub fn is_active(self, distance: f64) -> bool {
        distance - self.thickness < self.gap
    }

    /// The distance of the surfaces, in m.
    pub fn apart(self, closest: &Closest) -> f64 {
        closest.distance - self.thickness
    }

    /// The energy at a distance of the surfaces, in J.
    pub fn energy(self, apart: f64) -> f64 {
        if apart >= self.gap {
            0.0
        } else if apart > 0.0 {
            self.barrier().value(&between(apart)).value
        } else {
            f64::INFINITY
        }
    }

    /// The normal force at a distance of the surfaces, in N.
    pub fn force(self, apart: f64) -> f64 {
        if apart < self.gap { -self.barrier().gradient(&between(apart)).gradient[0][0] } else { 0.0 }
    }

    /// The barrier as a function of the vector between the surfaces.
    fn barrier(self) -> DistanceBarrier {
        DistanceBarrier::new(self.stiffness, self.gap)
    }
}

/// Two points at this distance.
fn between<V: Real>(apart: V) -> [Vector3<V>; 2] {
    let zero = V::from_f64(0.0);
    [[apart, zero, zero], [zero; 3]]
}

/// Evaluates the barriers of some of the pairs with these laws, where they were measured.
pub(super) fn evaluate(order: Order, laws: &[Law], measured: MeasuredPart<'_>, numbers: &[usize]) -> Vec<Barrier> {
    let mut barriers = vec![Barrier::default(); numbers.len()];
    dispatch(Evaluation { order, laws, measured, numbers, barriers: &mut barriers });
    barriers
}

struct Evaluation<'a> {
    order: Order,
    laws: &'a [Law],
    measured: MeasuredPart<'a>,
    numbers: &'a [usize],
    barriers: &'a mut [Barrier],
}

impl Kernel for Evaluation<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Level>(self) {
        let Self { order, laws, measured, numbers, barriers } = self;
        let lanes = L::F64::LANES;
        for (numbers, barriers) in numbers.chunks(lanes).zip(barriers.chunks_mut(lanes)) {
            let (mut stiffness, mut gap, mut apart) = ([0.0; 16], [0.0; 16], [0.0; 16]);
            for lane in 0..lanes {
                // Lanes beyond the end repeat the last pair.
                let number = numbers[lane.min(numbers.len() - 1)];
                let law = laws[number];
                (stiffness[lane], gap[lane]) = (law.stiffness, law.gap);
                apart[lane] = (measured.distance(number) - law.thickness).max(0.0);
            }
            let element = DistanceBarrier::new(L::F64::load(&stiffness), L::F64::load(&gap));
            let apart = L::F64::load(&apart);
            let mut results = [[0.0; 16]; 3];
            let [energy, force, curvature] = &mut results;
            match order {
                Order::Energy => element.value(&between(apart)).value.store(energy),
                Order::Force => (-element.gradient(&between(apart)).gradient[0][0]).store(force),
                Order::Curvature => {
                    let found = element.hessian(&between(apart));
                    (-found.gradient[0][0]).store(force);
                    found.hessian.as_ref()[0][0][0].store(curvature);
                }
            }
            let [energy, force, curvature] = results;
            for (lane, barrier) in barriers.iter_mut().enumerate() {
                *barrier = Barrier { energy: energy[lane], force: force[lane], curvature: curvature[lane] };
            }
        }
    }
}
