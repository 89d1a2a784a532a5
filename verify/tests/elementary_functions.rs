//! The elementary functions against multi-precision ones: random arguments of every size and hard ones, in both
//! precisions, at every SIMD level of the machine.
//!
//! `cargo test -p verify --test all elementary_functions:: -- --nocapture` prints the worst error of each.

use dashu_float::FBig;
use dashu_float::round::mode::HalfEven;
use energy_dsl::{Kernel, Lane, Level, Number, available, dispatch_at};

type Big = FBig<HalfEven, 2>;

const SAMPLES: usize = 12_000;
const PRECISION: usize = 128;

fn big(x: f64) -> Big {
    Big::try_from(x).expect("arguments are finite").with_precision(PRECISION).value()
}

/// A function with its true values and arguments; functions of one argument ignore the second.
struct Case {
    name: &'static str,
    truth: fn(f64, f64) -> Big,
    arguments: fn(&mut fastrand::Rng, f32_range: bool) -> (f64, f64),
    /// Allowed errors in double and in single precision, in ulp.
    bound: [f64; 2],
}

/// Returns a positive number whose exponent is uniform between `from` and `to`.
fn any_size(rng: &mut fastrand::Rng, from: i32, to: i32) -> f64 {
    let mantissa = 1.0 + rng.f64();
    let exponent = rng.i32(from..to);
    // In two steps, so that subnormal numbers are reached.
    mantissa * 2f64.powi(exponent / 2) * 2f64.powi(exponent - exponent / 2)
}

fn signed(rng: &mut fastrand::Rng, x: f64) -> f64 {
    if rng.bool() { x } else { -x }
}

fn exponents(single: bool) -> (i32, i32) {
    if single { (-149, 128) } else { (-1074, 1024) }
}

fn angle(rng: &mut fastrand::Rng, single: bool) -> (f64, f64) {
    let (from, to) = exponents(single);
    let x = match rng.u8(0..6) {
        0 => any_size(rng, from, to),
        1 => any_size(rng, -8, 30),
        2 => rng.f64() * 7.0,
        // Neighbours of multiples of π/2, where most digits cancel.
        3 => f64::from(rng.i32(1..2_000_000)) * std::f64::consts::FRAC_PI_2,
        4 => f64::from(rng.i32(1..20)) * std::f64::consts::FRAC_PI_4 + (rng.f64() - 0.5) * 1e-9,
        // The double closest to a multiple of π/2.
        _ => 6_381_956_970_095_103.0 * 2f64.powi(if single { 20 } else { 797 }),
    };
    (signed(rng, x), 0.0)
}

fn exponent(rng: &mut fastrand::Rng, single: bool) -> (f64, f64) {
    let x = match rng.u8(0..4) {
        0 => any_size(rng, exponents(single).0, 7),
        1 => rng.f64() * if single { 105.0 } else { 746.0 },
        2 => f64::from(rng.i32(1..1075)) * 0.5 * std::f64::consts::LN_2,
        _ => rng.f64() * 2.0,
    };
    (signed(rng, x), 0.0)
}

fn positive(rng: &mut fastrand::Rng, single: bool) -> (f64, f64) {
    let (from, to) = exponents(single);
    let x = match rng.u8(0..4) {
        0 | 1 => any_size(rng, from, to),
        2 => 1.0 + signed(rng, 0.5).abs().mul_add(rng.f64(), -0.25),
        _ => {
            let size = any_size(rng, if single { -23 } else { -52 }, -2);
            1.0 + signed(rng, size)
        }
    };
    (x, 0.0)
}

fn point(rng: &mut fastrand::Rng, single: bool) -> (f64, f64) {
    let (from, to) = exponents(single);
    let x = any_size(rng, from, to);
    let y = match rng.u8(0..3) {
        0 => any_size(rng, from, to),
        1 => x * any_size(rng, -4, 4),
        _ => x * (1.0 + signed(rng, 1e-3) * rng.f64()),
    };
    (signed(rng, y), signed(rng, x))
}

fn power(rng: &mut fastrand::Rng, single: bool) -> (f64, f64) {
    let x = positive(rng, single).0;
    let limit = if single { 104.0 } else { 745.0 };
    let y = match rng.u8(0..4) {
        // Results of every size.
        0 | 1 => limit * rng.f64() / x.ln().abs().max(1e-16),
        2 => f64::from(rng.i32(1..20)) * 0.5,
        _ => any_size(rng, -40, 4),
    };
    (x, signed(rng, y))
}

fn evaluate<S: Number, V: Lane<S>, L: Level>(name: &str, a: V, b: V) -> V {
    match name {
        "sin" => a.sin::<L>(),
        "cos" => a.cos::<L>(),
        "exp" => a.exp::<L>(),
        "ln" => a.ln::<L>(),
        "atan2" => a.atan2::<L>(b),
        "powf" => a.powf::<L>(b),
        _ => unreachable!(),
    }
}

/// Computes the results for all arguments in both precisions.
struct Results<'a> {
    name: &'static str,
    arguments: &'a [(f64, f64)],
}

