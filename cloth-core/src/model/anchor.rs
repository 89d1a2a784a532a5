use energy_dsl::{Potential, Vector3};
use energy_elements::ZeroLengthSpring;
use energy_solve::{Character, Linearisation, State};

use crate::geometry::dot;

/// A spring of rest length 0 between a vertex and a place that no force moves. It changes only the diagonal block of
/// its vertex.
#[derive(Clone, Copy, Debug)]
pub struct Anchor {
    /// Index of the vertex within the island.
    pub vertex: usize,
    /// Slot of the diagonal block of the vertex.
    pub slot: usize,
    /// The place, in m.
    pub place: Vector3<f64>,
    /// The spring, with its stiffness.
    pub spring: ZeroLengthSpring,
}

impl Anchor {
    /// The character of a term of anchors.
    pub const CHARACTER: Character =
        Character { symmetric: true, velocity_dependent: false, quadratic: false, curved: true };

    /// Returns the energy, in J.
    #[must_use]
    pub fn energy(&self, x: &[Vector3<f64>]) -> f64 {
        self.spring.value(&[x[self.vertex], self.place]).value
    }

    /// Adds the force on the vertex, in N.
    pub fn add_force(&self, x: &[Vector3<f64>], force: &mut [Vector3<f64>]) {
        let gradient = self.spring.gradient(&[x[self.vertex], self.place]).gradient[0];
        (0..3).for_each(|axis| force[self.vertex][axis] -= gradient[axis]);
    }

    /// Adds the force and its Jacobian. The Hessian is positive semi-definite, so projection changes nothing.
    pub fn add_linearisation(&self, State { x, v }: State<'_>, sum: &mut Linearisation<'_>) {
        let vertex = self.vertex;
        let result = self.spring.hessian(&[x[vertex], self.place]);
        let block = result.hessian.as_ref()[0];
        sum.matrix.add(self.slot, -sum.weights.position, &block);
        for axis in 0..3 {
            sum.force[vertex][axis] -= result.gradient[0][axis];
            if let Some(product) = &mut sum.stiffness_times_velocity {
                product[vertex][axis] -= dot(block[axis], v[vertex]);
            }
        }
    }
}
