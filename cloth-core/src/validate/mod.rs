//! Validation against exact results of the theory of strips, sheets and motions.
//!
//! One file per question. Static shapes are computed by Newton's method on the energy, with a direct solver; motions
//! are simulated.

mod balloon;
mod bodies;
mod cantilever;
mod capstan;
mod catenary;
mod contact;
mod critical_load;
mod delaunay;
mod elastica;
mod equilibrium;
mod fold;
mod hanging_strip;
mod held;
mod impacts;
mod knots;
mod lateral_buckling;
mod linking;
mod locking;
mod long_run;
mod modes;
mod momentum;
mod orders;
mod rods;
mod shells;
mod special;
mod stack;
mod stick_slip;
mod strip;
mod thinner;

use energy_solve::{
    CholeskyError, EvaluationError, ListError, MixedError, MixedNewtonError, MixedNewtonReport, SingularPivot,
    SystemError,
};

pub use cantilever::Cantilever;
pub use elastica::Elastica;
pub use lateral_buckling::LateralBuckling;
pub(crate) use orders::runge_kutta;
pub use strip::{MeshKind, Strip};

use crate::fabric::FabricError;
use crate::integrator::StepError;
use crate::mesh::MeshError;
use crate::scene::SceneError;
use crate::simulation::SimulationError;

/// A measured result with its exact value.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// The question, as on the command line or in the table.
    pub question: &'static str,
    /// The case within the question.
    pub case: String,
    /// The simulator's result.
    pub measured: f64,
    /// The exact result.
    pub exact: f64,
    /// The error, relative or absolute.
    pub error: f64,
    /// The largest acceptable error.
    pub limit: f64,
}

impl Finding {
    /// Whether the error is within its limit.
    #[must_use]
    pub fn passed(&self) -> bool {
        self.error.abs() <= self.limit
    }

    /// Creates a finding with the error measured/exact − 1.
    fn relative(question: &'static str, case: String, measured: f64, exact: f64, limit: f64) -> Self {
        Self { question, case, measured, exact, error: measured / exact - 1.0, limit }
    }

    /// Creates a finding of the order with which an error falls from a coarse mesh to one that is finer by a factor. It
    /// is 2, and must be 1.8 at least.
    fn order(question: &'static str, case: &str, [coarse, fine]: [f64; 2], finer: f64) -> Self {
        let measured = (coarse / fine).abs().ln() / finer.ln();
        let error = (1.8 - measured).max(0.0);
        Self { question, case: format!("{case}: order"), measured, exact: 2.0, error, limit: 0.0 }
    }

    /// Creates a finding with the error measured − exact.
    fn absolute(question: &'static str, case: String, measured: f64, exact: f64, limit: f64) -> Self {
        Self { question, case, measured, exact, error: measured - exact, limit }
    }
}

/// A case that cannot be set up or solved.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
#[non_exhaustive]
pub enum ValidateError {
    /// The mesh is invalid.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// The fabric does not fit the mesh.
    #[error(transparent)]
    Fabric(#[from] FabricError),
    /// Elements and stencils do not match.
    #[error(transparent)]
    List(#[from] ListError),
    /// The terms cannot be assembled into a system.
    #[error(transparent)]
    System(#[from] SystemError),
    /// Forces or energies cannot be evaluated.
    #[error(transparent)]
    Evaluation(#[from] EvaluationError),
    /// A Hessian cannot be factored.
    #[error(transparent)]
    Factor(#[from] CholeskyError),
    /// A step failed.
    #[error(transparent)]
    Step(#[from] StepError),
    /// A body of mixed unknowns is set up wrongly, or cannot be evaluated.
    #[error(transparent)]
    Mixed(#[from] MixedError),
    /// A search for an equilibrium of mixed unknowns failed.
    #[error(transparent)]
    MixedNewton(#[from] MixedNewtonError),
    /// The Hessian of mixed unknowns cannot be factored.
    #[error(transparent)]
    Pivot(#[from] SingularPivot),
    /// The rest shape of an element is degenerate.
    #[error(transparent)]
    Rest(#[from] energy_dsl::RestError),
    /// A rod or a shell has no equilibrium that was found.
    #[error("no equilibrium after {} iterations: {:?}", .0.iterations, .0.stopped)]
    NoRest(MixedNewtonReport),
    /// A scene is invalid.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// A scene cannot be simulated.
    #[error(transparent)]
    Simulation(#[from] SimulationError),
    /// The triangles do not cover the strip.
    #[error("the triangles cover {area:.6} m² of {strip:?}; choose a width of several spacings, or another spacing")]
    Strip {
        strip: Strip,
        /// The covered area, in m².
        area: f64,
    },
    /// The search for an equilibrium did not converge.
    #[error(
        "no equilibrium: a vertex still feels {force:.2e} N of {weight:.2e} N in all; \
         try more segments or a smaller load"
    )]
    NoEquilibrium {
        /// The largest remaining force, in N.
        force: f64,
        /// The total weight, in N.
        weight: f64,
    },
    /// The structure does not become unstable.
    #[error("{what} is stable up to Γ = {gamma}")]
    Stable {
        what: &'static str,
        /// The largest load tried.
        gamma: f64,
    },
}

/// Names of the questions.
pub const QUESTIONS: [&str; 13] = [
    "cantilever",
    "buckling",
    "catenary",
    "hanging-strip",
    "modes",
    "rods",
    "bodies",
    "shells",
    "orders",
    "momentum",
    "contact",
    "locking",
    "long-run",
];

/// Answers the named questions, or all if `names` is empty, and calls `report` with each finding. `quick` skips the
/// finer meshes.
///
/// # Errors
/// Returns an error if a case cannot be set up or solved.
pub fn ask(names: &[String], quick: bool, mut report: impl FnMut(&Finding)) -> Result<Vec<Finding>, ValidateError> {
    type Ask = fn(bool, &mut dyn FnMut(Finding)) -> Result<(), ValidateError>;
    let all: [Ask; 13] = [
        cantilever::ask,
        lateral_buckling::ask,
        catenary::ask,
        hanging_strip::ask,
        modes::ask,
        rods::ask,
        bodies::ask,
        shells::ask,
        orders::ask,
        momentum::ask,
        contact::ask,
        locking::ask,
        long_run::ask,
    ];
    let mut findings = Vec::new();
    for (name, ask) in QUESTIONS.into_iter().zip(all) {
        if names.is_empty() || names.iter().any(|wanted| wanted == name) {
            ask(quick, &mut |finding| {
                report(&finding);
                findings.push(finding);
            })?;
        }
    }
    Ok(findings)
}

/// Returns the header of the table whose rows [`line()`] formats.
#[must_use]
pub fn head() -> String {
    format!(
        "{:<18} {:<46} {:>15} {:>15} {:>10} {:>8}  verdict",
        "question", "case", "measured", "exact", "error", "limit"
    )
}

/// Formats a finding as a row.
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