impl Kernel for Results<'_> {
    type Output = [Vec<f64>; 2];

    #[inline(always)]
    fn run<L: Level>(self) -> Self::Output {
        let mut double = vec![0.0; self.arguments.len()];
        let lanes = <L::F64 as Lane<f64>>::LANES;
        for (arguments, results) in self.arguments.chunks(lanes).zip(double.chunks_mut(lanes)) {
            let at = |lane: usize| arguments[lane.min(arguments.len() - 1)];
            let (a, b) = (L::F64::from_fn(|lane| at(lane).0), L::F64::from_fn(|lane| at(lane).1));
            evaluate::<f64, _, L>(self.name, a, b).store_ragged(results);
        }
        let mut single = vec![0.0; self.arguments.len()];
        let lanes = <L::F32 as Lane<f32>>::LANES;
        for (arguments, results) in self.arguments.chunks(lanes).zip(single.chunks_mut(lanes)) {
            let at = |lane: usize| arguments[lane.min(arguments.len() - 1)];
            let (a, b) = (L::F32::from_fn(|lane| at(lane).0 as f32), L::F32::from_fn(|lane| at(lane).1 as f32));
            evaluate::<f32, _, L>(self.name, a, b).store_ragged(results);
        }
        [double, single.into_iter().map(f64::from).collect()]
    }
}

/// A floating-point format: bits of the mantissa, smallest exponent of normal numbers, greatest number.
#[derive(Clone, Copy)]
struct Format(i32, i32, f64);

const DOUBLE: Format = Format(53, -1022, f64::MAX);
const SINGLE: Format = Format(24, -126, f32::MAX as f64);

/// A true value: the nearest double, the remainder in units of the last place, and the exponent of that unit.
#[derive(Clone, Copy)]
struct Truth {
    nearest: f64,
    missing: f64,
    unit: i32,
}

impl Truth {
    fn new(value: &Big, Format(digits, least, _): Format) -> Self {
        let nearest = value.to_f64().value();
        if nearest.is_infinite() {
            return Self { nearest, missing: 0.0, unit: 0 };
        }
        let exponent = if nearest == 0.0 { least } else { (nearest.abs().log2().floor() as i32).max(least) };
        let unit = exponent - (digits - 1);
        // Scaled before rounding: the remainder may be smaller than any double.
        let missing = ((value - big(nearest)) << -isize::try_from(unit).expect("small")).to_f64().value();
        Self { nearest, missing, unit }
    }

    /// Returns the error of a result in units of the last place.
    fn error(self, result: f64, Format(.., greatest): Format) -> f64 {
        if result.is_infinite() {
            return if self.nearest * result.signum() >= greatest { 0.0 } else { f64::INFINITY };
        }
        let (half, rest) = (-self.unit / 2, -self.unit - (-self.unit / 2));
        ((result - self.nearest) * 2f64.powi(half) * 2f64.powi(rest) - self.missing).abs()
    }
}

fn check(case: &Case) {
    let mut failures = Vec::new();
    let mut rng = fastrand::Rng::with_seed(0x5eed);
    for (precision, format) in [DOUBLE, SINGLE].into_iter().enumerate() {
        let single = precision == 1;
        let arguments: Vec<(f64, f64)> = (0..SAMPLES)
            .map(|_| (case.arguments)(&mut rng, single))
            .map(|(a, b)| if single { (f64::from(a as f32), f64::from(b as f32)) } else { (a, b) })
            .filter(|&(a, b)| a.is_finite() && b.is_finite())
            .filter(|&(a, b)| case.name != "atan2" || (a != 0.0 && b != 0.0))
            .filter(|&(a, _)| !matches!(case.name, "ln" | "powf") || a > 0.0)
            .filter(|&(a, b)| case.name != "powf" || (b * a.ln()).abs() < 800.0)
            .collect();
        assert!(arguments.len() > 10_000, "too few arguments");
        let truths: Vec<Truth> = arguments.iter().map(|&(a, b)| Truth::new(&(case.truth)(a, b), format)).collect();
        for level in available() {
            let results = dispatch_at(level, Results { name: case.name, arguments: &arguments });
            let results = &results.expect("the level is available")[precision];
            // NaN is worse than any error.
            let error = |i: usize| Some(truths[i].error(results[i], format)).filter(|e| !e.is_nan());
            let rank = |i: usize| error(i).unwrap_or(f64::INFINITY);
            let worst = (0..arguments.len()).max_by(|&i, &j| rank(i).total_cmp(&rank(j))).expect("there are some");
            let line = format!(
                "{:6} {} {:9} {:.4} ulp at {:?}: {:e}",
                case.name,
                ["f64", "f32"][precision],
                level.as_str(),
                rank(worst),
                arguments[worst],
                results[worst],
            );
            println!("{line}");
            if rank(worst) > case.bound[precision] {
                failures.push(line);
            }
        }
    }
    assert!(failures.is_empty(), "beyond the bound:\n{}", failures.join("\n"));
}

// One test per function, so that they run in parallel.

#[test]
fn sine_is_within_its_bound() {
    check(&Case { name: "sin", truth: |x, _| big(x).sin(), arguments: angle, bound: [1.0, 0.8] });
}

#[test]
fn cosine_is_within_its_bound() {
    check(&Case { name: "cos", truth: |x, _| big(x).cos(), arguments: angle, bound: [1.0, 0.8] });
}

#[test]
fn exponential_is_within_its_bound() {
    check(&Case { name: "exp", truth: |x, _| big(x).exp(), arguments: exponent, bound: [1.0, 0.77] });
}

#[test]
fn logarithm_is_within_its_bound() {
    check(&Case { name: "ln", truth: |x, _| big(x).ln(), arguments: positive, bound: [1.0, 0.58] });
}

#[test]
fn arc_tangent_is_within_its_bound() {
    check(&Case { name: "atan2", truth: |y, x| big(y).atan2(&big(x)), arguments: point, bound: [1.0, 0.77] });
}

#[test]
fn power_is_within_its_bound() {
    check(&Case { name: "powf", truth: |x, y| big(x).powf(&big(y)), arguments: power, bound: [1.0, 0.77] });
}
