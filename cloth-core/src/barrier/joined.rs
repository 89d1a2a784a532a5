use std::cell::RefCell;

use energy_dsl::{Potential, Vector3};
use energy_elements::DistanceBarrier;

use super::spacing::Spacing;
use crate::collision::{Closest, Measured, Pair};

/// Stiffness of the barrier at half the gap over the resistance of the vertices. Factors from 3 to 30 need about the
/// same number of iterations.
pub(crate) const STIFFNESS_RATIO: f64 = 10.0;
/// β″(½).
pub(crate) const CURVATURE_AT_HALF: f64 = 6.386_294_361_119_89;

/// The pairs in contact, or close to it, in order.
#[derive(Debug, Default)]
pub(super) struct Joined {
    pub pairs: Vec<Pair>,
    pub laws: Vec<Law>,
    /// The pairs where they were last evaluated.
    measured: RefCell<Measured>,
}

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

impl Joined {
    pub fn clear(&mut self) {
        self.pairs.clear();
        self.laws.clear();
        self.measured.get_mut().clear();
    }

    /// Adds pairs that are not yet here.
    pub fn extend(&mut self, added: impl Iterator<Item = (Pair, Law)>) {
        let known = std::mem::take(&mut self.pairs).into_iter().zip(std::mem::take(&mut self.laws));
        let mut all: Vec<(Pair, Law)> = known.chain(added).collect();
        // Two runs in order are merged in linear time.
        all.sort_by_key(|(pair, _)| *pair);
        (self.pairs, self.laws) = all.into_iter().unzip();
        self.measured.get_mut().clear();
    }

    pub fn contains(&self, pair: &Pair) -> bool {
        self.pairs.binary_search(pair).is_ok()
    }

    /// Calls `evaluate` with each pair that has an energy at x, its law and its closest points.
    pub fn for_each_active(&self, x: &[Vector3<f64>], mut evaluate: impl FnMut(&Pair, Law, &Closest)) {
        let mut measured = self.measured.borrow_mut();
        measured.measure(&self.pairs, x, 1);
        for (number, (pair, law)) in self.pairs.iter().zip(&self.laws).enumerate() {
            let closest = measured.closest(number);
            if law.apart(&closest) < law.gap {
                evaluate(pair, *law, &closest);
            }
        }
    }
}

impl Law {
    /// The law of a pair with this spacing, and this resistance to a displacement along its normal, in N/m.
    pub fn new(Spacing { thickness, gap }: Spacing, resistance: f64) -> Self {
        Self { thickness, gap, stiffness: STIFFNESS_RATIO / CURVATURE_AT_HALF * resistance }
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

    /// The stiffness along the normal at a distance of the surfaces, in N/m.
    pub fn curvature(self, apart: f64) -> f64 {
        self.barrier().hessian(&between(apart)).hessian.as_ref()[0][0][0]
    }

    /// The barrier as a function of the vector between the surfaces.
    fn barrier(self) -> DistanceBarrier {
        DistanceBarrier::new(self.stiffness, self.gap)
    }
}

/// Two points at this distance.
fn between(apart: f64) -> [Vector3<f64>; 2] {
    [[apart, 0.0, 0.0], [0.0; 3]]
}
