//! Elements of mixed unknowns from formulas over jets: numbers with first and second derivatives.

use std::borrow::Cow::Borrowed;
use std::ops::{Add, Mul, Neg, Sub};

use energy_dsl::{Declaration, Field, FieldKind, Kind, Real};

/// A number with its derivatives by D increments.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Jet<T, const D: usize> {
    pub(crate) value: T,
    pub(crate) gradient: [T; D],
    pub(crate) hessian: [[T; D]; D],
}

impl<T: Real, const D: usize> Jet<T, D> {
    pub(crate) fn constant(value: T) -> Self {
        let zero = T::from_f64(0.0);
        Self { value, gradient: [zero; D], hessian: [[zero; D]; D] }
    }

    fn increment(value: T, index: usize) -> Self {
        let mut jet = Self::constant(value);
        jet.gradient[index] = T::from_f64(1.0);
        jet
    }

    /// Returns f of it, from f and its first two derivatives.
    fn mapped(self, [f, first, second]: [T; 3]) -> Self {
        let entry = |i: usize, j: usize| first * self.hessian[i][j] + second * self.gradient[i] * self.gradient[j];
        Self {
            value: f,
            gradient: self.gradient.map(|g| first * g),
            hessian: std::array::from_fn(|i| std::array::from_fn(|j| entry(i, j))),
        }
    }

    pub(crate) fn sqrt(self) -> Self {
        let root = self.value.sqrt();
        let first = T::from_f64(0.5) / root;
        self.mapped([root, first, -first / (self.value + self.value)])
    }

    pub(crate) fn times(self, factor: f64) -> Self {
        self * Self::constant(T::from_f64(factor))
    }
}

impl<T: Real, const D: usize> Add for Jet<T, D> {
    type Output = Self;

    fn add(self, other: Self) -> Self {
        Self {
            value: self.value + other.value,
            gradient: std::array::from_fn(|i| self.gradient[i] + other.gradient[i]),
            hessian: std::array::from_fn(|i| std::array::from_fn(|j| self.hessian[i][j] + other.hessian[i][j])),
        }
    }
}

impl<T: Real, const D: usize> Neg for Jet<T, D> {
    type Output = Self;

    fn neg(self) -> Self {
        Self {
            value: -self.value,
            gradient: self.gradient.map(|g| -g),
            hessian: self.hessian.map(|row| row.map(|entry| -entry)),
        }
    }
}

impl<T: Real, const D: usize> Sub for Jet<T, D> {
    type Output = Self;

    fn sub(self, other: Self) -> Self {
        self + -other
    }
}

impl<T: Real, const D: usize> Mul for Jet<T, D> {
    type Output = Self;

    #[expect(clippy::suspicious_arithmetic_impl, reason = "the product rule")]
    fn mul(self, other: Self) -> Self {
        let (a, b) = (&self, &other);
        let entry = |i: usize, j: usize| {
            // Symmetric in i and j, bit by bit.
            let mixed = a.gradient[i] * b.gradient[j] + a.gradient[j] * b.gradient[i];
            (a.value * b.hessian[i][j] + a.hessian[i][j] * b.value) + mixed
        };
        Self {
            value: a.value * b.value,
            gradient: std::array::from_fn(|i| a.value * b.gradient[i] + a.gradient[i] * b.value),
            hessian: std::array::from_fn(|i| std::array::from_fn(|j| entry(i, j))),
        }
    }
}

