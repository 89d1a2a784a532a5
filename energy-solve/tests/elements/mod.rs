//! Elements written by hand, to test assembly and solvers independently of generated code.

pub(crate) mod jets;
pub(crate) mod mixed;

use std::borrow::Cow::Borrowed;

use energy_dsl::{
    Baseline, Block, Declaration, Element, Field, FieldKind, Flags, ForceJacobians, ForceLaw, ForceValue, Gradient,
    Hessian, Inputs, Kind, Lane, Level, Outputs, PackedPotential, Potential, Real, ReducedHessian, ReducedPotential,
    RestError, Stored, Value, Vector3,
};

const fn declaration(
    name: &'static str,
    kind: Kind,
    formula: &'static str,
    rows: usize,
    quadratic: bool,
) -> Declaration {
    const POINT: Field =
        Field { name: Borrowed("p"), kind: FieldKind::Point, shared: false, size: 3, entries: 1, unit: Borrowed("m") };
    Declaration {
        name: Borrowed(name),
        kind,
        docs: Borrowed(""),
        formula: Borrowed(formula),
        source: Borrowed(""),
        points: Borrowed(&[POINT, POINT]),
        rest: Borrowed(&[]),
        parameters: Borrowed(&[]),
        state: Borrowed(&[]),
        rows,
        properties: Borrowed(&[]),
        translation_invariant: true,
        curved: true,
        quadratic,
        velocity_dependent: matches!(kind, Kind::Force),
        symmetric: matches!(kind, Kind::Energy),
        reduced_coordinates: 3,
        reduced_vectors: Borrowed(&[Borrowed(&[(0, 1.0), (1, -1.0)])]),
        dihedral: None,
        primitives: Borrowed(&[]),
        routines: Borrowed(&[]),
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

/// U = ½ k (‖p − q‖ − L)² without guards: coincident ends divide by zero. `SLACK` springs are declared quadratic and
/// must have L = 0.
#[derive(Clone, Copy, Debug)]
pub(crate) struct AnySpring<T, const SLACK: bool> {
    pub(crate) stiffness: T,
    pub(crate) length: T,
}

pub(crate) type Spring<T = f64> = AnySpring<T, false>;

impl<T: Real, const SLACK: bool> AnySpring<T, SLACK> {
    /// Returns d, ‖d‖ and the elongation.
    fn state(&self, [p, q]: &[Vector3<T>; 2]) -> (Vector3<T>, T, T) {
        let d = [p[0] - q[0], p[1] - q[1], p[2] - q[2]];
        let r = (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt();
        (d, r, r - self.length)
    }
}

impl<T: Real, const SLACK: bool> Element for AnySpring<T, SLACK> {
    const DECLARATION: &'static Declaration = &declaration("Spring", Kind::Energy, "k/2 (‖p − q‖ − L)²", 1, SLACK);
    type Over<R: Real> = AnySpring<R, SLACK>;

    fn evaluate<R: Real>(_: &Inputs<'_, R>) -> Result<Outputs<R>, RestError> {
        Err(RestError { element: "Spring".into() })
    }
}

impl<T: Real, const SLACK: bool> Potential<T> for AnySpring<T, SLACK> {
    type Points = [Vector3<T>; 2];
    type Triangle = [Block<T>; 3];

    fn value(&self, x: &Self::Points) -> Value<T> {
        let (_, _, stretch) = self.state(x);
        Value { value: T::from_f64(0.5) * self.stiffness * stretch * stretch, flags: Flags::clear() }
    }

    fn gradient(&self, x: &Self::Points) -> Gradient<T, Self::Points> {
        let (d, r, stretch) = self.state(x);
        let g = d.map(|component| self.stiffness * stretch * component / r);
        Gradient { value: self.value(x).value, gradient: [g, g.map(|component| -component)], flags: Flags::clear() }
    }

    fn hessian(&self, x: &Self::Points) -> Hessian<T, Self::Points, Self::Triangle> {
        Self::expand::<Baseline, { u32::MAX }>(&self.reduced_hessian(x))
    }
}

impl<T: Real, const SLACK: bool> ReducedPotential<T> for AnySpring<T, SLACK> {
    type Coordinates = [T; 3];
    type Upper = [T; 6];

    fn reduced_hessian(&self, x: &Self::Points) -> ReducedHessian<T, [T; 3], [T; 6]> {
        let (d, r, stretch) = self.state(x);
        let Gradient { value, gradient, flags } = self.gradient(x);
        let (across, part) = (self.stiffness * stretch / r, self.stiffness * self.length / (r * r * r));
        let entry = |i: usize, j: usize| {
            let along = part * d[i] * d[j];
            if i == j { along + across } else { along }
        };
        let hessian = [entry(0, 0), entry(0, 1), entry(0, 2), entry(1, 1), entry(1, 2), entry(2, 2)];
        ReducedHessian { value, gradient: gradient[0], hessian, flags }
    }

    fn expand<L: Level, const FREE: u32>(
        reduced: &ReducedHessian<T, [T; 3], [T; 6]>,
    ) -> Hessian<T, Self::Points, Self::Triangle> {
        let [xx, xy, xz, yy, yz, zz] = reduced.hessian;
        let near = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]];
        let far = near.map(|row| row.map(|entry| -entry));
        let gradient = [reduced.gradient, reduced.gradient.map(|component| -component)];
        Hessian { value: reduced.value, gradient, hessian: [near, far, near], flags: reduced.flags }
    }
}

impl<const SLACK: bool> Stored<f64> for AnySpring<f64, SLACK> {
    const NUMBERS: usize = 2;

    fn store(&self, numbers: &mut [f64], stride: usize) {
        numbers[0] = self.stiffness;
        numbers[stride] = self.length;
    }
}

impl<const SLACK: bool> PackedPotential<f64> for AnySpring<f64, SLACK> {
    type Wide<V: Lane<f64>> = AnySpring<V, SLACK>;

    fn load<V: Lane<f64>>(numbers: &[f64], stride: usize) -> AnySpring<V, SLACK> {
        AnySpring { stiffness: V::load(numbers), length: V::load(&numbers[stride..]) }
    }
}

/// f on p: −c ‖d‖² w − d (e·w), with d = p − q, the velocity difference w, and a fixed e. Neither Jacobian is
/// symmetric.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Damper {
    pub(crate) c: f64,
    pub(crate) e: Vector3<f64>,
}

impl Element for Damper {
    const DECLARATION: &'static Declaration = &declaration("Damper", Kind::Force, "−c ‖d‖² w − d (e·w)", 6, false);
    type Over<T: Real> = Self;

    fn evaluate<T: Real>(_: &Inputs<'_, T>) -> Result<Outputs<T>, RestError> {
        Err(RestError { element: "Damper".into() })
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
