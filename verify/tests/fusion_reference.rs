//! The residuals of body tracking against multi-precision values.

use std::path::Path;

use verify::reference::fusion_reference;

fn file() -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("data/fusion/reference.json")
}

#[test]
fn every_family_keeps_its_digits() {
    let lines = fusion_reference(&file()).unwrap();
    for family in ["exp", "dqb", "nonrigid", "lbs_plane", "graph", "binding", "huber", "system"] {
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
fn a_wrong_digit_is_found_and_a_broken_file_refused() {
    let text = std::fs::read_to_string(file()).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("reference.json");
    let mut value: serde_json::Value = serde_json::from_str(&text).unwrap();
    value["graph"][0]["out"]["J"][0][1] = "1".into();
    std::fs::write(&path, value.to_string()).unwrap();
    let lines = fusion_reference(&path).unwrap();
    let failed: Vec<_> = lines.iter().filter(|line| !line.passed()).map(|l| (l.family, l.array.as_str())).collect();
    assert_eq!(failed, [("graph", "J")]);
    value["graph"][0]["theta_i"] = "none".into();
    std::fs::write(&path, value.to_string()).unwrap();
    let error = fusion_reference(&path).unwrap_err().to_string();
    assert!(error.contains("graph-pub-0") && error.contains("theta_i"), "{error}");
}
