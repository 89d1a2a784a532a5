//! The elements that are timed: one of each family.

use energy_dsl::{Real, Vector3};
use energy_elements::{
    AsRigidAsPossible, BridsonBending, Distance, DistanceBarrier, FlatBending, HairBend, HingeAngle, HookeSpring,
    NeoHookean, StVK, StableNeoHookeanLog,
};

use verify::sample::Sample;

use super::methods::{Measured, Methods};
use super::plain;
use crate::complex::Complex;

/// A function that measures an element by all methods.
pub(super) type Bench = fn(&Methods<'_>) -> Vec<Measured>;

fn converted<T: Real>(numbers: &[f64]) -> Vec<T> {
    numbers.iter().map(|&x| T::from_f64(x)).collect()
}

fn plane<T: Real>(rest: &[T], point: usize) -> [T; 2] {
    [rest[2 * point], rest[2 * point + 1]]
}

fn space<T: Real>(rest: &[T], point: usize) -> Vector3<T> {
    [rest[3 * point], rest[3 * point + 1], rest[3 * point + 2]]
}

/// Declares the elements with their plain formula, their number of coordinates, and how they are made.
macro_rules! benches {
    ($($element:ident by $plain:ident of $coordinates:literal, |$parameters:ident, $rest:ident| $make:expr;)*) => {
        /// Benchmarks by the name of their element.
        pub(super) const ELEMENTS: &[(&str, Bench)] = &[$((stringify!($element), |methods| {
            fn make<T: Real>(sample: &Sample) -> $element<T> {
                let ($parameters, $rest): (Vec<T>, Vec<T>) = (converted(&sample.parameters), converted(&sample.rest));
                let _ = &$rest;
                let _ = &$parameters;
                $make
            }
            let dual = |sample: &Sample| plain::hessian::<$coordinates>(plain::$plain, sample);
            methods.all(&make::<f64>, &make::<f32>, &make::<Complex>, &dual)
        })),*];
    };
}

const POSITIVE: &str = "samples have rest shapes of positive area";

benches! {
    Distance by distance of 6, |p, r| Distance::new();
    HookeSpring by spring of 6, |p, r| HookeSpring::new(p[0], p[1]);
    DistanceBarrier by barrier of 6, |p, r| DistanceBarrier::new(p[0], p[1]);
    HairBend by hair_bend of 9, |p, r| HairBend::new(p[0]);
    HingeAngle by dihedral of 12, |p, r| HingeAngle::new();
    BridsonBending by bridson of 12, |p, r| BridsonBending::new(p[0], p[1]);
    FlatBending by flat_bending of 12, |p, r| FlatBending::new(space(&r, 0), space(&r, 1), space(&r, 2), space(&r, 3), p[0]).expect(POSITIVE);
    StVK by stvk of 9, |p, r| StVK::new(plane(&r, 0), plane(&r, 1), plane(&r, 2), p[0], p[1]).expect(POSITIVE);
    AsRigidAsPossible by arap of 9, |p, r| AsRigidAsPossible::new(plane(&r, 0), plane(&r, 1), plane(&r, 2), p[0]).expect(POSITIVE);
    StableNeoHookeanLog by stable_neo_hookean_log of 9, |p, r| {
        StableNeoHookeanLog::new(plane(&r, 0), plane(&r, 1), plane(&r, 2), p[0], p[1]).expect(POSITIVE)
    };
    NeoHookean by neo_hookean of 9, |p, r| NeoHookean::new(plane(&r, 0), plane(&r, 1), plane(&r, 2), p[0], p[1]).expect(POSITIVE);
}
