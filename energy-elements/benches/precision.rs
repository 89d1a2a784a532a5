//! Compares single with double precision in lanes: `cargo bench -p energy-elements --bench precision`.
//!
//! Prints nanoseconds per element for value, gradient and Hessian of 10,000 elements, and the ratio of the times.
//! Rounds alternate between the precisions, and the fastest of each counts.
#![allow(missing_docs)]

use std::array::from_fn;
use std::time::Instant;

use energy_dsl::{Float, Packed, PackedPotential, Vector3};
use energy_elements::{
    DistanceBarrier, HairBend, HookeSpring, NeoHookean, PlateBending, QuadraticHinge, StVK, TetCorotational, TetStVK,
    TetStableNeoHookean,
};

const COUNT: usize = 10_000;
const ROUNDS: usize = 100;

/// Elements of one type and precision, with room for their results.
struct Case<E: PackedPotential<S>, S: Float> {
    packed: Packed<E, S>,
    x: Vec<Vector3<S>>,
    energies: Vec<S>,
    gradients: Vec<S>,
    triangles: Vec<S>,
    best: [f64; 3],
}

impl<E: PackedPotential<S>, S: Float> Case<E, S> {
    /// Places equal elements around some points, moved by up to 0.2 along each axis.
    fn new<const N: usize>(element: &E, around: [[f64; 3]; N]) -> Self {
        let mut random = fastrand::Rng::with_seed(5);
        let mut draw = || 2.0 * random.f64() - 1.0;
        let point = |i: usize| from_fn(|axis| S::from_f64(around[i % N][axis] + 0.2 * draw()));
        let zeros = |count: usize| vec![S::from_f64(0.0); count];
        Self {
            packed: Packed::from_fn(COUNT, N, |_| element, |i, point| (N * i + point) as u32),
            x: (0..COUNT * N).map(point).collect(),
            energies: zeros(COUNT),
            gradients: zeros(3 * N * COUNT),
            triangles: zeros(9 * N * (N + 1) / 2 * COUNT),
            best: [f64::INFINITY; 3],
        }
    }

    fn round(&mut self) {
        let Self { packed, x, energies, gradients, triangles, best } = self;
        let all = 0..COUNT;
        let mut time = |routine: usize, start: Instant| {
            best[routine] = best[routine].min(1e9 * start.elapsed().as_secs_f64() / COUNT as f64);
        };
        let start = Instant::now();
        packed.values(all.clone(), x, energies).expect("outputs fit");
        time(0, start);
        let start = Instant::now();
        packed.gradients(all.clone(), x, energies, gradients).expect("outputs fit");
        time(1, start);
        let start = Instant::now();
        packed.hessians(all, x, energies, gradients, triangles).expect("outputs fit");
        time(2, start);
    }
}

fn compare<const N: usize>(
    name: &str,
    double: &impl PackedPotential<f64>,
    single: &impl PackedPotential<f32>,
    around: [[f64; 3]; N],
) {
    let (mut double, mut single) = (Case::new(double, around), Case::new(single, around));
    for _ in 0..ROUNDS {
        double.round();
        single.round();
    }
    print!("{name:20}");
    for (double, single) in double.best.iter().zip(single.best) {
        print!("  {double:7.1} {single:6.1} {:5.2} ×", double / single);
    }
    println!();
}

/// Compares an element at some points. The arguments of its constructor are written once, for both precisions.
macro_rules! compare {
    ($name:ident at $around:expr, |$number:ident, $point:ident| $new:expr) => {{
        let double: $name<f64> = {
            #[allow(unused_variables)]
            let ($number, $point) = (|x: f64| x, |p: [f64; 3]| p);
            $new
        };
        let single: $name<f32> = {
            #[allow(unused_variables)]
            let ($number, $point) = (|x: f64| x as f32, |p: [f64; 3]| p.map(|x| x as f32));
            $new
        };
        compare(stringify!($name), &double, &single, $around);
    }};
}

fn main() {
    println!("{:20}  {:>23}  {:>23}  {:>23}", "ns: f64, f32, ratio", "value", "gradient", "Hessian");
    let triangle = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.2, 0.9, 0.0]];
    let tetrahedron = [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.1, 1.0, 0.0], [0.2, 0.3, 0.9]];
    let [a, b, c, d] = tetrahedron;
    let hinge = [[0.3, 1.0, 0.1], [0.6, -0.9, 0.1], [0.0, 0.0, 0.0], [1.0, 0.0, 0.0]];
    let plate = [[0.0; 3], [1.0, 0.0, 0.0], [0.2, 0.9, 0.0], [1.1, 0.8, 0.0], [-0.7, 0.6, 0.0], [0.5, -0.8, 0.0]];
    let [p0, p1, p2, p3, p4, p5] = plate;
    compare!(HookeSpring at [[0.0; 3], [1.0, 0.0, 0.0]], |n, p| HookeSpring::new(n(2.0), n(1.0)));
    compare!(DistanceBarrier at [[0.0; 3], [0.6, 0.0, 0.0]], |n, p| DistanceBarrier::new(n(1.0), n(1.0)));
    compare!(HairBend at [[0.0; 3], [1.0, 0.0, 0.0], [2.0, 0.1, 0.0]], |n, p| HairBend::new(n(1.0)));
    compare!(QuadraticHinge at hinge, |n, p| QuadraticHinge::new(n(1.0), n(0.1)));
    compare!(StVK at triangle, |n, p| {
        StVK::new([n(0.0); 2], [n(1.0), n(0.0)], [n(0.2), n(0.9)], n(1.0), n(1.0)).expect("a sound rest shape")
    });
    compare!(NeoHookean at triangle, |n, p| {
        NeoHookean::new([n(0.0); 2], [n(1.0), n(0.0)], [n(0.2), n(0.9)], n(1.0), n(1.0)).expect("a sound rest shape")
    });
    compare!(TetStVK at tetrahedron, |n, p| {
        TetStVK::new(p(a), p(b), p(c), p(d), n(1.0), n(1.0)).expect("a sound rest shape")
    });
    compare!(TetCorotational at tetrahedron, |n, p| {
        TetCorotational::new(p(a), p(b), p(c), p(d), n(1.0), n(1.0)).expect("a sound rest shape")
    });
    compare!(TetStableNeoHookean at tetrahedron, |n, p| {
        TetStableNeoHookean::new(p(a), p(b), p(c), p(d), n(1.0), n(1.0)).expect("a sound rest shape")
    });
    compare!(PlateBending at plate, |n, p| {
        PlateBending::new(p(p0), p(p1), p(p2), p(p3), p(p4), p(p5), n(1.0), n(1.0)).expect("a sound rest shape")
    });
}
