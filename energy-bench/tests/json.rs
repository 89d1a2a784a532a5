//! A quick run of the program writes the documented JSON.

use std::process::Command;

use serde_json::Value;

const KERNELS: [&str; 5] = ["K1", "K2", "K3", "K4", "K5"];
/// Kernels with a rest shape where textbook gradients cancel.
const WITH_REST: [&str; 3] = ["K1", "K2", "K3"];

fn run() -> Value {
    let file = std::env::temp_dir().join(format!("energy-bench-{}.json", std::process::id()));
    let output = Command::new(env!("CARGO_BIN_EXE_bench")).args(["--quick", "--json"]).arg(&file).output();
    let output = output.expect("the program runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = std::fs::read_to_string(&file).expect("the program wrote the file");
    std::fs::remove_file(&file).expect("the file can be removed");
    serde_json::from_str(&text).expect("the file is JSON")
}

/// The texts under `key` of all objects in a list.
fn texts<'a>(list: &'a Value, key: &str) -> Vec<&'a str> {
    list.as_array().expect("a list").iter().map(|entry| entry[key].as_str().expect("a text")).collect()
}

fn positive(value: &Value) -> bool {
    value.as_f64().is_some_and(|number| number > 0.0)
}

fn check_times(kernel: &Value, levels: &[&str]) {
    let contenders = texts(&kernel["times"], "contender");
    for name in ["generated, plain method", "hand-derived, plain function", "num-dual"] {
        assert!(contenders.contains(&name), "{name} is not in {contenders:?}");
    }
    for level in levels {
        for loops in ["scalar", "f64 lanes", "f32 lanes"] {
            for source in ["generated", "hand-derived"] {
                let name = format!("{source}, {loops}, {level}");
                assert!(contenders.contains(&name.as_str()), "{name} is not in {contenders:?}");
            }
        }
    }
    for time in kernel["times"].as_array().expect("a list") {
        assert!(positive(&time["nanoseconds"]) && positive(&time["least"]), "{time}");
        assert!(time["least"].as_f64() <= time["nanoseconds"].as_f64(), "{time}");
    }
}

/// Kernels without a rest shape have no uncompensated form.
fn sources(has_rest: bool) -> Vec<&'static str> {
    let all = ["generated", "uncompensated", "hand-derived", "num-dual"];
    all.into_iter().filter(|source| has_rest || *source != "uncompensated").collect()
}

#[test]
fn a_quick_run_writes_the_documented_json() {
    let report = run();
    assert_eq!((&report["elements"], &report["repetitions"]), (&Value::from(32), &Value::from(3)));
    let levels: Vec<&str> =
        report["levels"].as_array().expect("a list").iter().map(|level| level.as_str().expect("a text")).collect();
    assert!(!levels.is_empty());
    let notes = report["notes"].as_array().expect("a list");
    assert!(notes.iter().any(|note| note.as_str().is_some_and(|note| note.contains("--python"))), "{notes:?}");
    assert_eq!(texts(&report["kernels"], "key"), KERNELS);
    for kernel in report["kernels"].as_array().expect("a list") {
        let key = kernel["key"].as_str().expect("a text");
        let has_rest = WITH_REST.contains(&key);
        assert!(kernel["title"].is_string());
        assert!(["operations", "instructions", "difference"].iter().all(|name| positive(&kernel[*name])), "{kernel}");
        assert!(kernel["divisions_and_roots"].is_u64());
        check_times(kernel, &levels);

        let near_rest = texts(&kernel["near_rest"], "source");
        assert_eq!(near_rest, if has_rest { sources(true) } else { Vec::new() }, "{key}");
        assert!(kernel["near_rest"].as_array().expect("a list").iter().all(|error| error["roundoffs"].is_number()));

        assert_eq!(texts(&kernel["coincident"], "source"), sources(has_rest), "{key}");
        let verdicts = texts(&kernel["coincident"], "verdict");
        assert_eq!(verdicts[0], "right", "{key}: generated code at coincident points");
        assert!(verdicts.iter().all(|verdict| ["right", "NaN", "wrong"].contains(verdict)), "{verdicts:?}");
    }
}
