//! The multi-precision truth against reference values that were computed elsewhere, record by record, and against the other two
//! routes.

use std::path::{Path, PathBuf};

use serde_json::Value;
use verify::reference::{Source, Truth, evaluate_file};

fn data() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("data/potentials")
}

fn json(path: &Path) -> Value {
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

fn numbers(block: &Value) -> Vec<Truth> {
    let text = |v: &Value| v.as_str().unwrap().parse().unwrap();
    block.as_array().map_or_else(|| vec![text(block)], |list| list.iter().map(text).collect())
}

/// How far apart two numbers of twice the precision of a double are.
fn distance(a: Truth, b: Truth) -> f64 {
    ((a.high - b.high) + (a.low - b.low)).abs()
}

#[test]
fn every_reference_value_comes_out_to_its_last_digits() {
    let folder = tempfile::tempdir().unwrap();
    let (mut records, mut blocks) = (0, 0);
    for entry in std::fs::read_dir(data()).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_str().unwrap().to_owned();
        if name == "policy.json" || !name.ends_with(".json") {
            continue;
        }
        let out = folder.path().join(&name);
        evaluate_file(&path, &out, Source::Truth { digits: 50 }).unwrap();
        let (reference, computed) = (json(&path), json(&out));
        for (wanted, got) in
            reference["records"].as_array().unwrap().iter().zip(computed["records"].as_array().unwrap())
        {
            let got = got["out"].as_object().unwrap();
            records += usize::from(!got.is_empty());
            for (block, digits) in got {
                let (wanted, got) = (numbers(&wanted["out"][block]), numbers(digits));
                let largest = wanted.iter().map(|t| t.high.abs()).fold(0.0, f64::max);
                blocks += 1;
                if largest > 1e-280 && largest.is_finite() {
                    let worst = wanted.iter().zip(&got).map(|(a, b)| distance(*a, *b)).fold(0.0, f64::max);
                    assert!(
                        worst <= 1e-28 * largest,
                        "{name} {} {block}: {:e}",
                        reference["potential"],
                        worst / largest
                    );
                } else {
                    // Zero where it is zero; beyond the doubles, both are.
                    assert!(wanted.iter().zip(&got).all(|(a, b)| a.high == b.high || largest > 0.0), "{name} {block}");
                }
            }
        }
    }
    assert!(records >= 500 && blocks >= 1500, "{records} records, {blocks} blocks");
}
