//! Nanoseconds per hinge for value, gradient and full Hessian of 10,000 hinges, row by row, as the Python package
//! writes them: `cargo bench -p energy-elements --bench matrices`. `python/benchmarks/calls.py` runs it in turns with
//! calls from Python.
#![allow(missing_docs)]

// The Python package compiles such kernels for all elements.
#[expect(dead_code, reason = "the part for forces")]
#[path = "../../python/src/compiled/matrices.rs"]
mod matrices;

use std::hint::black_box;
use std::time::Instant;

use energy_dsl::{Packed, Vector3};
use energy_elements::QuadraticHinge;

const COUNT: usize = 10_000;
const POINTS: usize = 4;

fn main() {
    let mut random = fastrand::Rng::with_seed(5);
    let mut draw = || 2.0 * random.f64() - 1.0;
    let x: Vec<Vector3<f64>> = (0..COUNT * POINTS).map(|_| std::array::from_fn(|_| draw())).collect();
    let hinge: QuadraticHinge = QuadraticHinge::new(1.5, 0.25);
    let hinges = Packed::from_fn(COUNT, POINTS, |_| &hinge, |i, point| (POINTS * i + point) as u32);
    let (mut energies, mut gradients) = (vec![0.0; COUNT], vec![0.0; COUNT * 3 * POINTS]);
    let mut hessians = vec![0.0; COUNT * 9 * POINTS * POINTS];
    let mut best = f64::INFINITY;
    for _ in 0..200 {
        let start = Instant::now();
        let flagged = matrices::hessian_matrices(&hinges, black_box(&x), &mut energies, &mut gradients, &mut hessians);
        best = best.min(start.elapsed().as_secs_f64());
        drop(black_box(flagged));
        black_box((&energies, &gradients, &hessians));
    }
    println!("{:.2}", 1e9 * best / COUNT as f64);
}
