//! Single precision against double precision, whose errors are smaller by a factor of 2²⁹.
//!
//! A sample of the 2³² arguments is tested by default, all of them, and a billion pairs, by
//! `cargo test --release -p energy-runtime --lib elementary::single -- --ignored --nocapture`.

use std::marker::PhantomData;

use fastrand::Rng;

use crate::numbers::level::Level;
use crate::numbers::{Float, Kernel, Lane, LevelName, Number, available, dispatch, dispatch_at};

/// Sample of every `STRIDE`-th bit pattern: a prime, so that all low bits occur.
const STRIDE: usize = 4099;

/// A function in single and in double precision. A function of one number ignores the second.
trait Function {
    const NAME: &'static str;
    /// Largest error in units of u = 2⁻²⁴. The nearest number has an error of up to 1.
    const BOUND: f64;

    fn of<V: Number, L: Level>(a: V, b: V) -> V;
}

macro_rules! functions {
    ($($name:ident <= $bound:literal: |$a:ident, $b:ident| $of:expr;)*) => {$(
        struct $name;

        impl Function for $name {
            const NAME: &'static str = stringify!($name);
            const BOUND: f64 = $bound;

            #[inline(always)]
            fn of<V: Number, L: Level>($a: V, $b: V) -> V {
                let _ = &$b;
                $of
            }
        }
    )*};
}

functions! {
    Sin <= 1.2: |a, b| Number::sin::<L>(a);
    Cos <= 1.2: |a, b| Number::cos::<L>(a);
    SinOfBoth <= 1.2: |a, b| Number::sin_cos::<L>(a).0;
    CosOfBoth <= 1.2: |a, b| Number::sin_cos::<L>(a).1;
    Exp <= 1.01: |a, b| Number::exp::<L>(a);
    Ln <= 1.15: |a, b| Number::ln::<L>(a);
    Atan2 <= 1.1: |a, b| Number::atan2::<L>(a, b);
    ModerateAtan2 <= 1.1: |a, b| Number::moderate_atan2::<L>(a, b);
    Pow <= 1.05: |a, b| Number::powf::<L>(a, b);
}

/// Results below, 2⁻¹¹⁸, are subnormal or were computed from subnormal numbers.
const SMALL: f64 = 256.0 * f32::MIN_POSITIVE as f64;

/// Largest error of small results, in units of u or of half the least subnormal number. Most subnormal results are
/// rounded twice.
const SMALL_BOUND: f64 = 1.6;

/// Returns the error of a result in units of u, or of half the least subnormal number if that is more.
fn error(found: f32, expected: f64) -> f64 {
    let is_wrong = found.is_nan() != expected.is_nan()
        || found.is_sign_negative() != expected.is_sign_negative() && !expected.is_nan()
        || (expected.is_infinite() || expected == 0.0) && f64::from(found) != expected
        || found.is_infinite() && expected.abs() < f64::from(f32::MAX);
    match is_wrong {
        true => f64::INFINITY,
        false if !found.is_finite() || expected == 0.0 => 0.0,
        false => {
            (f64::from(found) - expected).abs() / expected.abs().max(f64::from(f32::MIN_POSITIVE)) * 2.0_f64.powi(24)
        }
    }
}

/// Evaluates a function in lanes.
struct Results<'a, F, S>(&'a [(f32, f32)], &'a mut [S], PhantomData<F>);

impl<F: Function, S: Float> Kernel for Results<'_, F, S> {
    type Output = ();

    #[inline(always)]
    fn run<L: Level>(self) {
        let lanes = <S::Lanes<L> as Lane<S>>::LANES;
        for (arguments, results) in self.0.chunks(lanes).zip(self.1.chunks_mut(lanes)) {
            let (mut a, mut b) = ([S::from_f64(0.0); 16], [S::from_f64(0.0); 16]);
            for (lane, &(x, y)) in arguments.iter().enumerate() {
                (a[lane], b[lane]) = (S::from_f64(f64::from(x)), S::from_f64(f64::from(y)));
            }
            F::of::<S::Lanes<L>, L>(Lane::load(&a), Lane::load(&b)).store_ragged(results);
        }
    }
}

/// An error of a function, its arguments, and the result.
#[derive(Clone, Copy)]
struct Found(f64, (f32, f32), f32);

/// Arguments that are tested together.
const CHUNK: usize = 1 << 12;

/// Checks the largest errors of ordinary and of small results. Nearest numbers are passed over.
fn check<F: Function>(levels: &[LevelName], mut arguments: impl Iterator<Item = (f32, f32)>) {
    let mut worst = vec![[Found(0.0, (0.0, 0.0), 0.0); 2]; levels.len()];
    let (mut expected, mut found) = ([0.0_f64; CHUNK], [0.0_f32; CHUNK]);
    loop {
        let chunk: Vec<(f32, f32)> = arguments.by_ref().take(CHUNK).collect();
        let (expected, found) = (&mut expected[..chunk.len()], &mut found[..chunk.len()]);
        dispatch(Results::<F, f64>(&chunk, expected, PhantomData));
        for (&level, worst) in levels.iter().zip(&mut worst) {
            let results = Results::<F, f32>(&chunk, found, PhantomData);
            dispatch_at(level, results).expect("the level is available");
            for ((&at, &expected), &found) in chunk.iter().zip(&*expected).zip(&*found) {
                if found.to_bits() == (expected as f32).to_bits() {
                    continue;
                }
                let error = error(found, expected);
                let worst = &mut worst[usize::from(expected.abs() < SMALL)];
                if error > worst.0 {
                    *worst = Found(error, at, found);
                }
            }
        }
        if chunk.len() < CHUNK {
            break;
        }
    }
    for (level, worst) in levels.iter().zip(worst) {
        for (Found(error, at, result), bound) in worst.into_iter().zip([F::BOUND, SMALL_BOUND]) {
            println!("{} at {level}: {error:.3} u at {at:?}: {result:e}", F::NAME);
            assert!(error <= bound, "{} at {level}: {error:.3} u at {at:?}: {result:e}", F::NAME);
        }
    }
}

