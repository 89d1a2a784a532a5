//! Operations and compile time grow polynomially with the size of a formula. The test prints the curve:
//! `cargo test --release -p energy-compiler --test all growth -- --nocapture`.

use std::fmt::Write as _;
use std::time::{Duration, Instant};

use super::random::Random;
use energy_compiler::Listing;

/// A chain of `size` lets over `points` points, each a random operation on two of the values before it.
fn program(size: usize, points: usize, seed: u64) -> String {
    let mut random = Random(seed);
    let names: Vec<String> = (0..points).map(|i| format!("p{i}")).collect();
    let mut text = format!("energy Growth({}: Point; k: Scalar) {{ let _s0 = k; ", names.join(", "));
    for i in 1..=points {
        write!(text, "let _s{i} = norm_squared(p{} - p{}); ", i % points, i - 1).expect("writing to a string succeeds");
    }
    for i in points + 1..=points + size {
        // Uses the previous value, so that nothing is dead.
        let (a, b) = (i - 1, random.below(i));
        let value = match random.below(7) {
            0 => format!("_s{a} * _s{b}"),
            1 => format!("_s{a} + _s{b}"),
            2 => format!("sin(_s{a}) * _s{b}"),
            3 => format!("sqrt(1 + _s{a}^2)"),
            4 => format!("_s{a} / (1 + _s{b}^2)"),
            5 => format!("_s{a} - k * _s{b}"),
            _ => format!("log(2 + _s{a}^2) + _s{b}"),
        };
        write!(text, "let _s{i} = {value}; ").expect("writing to a string succeeds");
    }
    write!(text, "_s{} }}", points + size).expect("writing to a string succeeds");
    text
}

/// Returns the number of operations of the Hessian and the compile time.
fn compiled(size: usize, points: usize, seed: u64) -> (usize, Duration) {
    let source = program(size, points, seed);
    let start = Instant::now();
    let listing = Listing::from_source(&source).expect("a sound program").remove(0);
    let elapsed = start.elapsed();
    let counts = listing.counts();
    let line = counts.lines().find(|line| line.trim_start().starts_with("hessian ")).expect("it has a Hessian");
    (line.split_whitespace().nth(1).expect("a count").parse().expect("a number"), elapsed)
}

#[test]
fn operations_grow_with_the_formula_and_the_square_of_its_coordinates() {
    println!("{:>6} {:>12} {:>12} {:>10}", "lets", "coordinates", "operations", "ms");
    for points in [2, 4, 8] {
        let coordinates = 3 * (points - 1);
        let mut before: Option<usize> = None;
        for size in [10, 20, 40, 80, 160] {
            let runs: Vec<_> = (1..4).map(|seed| compiled(size, points, 0x9e37_79b9 + seed)).collect();
            let operations = runs.iter().map(|(operations, _)| operations).sum::<usize>() / runs.len();
            let time = runs.iter().map(|(_, time)| *time).max().expect("three runs");
            println!("{size:>6} {coordinates:>12} {operations:>12} {:>10.1}", time.as_secs_f64() * 1e3);
            // Each let adds at most a constant number of operations per entry of the Hessian.
            let most = 6 * (size + 4) * (coordinates + 2) * (coordinates + 2);
            assert!(
                operations <= most,
                "{size} lets, {coordinates} coordinates: {operations} operations, at most {most}"
            );
            if let Some(before) = before {
                assert!(operations <= 3 * before, "from {before} to {operations} operations when the formula doubled");
            }
            before = Some(operations);
        }
    }
}

/// Compile time is at most quadratic in the number of lets: four times as many take at most 16 times as long. The
/// fastest of three runs counts, so that a busy machine does not decide.
#[test]
fn compile_time_is_at_most_quadratic_in_the_length_of_a_formula() {
    let fastest = |size: usize| {
        let runs = (0..3).map(|_| compiled(size, 4, 0x9e37_79b9).1);
        runs.min().expect("three runs").as_secs_f64()
    };
    let (short, long) = (fastest(40), fastest(160));
    let ratio = long / short;
    println!("40 lets: {:.1} ms, 160 lets: {:.1} ms, ratio {ratio:.1}", 1e3 * short, 1e3 * long);
    assert!(ratio <= 16.0, "160 lets take {ratio:.1} times as long to compile as 40");
}

#[test]
fn sums_that_share_their_terms_are_visited_once() {
    let mut text = "energy Shared(x0, x1, x2, x3: Point; k: Scalar) { let _s0 = x1 - x0; ".to_owned();
    for i in 1..=60 {
        write!(text, "let _s{i} = _s{} + k * _s{}; ", i - 1, i - 1).expect("writing to a string succeeds");
    }
    text += "let G = inverse(columns(_s60, x2 - x0, x3 - x0)); ddot(G, G) }";
    let start = Instant::now();
    assert!(Listing::from_source(&text).is_ok());
    // There are 2⁶⁰ paths.
    assert!(start.elapsed() < Duration::from_secs(60));
}
