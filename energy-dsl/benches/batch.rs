//! What packing and unpacking cost beside the mathematics: `cargo bench -p energy-dsl --bench batch`. Energies, gradients and
//! Hessians of 2048 elements on 1024 points, nanoseconds an element.

#![allow(missing_docs, mixed_script_confusables)]

use std::hint::black_box;
use std::marker::PhantomData;
use std::time::Instant;

use energy_dsl::{
    Batch, BatchWork, Batches, Hessians, Kernel, Lane, Level, Pack, Potential, available, dispatch_at, pack_field,
};
use energy_macros::energy;

energy! {
    energy Spring(p, q: Point; k: Scalar[N/m], L: Scalar[m]) { k / 2 * (norm(p - q) - L)^2 }
    energy Hinge(x1, x2, x3, x4: Point; k: Scalar[J], θ0: Scalar[rad]) {
        let θ = dihedral(x1, x2, x3, x4);
        k * (θ - θ0)^2
    }
}

impl Pack for Spring {
    type Wide<V: Lane<f64>> = Spring<V>;

    #[inline(always)]
    fn pack<V: Lane<f64>>(elements: &[Self]) -> Spring<V> {
        Spring { k: pack_field(elements, |e| e.k), L: pack_field(elements, |e| e.L) }
    }
}

impl Pack for Hinge {
    type Wide<V: Lane<f64>> = Hinge<V>;

    #[inline(always)]
    fn pack<V: Lane<f64>>(elements: &[Self]) -> Hinge<V> {
        Hinge { k: pack_field(elements, |e| e.k), θ0: pack_field(elements, |e| e.θ0) }
    }
}

const ELEMENTS: usize = 2048;
const POINTS: usize = 1024;

/// Only packs.
struct Packing;

impl<E: Pack> BatchWork<E> for Packing {
    #[inline(always)]
    fn batch<L: Level>(&mut self, batch: &Batch<E, L::F64>) {
        black_box(batch);
    }
}

/// Packs and computes; the results go nowhere.
struct Computing;

impl<E: Pack> BatchWork<E> for Computing {
    #[inline(always)]
    fn batch<L: Level>(&mut self, batch: &Batch<E, L::F64>) {
        black_box(batch.element.hessian_at::<L>(&batch.points));
    }
}

/// Computes element by element.
struct Single<'a, E: Pack, const N: usize>(
    &'a [E],
    &'a [[u32; N]],
    &'a [[f64; 3]],
    &'a mut [(f64, E::Points, E::Triangle)],
);

impl<E: Pack + Potential<f64, Points = [[f64; 3]; N]>, const N: usize> Kernel for Single<'_, E, N> {
    type Output = ();

    #[inline(always)]
    fn run<L: Level>(self) {
        for ((element, stencil), result) in self.0.iter().zip(self.1).zip(self.3) {
            let mut points = [[0.0; 3]; N];
            for i in 0..N {
                points[i] = self.2[stencil[i] as usize];
            }
            let h = element.hessian_at::<L>(&points);
            *result = (h.value, h.gradient, h.hessian);
        }
    }
}

/// The mathematics alone, on the same lanes again and again.
struct Alone<E>(PhantomData<E>);

impl<E: Pack> Kernel for Alone<E>
where
    E: From<usize>,
{
    type Output = f64;

    #[inline(always)]
    fn run<L: Level>(self) -> f64 {
        let elements = [E::from(1)];
        let element = E::pack::<L::F64>(&elements);
        let mut points = energy_dsl::Array::from_fn(|_| [<L::F64 as Lane<f64>>::splat(0.0); 3]);
        let all: &mut energy_dsl::WidePoints<E, L::F64> = &mut points;
        for (i, point) in all.as_mut().iter_mut().enumerate() {
            for axis in 0..3 {
                point[axis] = <L::F64 as Lane<f64>>::from_fn(|lane| ((i * 3 + axis + lane) as f64 * 1.3).sin());
            }
        }
        let lanes = <L::F64 as Lane<f64>>::LANES;
        let mut best = f64::INFINITY;
        for _ in 0..300 {
            let start = Instant::now();
            for _ in 0..ELEMENTS / lanes {
                black_box(black_box(&element).hessian_at::<L>(black_box(&points)));
            }
            best = best.min(start.elapsed().as_secs_f64() * 1e9 / ELEMENTS as f64);
        }
        best
    }
}

impl From<usize> for Spring {
    fn from(i: usize) -> Self {
        Spring { k: 1.0 + i as f64, L: 0.1 }
    }
}

impl From<usize> for Hinge {
    fn from(i: usize) -> Self {
        Hinge { k: 1.0 + i as f64, θ0: 0.1 }
    }
}

fn fastest(mut pass: impl FnMut()) -> f64 {
    let time = |_| {
        let start = Instant::now();
        pass();
        start.elapsed().as_secs_f64() * 1e9 / ELEMENTS as f64
    };
    (0..300).map(time).fold(f64::INFINITY, f64::min)
}

fn measure<E, const N: usize>(name: &str)
where
    E: Pack + From<usize> + Potential<f64, Points = [[f64; 3]; N]>,
{
    let number = |i: usize| (1.3 * i as f64).sin();
    let positions: Vec<[f64; 3]> = (0..POINTS).map(|i| [number(3 * i), number(3 * i + 1), number(3 * i + 2)]).collect();
    let elements: Vec<E> = (0..ELEMENTS).map(E::from).collect();
    let stencils: Vec<[u32; N]> =
        (0..ELEMENTS).map(|i| std::array::from_fn(|p| ((i * 37 + p * 11) % POINTS) as u32)).collect();
    let triangle = 9 * N * (N + 1) / 2;
    let (mut energies, mut gradients) = (vec![0.0; ELEMENTS], vec![0.0; ELEMENTS * 3 * N]);
    let mut triangles = vec![0.0; ELEMENTS * triangle];
    let zero = elements[0].hessian(&[[0.0, 1.0, 2.0]; N]);
    let mut singles = vec![(0.0, zero.gradient, zero.hessian); ELEMENTS];
    for level in available() {
        let single = fastest(|| {
            dispatch_at(level, Single(&elements, &stencils, &positions, &mut singles));
            black_box(&mut singles);
        });
        let (elements, stencils, positions) = (&elements[..], &stencils[..], &positions[..]);
        let packing = fastest(|| {
            dispatch_at(level, Batches { elements, stencils, positions, work: &mut Packing });
        });
        let computing = fastest(|| {
            dispatch_at(level, Batches { elements, stencils, positions, work: &mut Computing });
        });
        let all = fastest(|| {
            let mut work = Hessians {
                energies: &mut energies,
                gradients: &mut gradients,
                triangles: &mut triangles,
                flagged: Vec::new(),
            };
            dispatch_at(level, Batches { elements, stencils, positions, work: &mut work });
        });
        let alone = dispatch_at(level, Alone::<E>(PhantomData)).expect("the level is available");
        println!("{name:7} {:9} {single:8.1} {alone:8.1} {packing:8.1} {computing:8.1} {all:8.1}", level.as_str());
    }
}

fn main() {
    println!("                   one by one   maths     pack  pack+maths  all");
    measure::<Spring, 2>("spring");
    measure::<Hinge, 4>("hinge");
}
