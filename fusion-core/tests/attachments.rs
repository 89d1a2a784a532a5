//! Smoothing of attachments against exact fractions, from the file that `verify reference` reads.

use std::path::Path;

use fusion_core::model::Attachments;
use serde_json::Value;

fn rows(value: &Value) -> Vec<Vec<f64>> {
    let number = |x: &Value| x.as_str().map_or_else(|| x.as_f64().unwrap(), |text| text.parse().unwrap());
    value.as_array().unwrap().iter().map(|row| row.as_array().unwrap().iter().map(number).collect()).collect()
}

fn flags(value: &Value) -> Vec<bool> {
    value.as_array().unwrap().iter().map(|flag| flag.as_bool().unwrap()).collect()
}

fn assert_close(found: &Attachments, entry: &Value, what: &str) {
    assert_eq!(found.assigned, flags(&entry["assigned"]), "{what}");
    for (found, truth) in found.rows.iter().flatten().zip(rows(&entry["H"]).iter().flatten()) {
        assert!((found - truth).abs() <= 4.0 * f64::EPSILON, "{what}: {found} for {truth}");
    }
}

#[test]
fn fill_and_relax_as_in_the_reference() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../verify/data/fusion/reference.json");
    let file: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let cases = file["hsmooth"].as_array().unwrap();
    assert_eq!(cases.len(), 3);
    for case in cases {
        let id = case["id"].as_str().unwrap();
        let graph: Vec<Vec<usize>> = rows(&case["neighbors"])
            .into_iter()
            .map(|around| around.into_iter().map(|neighbour| neighbour as usize).collect())
            .collect();
        let mut h = Attachments { rows: rows(&case["H0"]), assigned: flags(&case["assigned0"]) };
        let mut passes = 0;
        for entry in case["out"]["history"].as_array().unwrap() {
            match entry["phase"].as_str().unwrap() {
                "fill" => {
                    h.fill_once(&graph);
                    passes += 1;
                }
                "relax" => h.relax_once(&graph),
                other => assert_eq!(other, "init", "{id}"),
            }
            assert_close(&h, entry, id);
        }
        let mut whole = Attachments { rows: rows(&case["H0"]), assigned: flags(&case["assigned0"]) };
        let report = whole.fill(&graph);
        // If a fill stalls, the reference also counts the pass that changes nothing.
        let stalled = usize::from(!report.left.is_empty());
        assert_eq!(
            report.passes + stalled,
            rows(&serde_json::json!([[case["out"]["fill_iters"]]]))[0][0] as usize,
            "{id}"
        );
        assert!(passes >= report.passes);
        assert_eq!(report.left.len(), whole.assigned.iter().filter(|&&assigned| !assigned).count());
    }
}
