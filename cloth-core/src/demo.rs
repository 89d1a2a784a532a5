//! The demonstration: a horizontal cotton sheet, hung by two corners, made of elements that are audited first.

use std::fmt::Write as _;

use verify::audit::{Check, Options, Report, audit_all, describe_failure, targets_in};

use crate::materials::ELEMENTS;
use crate::scene::{Scene, SceneError};
use crate::simulation::Simulation;

/// The demonstration's scene: a copy of `scenes/hang.toml`, so that the crate is complete on its own.
pub const SCENE: &str = include_str!("hang.toml");

/// Returns the scene.
///
/// # Errors
/// Returns an error only if the built-in file is invalid.
pub fn scene() -> Result<Scene, SceneError> {
    Scene::parse(SCENE, "scenes/hang.toml".as_ref())
}

/// Elements with wrong derivatives, or that could not be audited.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the audit failed; nothing was simulated\n{0}")]
#[non_exhaustive]
pub struct AuditError(String);

/// Audits every declared element of a simulation. Returns a table of errors relative to independent derivatives.
///
/// # Errors
/// Returns an error if a check fails, with the element, the entry and both values.
pub fn audit_materials(simulation: &Simulation) -> Result<String, AuditError> {
    let mut elements: Vec<&str> = simulation.terms().map(|term| &*term.declaration().name).collect();
    elements.sort_unstable();
    elements.dedup();
    let options = Options::default();
    let targets = targets_in(ELEMENTS, &elements).map_err(AuditError)?;
    let report = audit_all(&targets, None, options);
    if !report.passed() {
        return Err(AuditError(failures(&report)));
    }
    let mut text = format!("audit of {} elements on {} random inputs each: passed\n", elements.len(), options.samples);
    for element in elements {
        let worst = |check| worst_error(&report, element, check);
        writeln!(
            text,
            "  {element:<20} worst relative error {} by dual numbers, {} by finite differences",
            worst(Check::DualNumbers),
            worst(Check::FiniteDifferences),
        )
        .expect("writing to a string succeeds");
    }
    Ok(text)
}

fn failures(report: &Report) -> String {
    let failed = report.failures().map(describe_failure);
    let refused = report.refused.iter().map(|(element, reason)| format!("{element}: {reason}"));
    failed.chain(refused).collect::<Vec<_>>().join("\n")
}

fn worst_error(report: &Report, element: &str, check: Check) -> String {
    let lines = report.lines.iter().filter(|line| line.element == element && line.check == check);
    lines.map(|line| line.worst).reduce(f64::max).map_or("–".into(), |worst| format!("{worst:.0e}"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_scene_is_that_of_the_gallery() {
        let gallery = std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/../scenes/hang.toml")).unwrap();
        assert_eq!(SCENE, gallery);
    }

    #[test]
    fn the_audit_covers_what_the_demonstration_is_made_of() {
        let text = audit_materials(&Simulation::new(&scene().unwrap()).unwrap()).unwrap();
        for element in ["YarnMembrane", "ArcAngle", "Gravity", "ViscousDrag"] {
            assert!(text.contains(element), "{text}");
        }
    }
}