pub(crate) fn dot<T: Real, const D: usize>(a: [Jet<T, D>; 3], b: [Jet<T, D>; 3]) -> Jet<T, D> {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub(crate) fn minus<T: Real, const D: usize>(a: [Jet<T, D>; 3], b: [Jet<T, D>; 3]) -> [Jet<T, D>; 3] {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub(crate) fn cross<T: Real, const D: usize>(a: [Jet<T, D>; 3], b: [Jet<T, D>; 3]) -> [Jet<T, D>; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Returns q v q*.
pub(crate) fn rotated<T: Real, const D: usize>(q: [Jet<T, D>; 4], v: [Jet<T, D>; 3]) -> [Jet<T, D>; 3] {
    let axis = [q[1], q[2], q[3]];
    let twice = cross(axis, v).map(|c| c.times(2.0));
    let across = cross(axis, twice);
    std::array::from_fn(|i| v[i] + q[0] * twice[i] + across[i])
}

/// Returns the unknowns as functions of their increments: rotations as exp(δ) q up to second order.
pub(crate) fn seeds<T: Real, const U: usize, const D: usize>(fields: &[Field], u: &[T; U]) -> [Jet<T, D>; U] {
    let mut seeds = [Jet::constant(T::from_f64(0.0)); U];
    let (mut number, mut increment) = (0, 0);
    for field in fields {
        if field.kind == FieldKind::Rotation {
            let delta: [Jet<T, D>; 3] = std::array::from_fn(|i| Jet::increment(T::from_f64(0.0), increment + i));
            let scalar = Jet::constant(T::from_f64(1.0)) - dot(delta, delta).times(0.125);
            let [x, y, z] = delta.map(|d| d.times(0.5));
            let q: [Jet<T, D>; 4] = std::array::from_fn(|i| Jet::constant(u[number + i]));
            seeds[number] = scalar * q[0] - x * q[1] - y * q[2] - z * q[3];
            seeds[number + 1] = scalar * q[1] + x * q[0] + y * q[3] - z * q[2];
            seeds[number + 2] = scalar * q[2] + y * q[0] + z * q[1] - x * q[3];
            seeds[number + 3] = scalar * q[3] + z * q[0] + x * q[2] - y * q[1];
        } else {
            (0..field.size).for_each(|i| seeds[number + i] = Jet::increment(u[number + i], increment + i));
        }
        number += field.size;
        increment += field.increments();
    }
    seeds
}

pub(crate) const fn field(name: &'static str, kind: FieldKind, size: usize, shared: bool) -> Field {
    Field { name: Borrowed(name), kind, shared, size, entries: 1, unit: Borrowed("") }
}

pub(crate) const fn declared(name: &'static str, unknowns: &'static [Field], state: &'static [Field]) -> Declaration {
    Declaration {
        name: Borrowed(name),
        kind: Kind::Energy,
        docs: Borrowed(""),
        formula: Borrowed(""),
        source: Borrowed(""),
        points: Borrowed(unknowns),
        rest: Borrowed(&[]),
        parameters: Borrowed(&[]),
        state: Borrowed(state),
        rows: 1,
        properties: Borrowed(&[]),
        translation_invariant: false,
        curved: true,
        quadratic: false,
        velocity_dependent: false,
        symmetric: true,
        reduced_coordinates: 0,
        reduced_vectors: Borrowed(&[]),
        dihedral: None,
        primitives: Borrowed(&[]),
        routines: Borrowed(&[]),
    }
}

/// Defines an element of U numbers and D increments, with parameters p, from its formula.
macro_rules! mixed_element {
    ($(#[$docs:meta])* $name:ident[$U:literal, $D:literal, $upper:literal]($($parameter:ident),*)
     $declaration:expr, |$p:ident, $u:ident| $formula:expr) => {
        $(#[$docs])*
        #[derive(Clone, Copy, Debug)]
        pub(crate) struct $name<T = f64> {
            $(pub(crate) $parameter: T),*
        }

        impl<T: Real> $name<T> {
            fn jet(&self, u: &[T; $U]) -> Jet<T, $D> {
                let $p = $name { $($parameter: Jet::<T, $D>::constant(self.$parameter)),* };
                let $u: [Jet<T, $D>; $U] = seeds(&$declaration.points, u);
                $formula
            }
        }

        impl<T: Real> Element for $name<T> {
            const DECLARATION: &'static Declaration = &$declaration;
            type Over<R: Real> = $name<R>;

            fn evaluate<R: Real>(_: &Inputs<'_, R>) -> Result<Outputs<R>, RestError> {
                Err(RestError { element: stringify!($name).into() })
            }
        }

        impl<T: Real> MixedPotential<T> for $name<T> {
            type Unknowns = [T; $U];
            type Increments = [T; $D];
            type Upper = [T; $upper];

            fn value(&self, u: &[T; $U]) -> Value<T> {
                Value { value: self.jet(u).value, flags: Flags::clear() }
            }

            fn value_at<L: Level>(&self, u: &[T; $U]) -> Value<T> {
                self.value(u)
            }

            fn gradient(&self, u: &[T; $U]) -> MixedGradient<T, [T; $D]> {
                let Jet { value, gradient, .. } = self.jet(u);
                MixedGradient { value, gradient, flags: Flags::clear() }
            }

            fn gradient_at<L: Level>(&self, u: &[T; $U]) -> MixedGradient<T, [T; $D]> {
                self.gradient(u)
            }

            fn hessian(&self, u: &[T; $U]) -> MixedHessian<T, [T; $D], [T; $upper]> {
                let Jet { value, gradient, hessian } = self.jet(u);
                let mut entries = (0..$D).flat_map(|i| (i..$D).map(move |j| (i, j)));
                let upper = std::array::from_fn(|_| {
                    let (i, j) = entries.next().expect("D (D + 1)/2 entries");
                    hessian[i][j]
                });
                MixedHessian { value, gradient, hessian: upper, flags: Flags::clear() }
            }

            fn hessian_at<L: Level>(&self, u: &[T; $U]) -> MixedHessian<T, [T; $D], [T; $upper]> {
                self.hessian(u)
            }

            fn hessian_vector(&self, u: &[T; $U], v: &[T; $D]) -> MixedProduct<T, [T; $D]> {
                let Jet { hessian, .. } = self.jet(u);
                let row = |i: usize| (0..$D).fold(T::from_f64(0.0), |sum, j| sum + hessian[i][j] * v[j]);
                MixedProduct { product: std::array::from_fn(row), flags: Flags::clear() }
            }

            fn hessian_vector_at<L: Level>(&self, u: &[T; $U], v: &[T; $D]) -> MixedProduct<T, [T; $D]> {
                self.hessian_vector(u, v)
            }
        }

        impl Stored<f64> for $name {
            const NUMBERS: usize = [$(stringify!($parameter)),*].len();

            fn store(&self, numbers: &mut [f64], stride: usize) {
                [$(self.$parameter),*].into_iter().enumerate().for_each(|(i, own)| numbers[i * stride] = own);
            }
        }

        impl PackedMixed<f64> for $name {
            type Wide<V: Lane<f64>> = $name<V>;

            fn load<V: Lane<f64>>(numbers: &[f64], stride: usize) -> $name<V> {
                let mut all = (0..).map(|i| V::load(&numbers[i * stride..]));
                $name { $($parameter: all.next().expect("an endless iterator")),* }
            }
        }
    };
}

pub(crate) use mixed_element;
