use energy_dsl::Vector3;
use energy_solve::{State, System};

/// The state of a cloth, with the forces on it.
#[derive(Debug)]
pub struct Body {
    /// Positions, in m.
    pub x: Vec<Vector3<f64>>,
    /// Velocities, in m/s. For a pinned vertex, the velocity of its pin.
    pub v: Vec<Vector3<f64>>,
    /// Masses, in kg.
    pub masses: Vec<f64>,
    /// The forces on all vertices; pinned vertices do not respond to them.
    pub system: System,
}

impl Body {
    /// Positions and velocities, as the solver takes them.
    #[must_use]
    pub fn state(&self) -> State<'_> {
        State { x: &self.x, v: &self.v }
    }

    /// Kinetic energy ½ Σ m v² of the free vertices, in J.
    #[must_use]
    pub fn kinetic_energy(&self) -> f64 {
        let square = |v: &Vector3<f64>| v.iter().map(|component| component * component).sum::<f64>();
        self.system.dofs().free().iter().map(|&vertex| 0.5 * self.masses[vertex] * square(&self.v[vertex])).sum()
    }

    /// Momentum Σ m v of the free vertices, in kg m/s.
    #[must_use]
    pub fn momentum(&self) -> Vector3<f64> {
        self.sum(|_, v| v)
    }

    /// Angular momentum Σ m x × v of the free vertices about the origin, in kg m²/s.
    #[must_use]
    pub fn angular_momentum(&self) -> Vector3<f64> {
        self.sum(crate::geometry::cross)
    }

    fn sum(&self, of: impl Fn(Vector3<f64>, Vector3<f64>) -> Vector3<f64>) -> Vector3<f64> {
        let mut total = [0.0; 3];
        for &vertex in self.system.dofs().free() {
            let part = of(self.x[vertex], self.v[vertex]);
            for axis in 0..3 {
                total[axis] += self.masses[vertex] * part[axis];
            }
        }
        total
    }
}
