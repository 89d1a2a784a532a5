use serde::Serialize;

use crate::blocks::BlockName;

/// What is looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Check {
    /// Equal to hyper-dual numbers run through the textbook form.
    DualNumbers,
    /// Equal to finite differences of the block one order below.
    FiniteDifferences,
    /// Exactly symmetric.
    Symmetry,
    /// Σ f = 0.
    LinearMomentum,
    /// Σ x × f = 0.
    AngularMomentum,
    /// The declaration keeps what it claims: invariance, no force at rest, evenness.
    Claims,
    /// No number is NaN or infinite, and no condition is flagged, at an ordinary input.
    Finite,
}

impl Check {
    /// How a person calls it.
    #[must_use]
    pub fn title(self) -> &'static str {
        match self {
            Self::DualNumbers => "dual numbers",
            Self::FiniteDifferences => "finite differences",
            Self::Symmetry => "symmetry",
            Self::LinearMomentum => "Σ f = 0",
            Self::AngularMomentum => "Σ x × f = 0",
            Self::Claims => "claims",
            Self::Finite => "finite",
        }
    }

    /// The largest error allowed, relative to the largest number of the block (or of what is summed).
    #[must_use]
    pub fn tolerance(self) -> f64 {
        match self {
            // The textbook form loses digits: what it leaves of them.
            Self::DualNumbers => 1e-9,
            Self::FiniteDifferences => 2e-7,
            Self::Claims => 1e-10,
            Self::Symmetry | Self::Finite => 0.0,
            Self::LinearMomentum => 16.0 * f64::EPSILON / 2.0,
            Self::AngularMomentum => 1e-11,
        }
    }
}

/// One line of the report: the worst of a check of a block over all samples.
#[derive(Clone, Debug, Serialize)]
pub struct Line {
    /// The element.
    pub element: &'static str,
    /// The block.
    pub block: BlockName,
    /// What was checked.
    pub check: Check,
    /// The worst relative error.
    pub worst: f64,
    /// The error allowed.
    pub tolerance: f64,
    /// Whether it held.
    pub passed: bool,
    /// The least order of convergence that was observed, of finite differences.
    pub order: Option<f64>,
    /// Which entry, both values, and the input they were found at.
    pub detail: String,
}

/// The audit of one or more elements.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Report {
    /// All lines, element by element.
    pub lines: Vec<Line>,
    /// Elements that could not be audited, with the reason.
    pub refused: Vec<(String, String)>,
}

impl Report {
    /// Whether every check of every element held.
    #[must_use]
    pub fn passed(&self) -> bool {
        self.refused.is_empty() && self.lines.iter().all(|line| line.passed)
    }

    /// The lines that failed.
    pub fn failures(&self) -> impl Iterator<Item = &Line> {
        self.lines.iter().filter(|line| !line.passed)
    }

    /// How many different elements the report is about.
    #[must_use]
    pub fn elements(&self) -> usize {
        let mut names: Vec<&str> =
            self.lines.iter().map(|l| l.element).chain(self.refused.iter().map(|(name, _)| name.as_str())).collect();
        names.sort_unstable();
        names.dedup();
        names.len()
    }
}

/// A failed check in words.
#[must_use]
pub fn describe_failure(line: &Line) -> String {
    format!(
        "{}: {} of block `{}` fails: error {:.2e}, allowed {:.2e}\n{}",
        line.element,
        line.check.title(),
        line.block,
        line.worst,
        line.tolerance,
        line.detail
    )
}
