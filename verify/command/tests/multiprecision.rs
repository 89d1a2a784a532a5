//! Multi-precision results against recorded reference values, and against the other two routes.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use serde_json::Value;
use verify_command::reference::{Source, Truth, evaluate_file};

fn data() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../data/potentials")
}

fn json(path: &Path) -> Value {
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

fn numbers(block: &Value) -> Vec<Truth> {
    let text = |v: &Value| v.as_str().unwrap().parse().unwrap();
    block.as_array().map_or_else(|| vec![text(block)], |list| list.iter().map(text).collect())
}

/// Returns the difference of two numbers in twice double precision.
fn distance(a: Truth, b: Truth) -> f64 {
    ((a.high - b.high) + (a.low - b.low)).abs()
}

/// Compares one file. Returns the numbers of records and blocks.
fn check(path: &Path, folder: &Path) -> (usize, usize) {
    let name = path.file_name().unwrap().to_str().unwrap();
    let out = folder.join(name);
    evaluate_file(path, &out, Source::Truth { digits: 50 }).unwrap();
    let (reference, computed) = (json(path), json(&out));
    let (mut records, mut blocks) = (0, 0);
    for (wanted, got) in reference["records"].as_array().unwrap().iter().zip(computed["records"].as_array().unwrap()) {
        let got = got["out"].as_object().unwrap();
        records += usize::from(!got.is_empty());
        for (block, digits) in got {
            let (wanted, got) = (numbers(&wanted["out"][block]), numbers(digits));
            let largest = wanted.iter().map(|t| t.high.abs()).fold(0.0, f64::max);
            blocks += 1;
            if largest > 1e-280 && largest.is_finite() {
                let worst = wanted.iter().zip(&got).map(|(a, b)| distance(*a, *b)).fold(0.0, f64::max);
                let potential = &reference["potential"];
                assert!(worst <= 1e-28 * largest, "{name} {potential} {block}: {:e}", worst / largest);
            } else {
                // Both are zero, or both are beyond the range of doubles.
                assert!(wanted.iter().zip(&got).all(|(a, b)| a.high == b.high || largest > 0.0), "{name} {block}");
            }
        }
    }
    (records, blocks)
}

#[test]
fn every_reference_value_is_reproduced_to_full_precision() {
    let folder = tempfile::tempdir().unwrap();
    let paths = std::fs::read_dir(data()).unwrap().map(|entry| entry.unwrap().path());
    let files: Vec<PathBuf> =
        paths.filter(|path| path.extension().is_some_and(|e| e == "json") && !path.ends_with("policy.json")).collect();
    let next = AtomicUsize::new(0);
    let work = || {
        let mut counted = (0, 0);
        while let Some(path) = files.get(next.fetch_add(1, Ordering::Relaxed)) {
            let (records, blocks) = check(path, folder.path());
            counted = (counted.0 + records, counted.1 + blocks);
        }
        counted
    };
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    let (records, blocks) = std::thread::scope(|scope| {
        let workers: Vec<_> = (0..threads).map(|_| scope.spawn(work)).collect();
        let counts = workers.into_iter().map(|worker| worker.join().expect("its message is printed above"));
        counts.fold((0, 0), |sum, one| (sum.0 + one.0, sum.1 + one.1))
    });
    assert!(records >= 500 && blocks >= 1500, "{records} records, {blocks} blocks");
}
