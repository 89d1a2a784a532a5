//! Every result of every function is finite or flagged, whatever the sizes of arguments and slopes.
//!
//! `RANGE_INPUTS=200 cargo test --release -p energy-compiler --test all range:: -- --nocapture` tries that number of
//! inputs for each formula.

use energy_compiler::{Interpreted, functions};
use energy_runtime::{Float, Inputs, Mask};

/// Calls of a function `f` with a scalar result.
const CALLS: [&str; 9] = [
    "f(x)",
    "f(x, 0.7)",
    "f(0.7, x)",
    "f(vector(x, p.y, 1))",
    "f(vector(x, p.y, 1), vector(1, x, 2))",
    "norm(f(vector(x, p.y, 1)))",
    "dot(f(vector(x, p.y, 1), vector(1, x, 2)), p)",
    "f(columns(vector(x, p.y, 1), vector(1, x, 2), vector(0, 1, x)))",
    "ddot(f(columns(vector(x, p.y, 1), vector(1, x, 2), vector(0, 1, x))), identity(3))",
];
/// Expressions of one variable and a parameter.
const INNER: [&str; 6] = ["k * p.x", "p.x / k", "k * p.x^2", "k * norm(p)", "1 + k * p.x", "k * (p.x - p.y)"];
/// Inputs of each formula in an ordinary run.
const INPUTS: u64 = 3;

/// Small random number generator (xorshift).
struct Random(u64);

impl Random {
    fn bits(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0 >> 16
    }

    /// Returns 0, or a number of any sign and of a magnitude up to 10 to the power of `decades`.
    fn number(&mut self, decades: f64) -> f64 {
        let size = 10.0_f64.powf(decades * ((self.bits() % 2001) as f64 / 1000.0 - 1.0));
        match self.bits() % 8 {
            0 => 0.0,
            1..4 => -size,
            _ => size,
        }
    }
}

fn source(call: &str, inner: &str) -> String {
    format!("energy Ranged(p: Point; k: Scalar) {{ let x = {inner}; {call} + 0 * k }}")
}

/// Returns the calls of all functions that compile.
fn calls() -> Vec<String> {
    let is_name = |name: &str| name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_');
    let names = functions().map(|function| function.name).filter(|name| is_name(name));
    let all = names.flat_map(|name| CALLS.map(|call| call.replace("f(", &format!("{name}("))));
    let extra = ["x^3", "abs(x)^2.5", "1 / (1 + x^2)", "x / (2 + x)"].map(str::to_owned);
    all.filter(|call| Interpreted::from_source(&source(call, INNER[0])).is_ok()).chain(extra).collect()
}

/// Checks random inputs in one precision.
fn check<S: Float + Into<f64>>(element: &Interpreted, what: &str, decades: f64, seed: u64) {
    let count = std::env::var("RANGE_INPUTS").ok().and_then(|count| count.parse().ok()).unwrap_or(INPUTS);
    let mut random = Random(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1);
    for _ in 0..count {
        let numbers = [(); 4].map(|()| random.number(decades));
        let numbers = numbers.map(|number| S::from_f64(number));
        let inputs = Inputs { parameters: &numbers[..1], rest: &[], positions: &numbers[1..], velocities: &[] };
        for routine in ["value", "gradient", "hessian"] {
            let (blocks, flags) = element.routine(routine, &inputs).expect("no rest shape").expect("an energy");
            let is_finite = blocks.iter().flatten().all(|&number| Into::<f64>::into(number).is_finite());
            let is_flagged = (flags.degenerate | flags.kink).any();
            assert!(is_finite || is_flagged, "{what}: {routine} at {numbers:?}: {blocks:?}");
        }
    }
}

#[test]
fn results_are_finite_or_flagged() {
    let calls = calls();
    assert!(calls.len() > 60, "few functions have scalar results: {calls:?}");
    let mut formulas = 0;
    for (number, call) in calls.iter().enumerate() {
        for (form, inner) in INNER.into_iter().enumerate() {
            let Ok(mut elements) = Interpreted::from_source(&source(call, inner)) else { continue };
            let (element, seed) = (elements.remove(0), (6 * number + form) as u64);
            let what = format!("{call} of x = {inner}");
            check::<f64>(&element, &what, 300.0, seed);
            check::<f32>(&element, &what, 37.0, seed);
            formulas += 1;
        }
    }
    println!("{} calls, {formulas} formulas", calls.len());
}
