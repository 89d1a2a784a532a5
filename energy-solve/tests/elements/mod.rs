//! Two elements written by hand, so that assembly and solvers are tested apart from generated code.

use energy_dsl::{
    Block, Declaration, Element, Field, Flags, ForceJacobians, ForceLaw, ForceValue, Gradient, Hessian, Inputs, Kind,
    Outputs, Potential, Real, RestError, Value, Vector3,
};

const fn declaration(name: &'static str, kind: Kind, formula: &'static str, rows: usize) -> Declaration {
    const POINT: Field = Field { name: "p", size: 3, unit: "m" };
    Declaration {
        name,
        kind,
        docs: "",
        formula,
        source: "",
        points: &[POINT, POINT],
        rest: &[],
        parameters: &[],
        rows,
        properties: &[],
        translation_invariant: true,
        curved: true,
        velocity_dependent: matches!(kind, Kind::Force),
        symmetric: matches!(kind, Kind::Energy),
        reduced_coordinates: 3,
        reduced_vectors: &[&[(0, true), (1, false)]],
        primitives: &[],
        routines: &[],
    }
}

fn difference(points: &[Vector3<f64>; 2]) -> Vector3<f64> {
    std::array::from_fn(|axis| points[0][axis] - points[1][axis])
}

fn length(d: &Vector3<f64>) -> f64 {
    (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt()
}

fn block(entry: impl Fn(usize, usize) -> f64) -> Block<f64> {
    std::array::from_fn(|row| std::array::from_fn(|column| entry(row, column)))
}

fn delta(row: usize, column: usize) -> f64 {
    f64::from(row == column)
}

/// U = ½ k (‖p − q‖ − L)².
#[derive(Clone, Copy, Debug)]
pub(crate) struct Spring {
    pub(crate) stiffness: f64,
    pub(crate) length: f64,
}

impl Element for Spring {
    const DECLARATION: &'static Declaration = &declaration("Spring", Kind::Energy, "k/2 (‖p − q‖ − L)²", 1);
    type Over<T: Real> = Self;

    fn evaluate<T: Real>(_: &Inputs<'_, T>) -> Result<Outputs<T>, RestError> {
        Err(RestError { element: "Spring" })
    }
}

impl Potential<f64> for Spring {
    type Points = [Vector3<f64>; 2];
    type Triangle = [Block<f64>; 3];

    fn value(&self, x: &Self::Points) -> Value<f64> {
        let stretch = length(&difference(x)) - self.length;
        Value { value: 0.5 * self.stiffness * stretch * stretch, flags: Flags::clear() }
    }

    fn gradient(&self, x: &Self::Points) -> Gradient<f64, Self::Points> {
        let d = difference(x);
        let r = length(&d);
        let g = d.map(|component| self.stiffness * (r - self.length) * component / r);
        Gradient { value: self.value(x).value, gradient: [g, g.map(|component| -component)], flags: Flags::clear() }
    }

    fn hessian(&self, x: &Self::Points) -> Hessian<f64, Self::Points, Self::Triangle> {
        let d = difference(x);
        let r = length(&d);
        let (k, l) = (self.stiffness, self.length);
        let near = block(|i, j| k * ((1.0 - l / r) * delta(i, j) + l / r * d[i] * d[j] / (r * r)));
        let far = near.map(|row| row.map(|entry| -entry));
        let Gradient { value, gradient, flags } = self.gradient(x);
        Hessian { value, gradient, hessian: [near, far, near], flags }
    }
}

/// f on p: −c ‖d‖² w − d (e·w), with d = p − q, w the difference of velocities and a fixed e: neither Jacobian is symmetric.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Damper {
    pub(crate) c: f64,
    pub(crate) e: Vector3<f64>,
}

impl Element for Damper {
    const DECLARATION: &'static Declaration = &declaration("Damper", Kind::Force, "−c ‖d‖² w − d (e·w)", 6);
    type Over<T: Real> = Self;

    fn evaluate<T: Real>(_: &Inputs<'_, T>) -> Result<Outputs<T>, RestError> {
        Err(RestError { element: "Damper" })
    }
}

impl ForceLaw<f64> for Damper {
    type Points = [Vector3<f64>; 2];
    type Square = [Block<f64>; 4];

    fn force(&self, x: &Self::Points, v: &Self::Points) -> ForceValue<f64, Self::Points> {
        let (d, w) = (difference(x), difference(v));
        let along = self.e[0] * w[0] + self.e[1] * w[1] + self.e[2] * w[2];
        let f: Vector3<f64> = std::array::from_fn(|axis| -self.c * length(&d).powi(2) * w[axis] - d[axis] * along);
        ForceValue { force: [f, f.map(|component| -component)], flags: Flags::clear() }
    }

    fn jacobians(&self, x: &Self::Points, v: &Self::Points) -> ForceJacobians<f64, Self::Points, Self::Square> {
        let (d, w) = (difference(x), difference(v));
        let along = self.e[0] * w[0] + self.e[1] * w[1] + self.e[2] * w[2];
        let by_x = block(|i, j| -2.0 * self.c * w[i] * d[j] - along * delta(i, j));
        let by_v = block(|i, j| -self.c * length(&d).powi(2) * delta(i, j) - d[i] * self.e[j]);
        let square = |near: Block<f64>| {
            let far = near.map(|row| row.map(|entry| -entry));
            [near, far, far, near]
        };
        let ForceValue { force, flags } = self.force(x, v);
        ForceJacobians { force, by_position: square(by_x), by_velocity: square(by_v), flags }
    }
}
