//! The command `verify`, for texts.

use energy_compiler::Listing;
use pyo3::prelude::*;
use verify::audit::{Options, Target, audit_all, describe_failure};

use crate::errors::wrong;

/// Audits all declarations of a text. Returns whether all checks passed, the report as JSON, and each failure in words.
#[pyfunction]
#[pyo3(signature = (text, quick = false, seed = 1, file = "<text>"))]
pub fn audit(py: Python<'_>, text: &str, quick: bool, seed: u64, file: &str) -> PyResult<(bool, String, Vec<String>)> {
    let targets = Target::of_text(text, file).map_err(wrong)?;
    let options = match quick {
        true => Options { seed, ..Options::quick() },
        false => Options { declared_samples: true, seed, ..Options::default() },
    };
    let report = py.detach(|| audit_all(&targets, None, options));
    let refused = report.refused.iter().map(|(name, why)| format!("{name} cannot be audited: {why}"));
    let failures = refused.chain(report.failures().map(describe_failure)).collect();
    Ok((report.passed(), serde_json::to_string(&report).map_err(wrong)?, failures))
}

/// Returns the generated Rust code of all declarations of a text.
#[pyfunction]
#[pyo3(signature = (text, file = "<text>"))]
pub fn show(text: &str, file: &str) -> PyResult<String> {
    let listings = Listing::from_file(text, file).map_err(wrong)?;
    Ok(listings.iter().map(Listing::code).collect::<Vec<_>>().join("\n"))
}
