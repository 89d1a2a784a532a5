//! Residuals of body tracking against multi-precision values.

use std::path::Path;

use verify_command::reference::{evaluate_fusion, fusion_reference};

fn file() -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../data/fusion/reference.json")
}

#[test]
fn every_family_is_within_its_bound() {
    let lines = fusion_reference(&file()).unwrap();
    for family in ["exp", "dqb", "nonrigid", "lbs_plane", "graph", "binding", "huber", "hsmooth", "system"] {
        assert!(lines.iter().any(|line| line.family == family && line.cases >= 3), "{family}");
    }
    let beyond: Vec<String> = lines
        .iter()
        .filter(|line| !line.passed())
        .map(|l| format!("{} {}: {:e} > {:e} ({})", l.family, l.array, l.worst, l.bound, l.worst_case))
        .collect();
    assert!(beyond.is_empty(), "{}", beyond.join("\n"));
}

#[test]
fn a_wrong_digit_is_found_and_a_broken_file_rejected() {
    let text = std::fs::read_to_string(file()).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("reference.json");
    let mut value: serde_json::Value = serde_json::from_str(&text).unwrap();
    value["graph"][0]["out"]["J"][0][1] = "1".into();
    std::fs::write(&path, value.to_string()).unwrap();
    let lines = fusion_reference(&path).unwrap();
    let failed: Vec<_> = lines.iter().filter(|line| !line.passed()).map(|l| (l.family, l.array.as_str())).collect();
    assert_eq!(failed, [("graph", "J")]);
    value["hsmooth"][0]["out"]["history"][0]["H"][0][0] = "0.5".into();
    value["hsmooth"][1]["out"]["history"].as_array_mut().unwrap().pop();
    std::fs::write(&path, value.to_string()).unwrap();
    let lines = fusion_reference(&path).unwrap();
    let failed: Vec<_> = lines.iter().filter(|line| !line.passed()).map(|l| (l.family, l.array.as_str())).collect();
    assert_eq!(failed, [("graph", "J"), ("hsmooth", "H, fill"), ("hsmooth", "passes")]);
    value["graph"][0]["theta_i"] = "none".into();
    std::fs::write(&path, value.to_string()).unwrap();
    let error = fusion_reference(&path).unwrap_err().to_string();
    assert!(error.contains("graph-pub-0") && error.contains("theta_i"), "{error}");
}

#[test]
fn cases_without_truth_are_evaluated() {
    let folder = tempfile::tempdir().unwrap();
    let (input, output) = (folder.path().join("in.json"), folder.path().join("out.json"));
    let mut value: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(file()).unwrap()).unwrap();
    let families = value.as_object_mut().unwrap();
    families.retain(|family, _| family == "graph" || family == "dqb");
    let truth = families["graph"][0]["out"]["J"].clone();
    for case in families.values_mut().flat_map(|cases| cases.as_array_mut().unwrap()) {
        case.as_object_mut().unwrap().remove("out");
    }
    std::fs::write(&input, value.to_string()).unwrap();
    assert_eq!(evaluate_fusion(&input, &output).unwrap(), Some(14 + 8));
    let written: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(&output).unwrap()).unwrap();
    let number = |value: &serde_json::Value| value.as_str().unwrap().parse::<f64>().unwrap();
    let found: Vec<f64> = written["graph"][0]["out"]["J"].as_array().unwrap().iter().map(number).collect();
    let truth: Vec<f64> = truth.as_array().unwrap().iter().flat_map(|r| r.as_array().unwrap()).map(number).collect();
    assert!(found.iter().zip(&truth).all(|(a, b)| (a - b).abs() < 1e-14) && found.len() == 36);
    std::fs::write(&input, "{}").unwrap();
    assert_eq!(evaluate_fusion(&input, &output).unwrap(), None);
}

#[test]
fn a_family_without_cases_is_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let (path, output) = (folder.path().join("reference.json"), folder.path().join("out.json"));
    let mut value: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(file()).unwrap()).unwrap();
    value["huber"] = serde_json::json!([]);
    std::fs::write(&path, value.to_string()).unwrap();
    for error in [fusion_reference(&path).unwrap_err(), evaluate_fusion(&path, &output).unwrap_err()] {
        assert!(error.to_string().contains("huber: the family has no cases"), "{error}");
    }
    value.as_object_mut().unwrap().remove("huber");
    std::fs::write(&path, value.to_string()).unwrap();
    let error = fusion_reference(&path).unwrap_err().to_string();
    assert!(error.contains("huber: the family is missing"), "{error}");
}

#[test]
fn the_program_evaluates_every_family() {
    let folder = tempfile::tempdir().unwrap();
    let output = folder.path().join("out.json");
    let run = |input: &Path, more: &[&str]| {
        let arguments = ["eval", input.to_str().unwrap(), "-o", output.to_str().unwrap()];
        let run = std::process::Command::new(env!("CARGO_BIN_EXE_verify")).args(arguments).args(more).output().unwrap();
        (run.status.success(), String::from_utf8_lossy(&[run.stdout, run.stderr].concat()).into_owned())
    };
    let (done, printed) = run(&file(), &[]);
    assert!(done && printed.contains("184 records evaluated"), "{printed}");
    let written: serde_json::Value = serde_json::from_str(&std::fs::read_to_string(&output).unwrap()).unwrap();
    for (array, count) in [("H, fill", 42), ("H, relax", 42), ("fill_iters", 1)] {
        assert_eq!(written["hsmooth"][1]["out"][array].as_array().unwrap().len(), count, "{array}");
    }
    let (done, printed) = run(&file(), &["--digits", "30"]);
    assert!(!done && printed.contains("leave out --digits"), "{printed}");
    let other = folder.path().join("other.json");
    std::fs::write(&other, "{}").unwrap();
    let (done, printed) = run(&other, &[]);
    assert!(!done && printed.contains("families of body tracking: exp, dqb"), "{printed}");
}
