//! Times of a generated routine at each level, for scalars and lanes: `cargo bench -p energy-dsl --bench lanes`.

#![allow(missing_docs, mixed_script_confusables)]

use std::hint::black_box;
use std::time::Instant;

use energy_dsl::energy;
use energy_dsl::{Kernel, Lane, Level, Potential, Real, available, dispatch_at};

energy! {
    energy Spring(p, q: Point; k: Scalar[N/m], L: Scalar[m]) { k / 2 * (norm(p - q) - L)^2 }
    energy Hinge(x1, x2, x3, x4: Point; k: Scalar[J], θ0: Scalar[rad]) {
        let θ = dihedral(x1, x2, x3, x4);
        k * (θ - θ0)^2
    }
}

/// Measures the fastest of several runs of many calls, in nanoseconds per call. The loop is compiled for the level,
/// too, which a closure would not be.
struct Time<'a, T: Real, E: Potential<T>>(&'a E, &'a E::Points, std::marker::PhantomData<T>);

impl<T: Real, E: Potential<T>> Kernel for Time<'_, T, E> {
    type Output = f64;

    #[inline(always)]
    fn run<L: Level>(self) -> f64 {
        const CALLS: u32 = 2000;
        let mut best = f64::INFINITY;
        for _ in 0..200 {
            let start = Instant::now();
            for _ in 0..CALLS {
                black_box(black_box(self.0).hessian_at::<L>(black_box(self.1)));
            }
            best = best.min(start.elapsed().as_secs_f64() * 1e9 / f64::from(CALLS));
        }
        best
    }
}

fn points<T: Real, const N: usize>(number: impl Fn(usize) -> T) -> [[T; 3]; N] {
    std::array::from_fn(|point| std::array::from_fn(|axis| number(point + 20 * axis)))
}

/// A spring and a hinge over lanes of type `V`.
struct Elements<V>(std::marker::PhantomData<V>);

struct Measure;

impl Kernel for Measure {
    type Output = [f64; 2];

    #[inline(always)]
    fn run<L: Level>(self) -> [f64; 2] {
        let times = Elements::<L::F64>(std::marker::PhantomData).run::<L>();
        times.map(|time| time / <L::F64 as Lane<f64>>::LANES as f64)
    }
}

impl<V: Lane<f64>> Kernel for Elements<V> {
    type Output = [f64; 2];

    #[inline(always)]
    fn run<L: Level>(self) -> [f64; 2] {
        let number = |i: usize| V::from_fn(|lane| (i as f64 * 1.7 + lane as f64 * 0.01).sin());
        let spring = Spring { k: V::splat(3.0), L: V::splat(0.3) };
        let hinge = Hinge { k: V::splat(3.0), θ0: V::splat(0.3) };
        [
            Time(&spring, &points(number), std::marker::PhantomData).run::<L>(),
            Time(&hinge, &points(number), std::marker::PhantomData).run::<L>(),
        ]
    }
}

fn main() {
    println!("energy, gradient and Hessian, ns an element     spring    hinge");
    for name in available() {
        let rows = [
            ("scalar", dispatch_at(name, Elements::<f64>(std::marker::PhantomData))),
            ("lanes", dispatch_at(name, Measure)),
        ];
        for (what, times) in rows {
            let [spring, hinge] = times.expect("the level is available");
            println!("{:10}{what:32}{spring:12.1} {hinge:8.1}", name.as_str());
        }
    }
}
