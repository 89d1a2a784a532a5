//! Throughput of elementary functions next to the standard library, in nanoseconds per call (of all lanes together):
//! `cargo bench -p energy-dsl --bench elementary`.

#![allow(missing_docs)]

use std::hint::black_box;
use std::time::Instant;

use energy_dsl::{Kernel, Lane, Level, Number, available, dispatch_at};

const COUNT: usize = 1024;

/// Returns the time of the fastest of several passes over the arguments, in nanoseconds per call.
#[inline(always)]
fn fastest(calls: usize, mut pass: impl FnMut()) -> f64 {
    let time = |_| {
        let start = Instant::now();
        pass();
        start.elapsed().as_secs_f64() * 1e9 / calls as f64
    };
    (0..2000).map(time).fold(f64::INFINITY, f64::min)
}

trait Function {
    fn of<L: Level, V: Number>(a: V, b: V) -> V;
    fn standard(a: f64, b: f64) -> f64;
}

macro_rules! functions {
    ($($name:ident: |$a:ident, $b:ident| $ours:expr, $standard:expr;)*) => {
        $(
            struct $name;

            impl Function for $name {
                #[inline(always)]
                fn of<L: Level, V: Number>($a: V, $b: V) -> V {
                    let _ = &$b;
                    $ours
                }
                fn standard($a: f64, $b: f64) -> f64 {
                    let _ = $b;
                    $standard
                }
            }
        )*
    };
}

functions! {
    Sin: |a, b| a.sin::<L>(), a.sin();
    Cos: |a, b| a.cos::<L>(), a.cos();
    Exp: |a, b| a.exp::<L>(), a.exp();
    Ln: |a, b| a.abs().ln::<L>(), a.abs().ln();
    Atan2: |a, b| a.atan2::<L>(b), a.atan2(b);
    Pow: |a, b| a.abs().powf::<L>(b), a.abs().powf(b);
}

/// Processes all arguments once, with lanes of type `V`.
struct Pass<'a, S, V, F>(&'a [S], &'a [S], &'a mut [S], std::marker::PhantomData<(V, F)>);

impl<S: Number, V: Lane<S>, F: Function> Kernel for Pass<'_, S, V, F> {
    type Output = f64;

    #[inline(always)]
    fn run<L: Level>(self) -> f64 {
        let mut best = f64::INFINITY;
        for _ in 0..2000 {
            let start = Instant::now();
            let arguments = self.0.chunks_exact(V::LANES).zip(self.1.chunks_exact(V::LANES));
            for ((a, b), result) in arguments.zip(self.2.chunks_exact_mut(V::LANES)) {
                F::of::<L, V>(V::load(a), V::load(b)).store(result);
            }
            best = best.min(start.elapsed().as_secs_f64() * 1e9 / (COUNT / V::LANES) as f64);
            black_box(&self.2);
        }
        best
    }
}

/// Measures a scalar, a register of doubles and one of single-precision numbers.
struct Times<'a, F>(&'a [f64], &'a [f64], std::marker::PhantomData<F>);

impl<F: Function> Kernel for Times<'_, F> {
    type Output = [f64; 3];

    #[inline(always)]
    fn run<L: Level>(self) -> [f64; 3] {
        let single = |values: &[f64]| values.iter().map(|&x| x as f32).collect::<Vec<_>>();
        let (a, b) = (single(self.0), single(self.1));
        let (mut results, mut singles) = (vec![0.0; COUNT], vec![0.0; COUNT]);
        [
            Pass::<f64, f64, F>(self.0, self.1, &mut results, std::marker::PhantomData).run::<L>(),
            Pass::<f64, L::F64, F>(self.0, self.1, &mut results, std::marker::PhantomData).run::<L>(),
            Pass::<f32, L::F32, F>(&a, &b, &mut singles, std::marker::PhantomData).run::<L>(),
        ]
    }
}

fn measure<F: Function>(name: &str) {
    let argument = |scale: f64, i: usize| ((i * 7919 % COUNT) as f64 / COUNT as f64 - 0.5) * scale;
    let a: Vec<f64> = (0..COUNT).map(|i| argument(12.0, i) + 1e-3).collect();
    let b: Vec<f64> = (0..COUNT).map(|i| argument(7.0, i * 31 + 5)).collect();
    let mut results = vec![0.0; COUNT];
    let standard = fastest(COUNT, || {
        for i in 0..COUNT {
            results[i] = F::standard(a[i], b[i]);
        }
        black_box(&mut results);
    });
    for level in available() {
        let times = dispatch_at(level, Times::<F>(&a, &b, std::marker::PhantomData));
        let [scalar, double, single] = times.expect("the level is available");
        println!("{name:6} {:9} {standard:8.1} {scalar:8.1} {double:8.1} {single:8.1}", level.as_str());
    }
}

fn main() {
    println!("ns a call           standard   scalar    lanes  lanes of f32");
    measure::<Sin>("sin");
    measure::<Cos>("cos");
    measure::<Exp>("exp");
    measure::<Ln>("ln");
    measure::<Atan2>("atan2");
    measure::<Pow>("powf");
}
