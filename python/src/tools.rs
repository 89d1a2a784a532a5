//! The command `verify`, for texts.

use energy_compiler::Listing;
use pyo3::prelude::*;
use verify::audit::{Options, Target, audit_all, describe_failure};

use crate::errors::wrong;
use crate::interrupt::compiled;
use crate::limits::limits_of;

/// Audits all declarations of a text. Returns whether all checks passed, the report as JSON, and each failure in words.
#[pyfunction]
#[pyo3(signature = (text, quick = false, seed = 1, file = "<text>", limits = None))]
pub fn audit(
    py: Python<'_>,
    text: &str,
    quick: bool,
    seed: u64,
    file: &str,
    limits: Option<&Bound<'_, PyAny>>,
) -> PyResult<(bool, String, Vec<String>)> {
    let targets = compiled(py, limits_of(limits)?, |budget| Target::of_text_within(text, file, budget))?;
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
#[pyo3(signature = (text, file = "<text>", *, limits = None))]
pub fn show(py: Python<'_>, text: &str, file: &str, limits: Option<&Bound<'_, PyAny>>) -> PyResult<String> {
    compiled(py, limits_of(limits)?, |budget| {
        let listings = Listing::from_file_within(text, file, budget)?;
        Ok(listings.iter().map(Listing::code).collect::<Vec<_>>().join("\n"))
    })
}
