//! Known answers: what cloth does that theory can say exactly, measured on the simulator.
//!
//! Each file holds one of them. Static shapes are found by Newton's method on the energy with a direct solver; motions are stepped.

mod banded;
mod cantilever;
mod catenary;
mod critical_load;
mod delaunay;
mod elastica;
mod equilibrium;
mod hanging_strip;
mod lateral_buckling;
mod long_run;
mod modes;
mod momentum;
mod orders;
mod special;
mod strip;

use energy_solve::{EvaluationError, ListError, SystemError};

pub use cantilever::Cantilever;
pub use elastica::Elastica;
pub use lateral_buckling::LateralBuckling;
pub(crate) use orders::runge_kutta;
pub use strip::{MeshKind, Strip};

use crate::fabric::FabricError;
use crate::integrator::StepError;
use crate::mesh::MeshError;

/// One answer, measured.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// What was asked.
    pub question: &'static str,
    /// Of what.
    pub case: String,
    /// What the simulator says.
    pub measured: f64,
    /// What theory says.
    pub exact: f64,
    /// How far apart they are, as `limit` counts it.
    pub error: f64,
    /// How far they may be.
    pub limit: f64,
}

impl Finding {
    /// Whether the error is within its limit.
    #[must_use]
    pub fn passed(&self) -> bool {
        self.error.abs() <= self.limit
    }

    /// The error is measured/exact − 1.
    fn relative(question: &'static str, case: String, measured: f64, exact: f64, limit: f64) -> Self {
        Self { question, case, measured, exact, error: measured / exact - 1.0, limit }
    }

    /// The error is measured − exact.
    fn absolute(question: &'static str, case: String, measured: f64, exact: f64, limit: f64) -> Self {
        Self { question, case, measured, exact, error: measured - exact, limit }
    }
}

/// A case that could not be set up or solved.
#[derive(Debug, thiserror::Error)]
pub enum ValidateError {
    /// A mesh.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// A fabric.
    #[error(transparent)]
    Fabric(#[from] FabricError),
    /// A list of elements.
    #[error(transparent)]
    List(#[from] ListError),
    /// A sum of terms.
    #[error(transparent)]
    System(#[from] SystemError),
    /// Forces or energies.
    #[error(transparent)]
    Evaluation(#[from] EvaluationError),
    /// A step.
    #[error(transparent)]
    Step(#[from] StepError),
    /// A strip that its triangles do not cover.
    #[error("the triangles cover {area:.6} m² of {strip:?}; choose a width of some spacings, or another spacing")]
    Strip {
        /// The strip.
        strip: Strip,
        /// What is covered, in m².
        area: f64,
    },
    /// No equilibrium was found.
    #[error(
        "no equilibrium: a vertex still feels {force:.2e} N, of {weight:.2e} N in all; try more segments or a smaller load"
    )]
    NoEquilibrium {
        /// The largest force left, in N.
        force: f64,
        /// The weight, in N.
        weight: f64,
    },
    /// No instability was found.
    #[error("{what} is stable up to Γ = {gamma}")]
    Stable {
        /// What was loaded.
        what: &'static str,
        /// The largest load tried.
        gamma: f64,
    },
}

/// The questions.
pub const QUESTIONS: [&str; 8] =
    ["cantilever", "buckling", "catenary", "hanging-strip", "modes", "orders", "momentum", "long-run"];

/// Asks the questions named (all, if none is), telling each finding as it is made. `quick` leaves out the finer meshes.
///
/// # Errors
/// When a case cannot be set up or solved.
pub fn ask(names: &[String], quick: bool, mut tell: impl FnMut(&Finding)) -> Result<Vec<Finding>, ValidateError> {
    type Ask = fn(bool, &mut dyn FnMut(Finding)) -> Result<(), ValidateError>;
    let all: [Ask; 8] = [
        cantilever::ask,
        lateral_buckling::ask,
        catenary::ask,
        hanging_strip::ask,
        modes::ask,
        orders::ask,
        momentum::ask,
        long_run::ask,
    ];
    let mut findings = Vec::new();
    for (name, ask) in QUESTIONS.into_iter().zip(all) {
        if names.is_empty() || names.iter().any(|wanted| wanted == name) {
            ask(quick, &mut |finding| {
                tell(&finding);
                findings.push(finding);
            })?;
        }
    }
    Ok(findings)
}

/// The head of the table that [`line()`] makes.
#[must_use]
pub fn head() -> String {
    format!(
        "{:<18} {:<46} {:>15} {:>15} {:>10} {:>8}  verdict",
        "question", "case", "measured", "exact", "error", "limit"
    )
}

/// One finding as a line.
#[must_use]
pub fn line(finding: &Finding) -> String {
    format!(
        "{:<18} {:<46} {:>15.8} {:>15.8} {:>+10.1e} {:>8.0e}  {}",
        finding.question,
        finding.case,
        finding.measured,
        finding.exact,
        finding.error,
        finding.limit,
        if finding.passed() { "ok" } else { "FAILED" }
    )
}