/// Checks a sample, and the neighbours of multiples of π/2, where most bits of angles cancel.
fn check_unary<F: Function>(levels: &[LevelName]) {
    let sample = (0..=u32::MAX).step_by(STRIDE).map(f32::from_bits);
    let right_angles = (1..50_000).map(|count| (f64::from(count) * std::f64::consts::FRAC_PI_2) as f32);
    // The closest of all to a multiple.
    let closest = 16_367_173.0 * 2.0_f32.powi(72);
    check::<F>(levels, sample.chain(right_angles).chain([closest]).map(|x| (x, 0.0)));
}

/// Returns numbers that functions treat specially, and their neighbours.
fn special_numbers() -> Vec<f32> {
    let small = [0.0, f32::MIN_POSITIVE, 1e-20, 0.25, 0.5, 1.0];
    let large = [2.0, 3.0, 88.0, 103.0, 8_388_607.5, 16_777_215.0, 1e20, f32::MAX, f32::INFINITY];
    let all = small.into_iter().chain(large).flat_map(|x: f32| [x.next_down().abs(), x, x.next_up()]);
    all.chain([f32::NAN]).flat_map(|x| [x, -x]).collect()
}

/// Returns pairs of special numbers, then random pairs: of any size, of moderate size, and near each other.
fn pairs(count: usize) -> impl Iterator<Item = (f32, f32)> + Clone {
    let special = special_numbers();
    let others = special.clone();
    let special = special.into_iter().flat_map(move |a| others.clone().into_iter().map(move |b| (a, b)));
    let mut random = Rng::with_seed(11);
    special.chain((0..count).map(move |i| {
        let mut moderate = || (2.0 * random.f32() - 1.0) * 2.0_f32.powi(random.i32(-12..=12));
        let (a, b) = (moderate(), moderate());
        match i % 4 {
            0 => (f32::from_bits(random.u32(..)), f32::from_bits(random.u32(..))),
            1 => (a, b),
            2 => (a, a * (1.0 + 0.1 * b)),
            _ => (f32::from_bits(random.u32(..)), a),
        }
    }))
}

/// Returns pairs whose powers are ordinary numbers of any size.
fn bases_and_exponents(count: usize) -> impl Iterator<Item = (f32, f32)> + Clone {
    let mut random = Rng::with_seed(12);
    (0..count).map(move |i| {
        let near = 1.0 + (random.f32() - 0.5) * 2.0_f32.powi(random.i32(-22..=0));
        let base = if i % 2 == 0 { near } else { f32::from_bits(random.u32(..0x7f80_0000)) };
        (base, (2.0 * random.f32() - 1.0) * 105.0 / base.ln().abs().max(1e-7))
    })
}

fn moderate_points(count: usize) -> impl Iterator<Item = (f32, f32)> + Clone {
    let size = |&(y, x): &(f32, f32)| f64::from(y).hypot(f64::from(x)).log2();
    pairs(count).filter(move |point| (-47.9..47.9).contains(&size(point)))
}

#[test]
fn functions_of_one_number_are_accurate() {
    let levels: Vec<LevelName> = available().collect();
    check_unary::<Sin>(&levels);
    check_unary::<Cos>(&levels);
    check_unary::<SinOfBoth>(&levels);
    check_unary::<CosOfBoth>(&levels);
    check_unary::<Exp>(&levels);
    check_unary::<Ln>(&levels);
}

#[test]
fn functions_of_two_numbers_are_accurate() {
    let levels: Vec<LevelName> = available().collect();
    check::<Atan2>(&levels, pairs(300_000));
    check::<ModerateAtan2>(&levels, moderate_points(300_000));
    check::<Pow>(&levels, pairs(200_000).chain(bases_and_exponents(200_000)));
}

/// Returns a level without and one with fused operations. All levels with them have the same bits.
fn two_levels() -> Vec<LevelName> {
    available().take(2).collect()
}

/// Checks all numbers, or those from 0 on if the others have the same bits by symmetry.
fn check_all<F: Function>(is_symmetric: bool) {
    let last = if is_symmetric { u32::MAX >> 1 } else { u32::MAX };
    check::<F>(&two_levels(), (0..=last).map(|bits| (f32::from_bits(bits), 0.0)));
}

#[test]
#[ignore = "takes minutes: all 32-bit arguments"]
fn every_sine_is_accurate() {
    check_all::<Sin>(true);
}

#[test]
#[ignore = "takes minutes: all 32-bit arguments"]
fn every_cosine_is_accurate() {
    check_all::<Cos>(true);
}

#[test]
#[ignore = "takes minutes: all 32-bit arguments"]
fn every_exponential_is_accurate() {
    check_all::<Exp>(false);
}

#[test]
#[ignore = "takes minutes: all 32-bit arguments"]
fn every_logarithm_is_accurate() {
    check_all::<Ln>(false);
}

#[test]
#[ignore = "takes minutes: a billion pairs"]
fn a_billion_pairs_are_accurate() {
    let levels = two_levels();
    check::<Atan2>(&levels, pairs(1 << 28));
    check::<ModerateAtan2>(&levels, moderate_points(1 << 28));
    check::<Pow>(&levels, pairs(1 << 28).chain(bases_and_exponents(1 << 28)));
}
