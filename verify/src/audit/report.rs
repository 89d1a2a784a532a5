use std::borrow::Cow;

use serde::Serialize;

use crate::blocks::BlockName;
use crate::sample::Sample;

/// A property that the audit checks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Check {
    /// Multi-precision agrees as well as the reference demands of every record.
    Accuracy,
    /// Dual numbers through the textbook form agree.
    DualNumbers,
    /// Finite differences of the block one order below agree.
    FiniteDifferences,
    /// Most inputs have differences that stay on one side of every kink; the error is the part that lacks them.
    OneSide,
    /// The values of both sides are equal where branches of the formula meet.
    Continuity,
    /// All routines that return the block agree.
    Routines,
    /// The block is exactly symmetric.
    Symmetry,
    /// Σ f = 0.
    LinearMomentum,
    /// Σ x × f = 0.
    AngularMomentum,
    /// A translation preserves all bits.
    Translation,
    /// A change of units preserves all quantities.
    Units,
    /// Claims of the declaration hold: invariance, zero force at rest, evenness.
    Claims,
    /// The Hessian at rest has no negative eigenvalue.
    RestStability,
    /// The force at zero velocity is −∇U.
    MinusGradient,
    /// The velocity-dependent part of the force dissipates power.
    Dissipation,
    /// No number is NaN or infinite, and no flag is set, at an ordinary input. Near rest and near singularities, each
    /// number is finite or flagged, or infinite because the true one is too large.
    Finite,
    /// The result is flagged where the formula has no value.
    Outside,
}

impl Check {
    /// Every check.
    pub const ALL: [Self; 17] = [
        Self::Accuracy,
        Self::DualNumbers,
        Self::FiniteDifferences,
        Self::OneSide,
        Self::Continuity,
        Self::Routines,
        Self::Symmetry,
        Self::LinearMomentum,
        Self::AngularMomentum,
        Self::Translation,
        Self::Units,
        Self::Claims,
        Self::RestStability,
        Self::MinusGradient,
        Self::Dissipation,
        Self::Finite,
        Self::Outside,
    ];

    /// Returns the name of the check for people.
    #[must_use]
    pub fn title(self) -> &'static str {
        match self {
            Self::Accuracy => "accuracy, u·κ",
            Self::DualNumbers => "dual numbers",
            Self::FiniteDifferences => "finite differences",
            Self::OneSide => "differences on one side",
            Self::Continuity => "continuous",
            Self::Routines => "all routines agree",
            Self::Symmetry => "symmetry",
            Self::LinearMomentum => "Σ f = 0",
            Self::AngularMomentum => "Σ x × f = 0",
            Self::Translation => "translation",
            Self::Units => "units",
            Self::Claims => "claims",
            Self::RestStability => "stable at rest",
            Self::MinusGradient => "f = −∇U",
            Self::Dissipation => "damping dissipates",
            Self::Finite => "finite",
            Self::Outside => "flagged outside",
        }
    }

    /// Returns the largest allowed error. For [`Self::Accuracy`] it is in units of roundoff times max(1, κ), otherwise
    /// relative to the largest number of the block, or of the summands.
    #[must_use]
    pub fn tolerance(self) -> f64 {
        match self {
            Self::Accuracy => 8.0,
            // The tolerance allows for the digits that the textbook form loses.
            Self::DualNumbers => 1e-9,
            Self::FiniteDifferences => 2e-7,
            Self::OneSide => 1.0 / 3.0,
            Self::Continuity => 1e-8,
            Self::Claims => 1e-10,
            Self::Symmetry | Self::Translation | Self::Units | Self::Finite | Self::Outside => 0.0,
            Self::Routines => 1e-13,
            Self::LinearMomentum => 16.0 * f64::EPSILON / 2.0,
            Self::MinusGradient | Self::RestStability | Self::Dissipation => 1e-12,
            Self::AngularMomentum => 1e-11,
        }
    }
}

/// A line of the report: the worst result of a check of a block over all inputs.
#[derive(Clone, Debug, Serialize)]
pub struct Line {
    /// Name of the element.
    pub element: Cow<'static, str>,
    /// Name of the block.
    pub block: BlockName,
    /// Property that was checked.
    pub check: Check,
    /// Number of inputs.
    pub inputs: usize,
    /// Worst relative error.
    pub worst: f64,
    /// Largest allowed error.
    pub tolerance: f64,
    /// Whether the check passed at every input.
    pub passed: bool,
    /// Lowest observed order of convergence of finite differences.
    pub order: Option<f64>,
    /// The entry, its values, the routes that agree, and the input.
    pub detail: String,
    /// Input of the worst error, to run it again.
    pub input: Option<Sample>,
}

impl Line {
    pub(super) fn new(element: Cow<'static, str>, block: BlockName, check: Check, tolerance: f64) -> Self {
        Self {
            element,
            block,
            check,
            inputs: 0,
            worst: 0.0,
            tolerance,
            passed: true,
            order: None,
            detail: String::new(),
            input: None,
        }
    }
}

/// Accuracy of a block over all inputs with multi-precision results.
#[derive(Clone, Debug, Serialize)]
pub struct Accuracy {
    /// Name of the block.
    pub block: BlockName,
    /// Number of inputs.
    pub inputs: usize,
    /// Worst error in units of roundoff of the block's largest number.
    pub worst: f64,
    /// Entry of the worst error.
    pub entry: String,
    /// Input of the worst error.
    pub input: Option<Sample>,
    /// Worst error in units of roundoff times max(1, κ).
    pub worst_kappa: f64,
    /// Input of `worst_kappa`.
    pub input_kappa: Option<Sample>,
}

impl Accuracy {
    pub(super) fn new(block: BlockName) -> Self {
        Self { block, inputs: 0, worst: 0.0, entry: String::new(), input: None, worst_kappa: 0.0, input_kappa: None }
    }
}

/// Deviation of finite differences from a block against their step, at the first input.
#[derive(Clone, Debug, Serialize)]
pub struct StepCurve {
    /// Name of the block.
    pub block: BlockName,
    /// Block whose differences were taken.
    pub of: BlockName,
    /// Step relative to the feature length, and the relative deviation of central and of extrapolated differences.
    pub errors: Vec<(f64, f64, f64)>,
}

/// A planted fault.
#[derive(Clone, Debug, Serialize)]
pub struct Mutant {
    /// Position and kind of the fault.
    pub fault: String,
    /// Checks that failed; empty if the fault was missed.
    pub caught_by: Vec<Check>,
}

/// Results of mutation testing.
#[derive(Clone, Debug, Default, Serialize)]
pub struct MutationScore {
    /// The planted faults.
    pub mutants: Vec<Mutant>,
    /// Number of faults that were drawn but not planted, because they provably change only rounding.
    pub equivalent: usize,
    /// Number of planted faults that change results by less than the allowed roundoffs at every input tried.
    pub within_rounding: usize,
    /// Number of planted faults that change nothing at any input tried, not even in multi-precision, because ordinary
    /// inputs do not reach them.
    pub without_effect: usize,
    /// Number of wanted faults that were not planted, because the budget of the element was spent.
    pub left_out: usize,
}

impl MutationScore {
    /// Returns the number of faults that were noticed.
    #[must_use]
    pub fn caught(&self) -> usize {
        self.mutants.iter().filter(|mutant| !mutant.caught_by.is_empty()).count()
    }
}

/// The shape of an input and the error of a block there.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Spot {
    /// Name of the block.
    pub block: BlockName,
    /// Longest distance between points.
    pub size: f64,
    /// Ratio of the shortest to the longest distance.
    pub shape: f64,
    /// Error in units of roundoff.
    pub error: f64,
}

/// A loss of digits near rest or near a singularity, or a needless flag. It does not fail an audit.
#[derive(Clone, Debug, Serialize)]
#[non_exhaustive]
pub struct Warning {
    /// Name of the block.
    pub block: BlockName,
    /// The place, as in `near rest, at a strain of 9e-10`.
    pub place: String,
    /// Whether the block is flagged, although it has a limit.
    pub is_flagged: bool,
    /// Error in units of roundoff.
    pub error: f64,
    /// Error in units of roundoff times max(1, κ). Without a flag, it is more than 1000.
    pub error_kappa: f64,
    /// The subexpression that loses the digits; `None` if it was not found.
    pub subexpression: Option<String>,
    /// A spelling that keeps the digits, or where to look for one.
    pub proposal: String,
    /// The input that shows it.
    pub input: Sample,
}

impl Warning {
    /// Formats the warning on a few lines, without the input.
    #[must_use]
    pub fn describe(&self, element: &str) -> String {
        let Self { block, place, is_flagged, error, error_kappa, subexpression, proposal, .. } = self;
        let what = match is_flagged {
            true => format!("block `{block}` is flagged {place}, although it has a limit there: error {error:.0e} u"),
            false => format!("block `{block}` loses digits {place}: error {error:.0e} u, {error_kappa:.0e} u·κ"),
        };
        let culprit = subexpression.as_ref().map_or_else(String::new, |text| format!("\n  in `{text}`"));
        format!("{element}: {what}{culprit}\n  {proposal}")
    }
}

/// Data on the audit of one element, apart from its lines.
#[derive(Clone, Debug, Serialize)]
pub struct Section {
    /// Name of the element.
    pub element: Cow<'static, str>,
    /// `energy`, `force`, ….
    pub kind: &'static str,
    /// Documentation of the element.
    pub docs: Cow<'static, str>,
    /// Declaration of the element.
    pub source: Cow<'static, str>,
    /// Number of inputs.
    pub inputs: usize,
    /// Number of inputs without differences, because a kink or the boundary of two regions is too near.
    pub without_differences: usize,
    /// Accuracy of each block.
    pub accuracy: Vec<Accuracy>,
    /// Errors of finite differences against their step.
    pub curves: Vec<StepCurve>,
    /// Errors by configuration.
    pub spots: Vec<Spot>,
    /// Number of inputs near rest and near singularities.
    pub extremes: usize,
    /// Losses of digits near rest and near singularities, one for each block and kind of place.
    pub warnings: Vec<Warning>,
    /// Number of random inputs that were replaced, because the formula has no value there, or a value near the end of
    /// the range of doubles.
    pub outside: usize,
    /// An attribute that states a domain.
    #[serde(skip)]
    pub domain: String,
    /// Checks that the budget of the element left out; empty if all were made.
    pub left_out: Vec<String>,
    /// Planted faults; `None` if the source of the element is not available.
    pub mutations: Option<MutationScore>,
}

/// The audit of one or more elements.
#[derive(Clone, Debug, Default, Serialize)]
#[non_exhaustive]
pub struct Report {
    /// Lines, element by element.
    pub lines: Vec<Line>,
    /// Further data on each element.
    pub sections: Vec<Section>,
    /// Elements that could not be audited, with the reason.
    pub refused: Vec<(String, String)>,
}

impl Report {
    /// Whether every check of every element passed, and every planted fault was noticed.
    #[must_use]
    pub fn passed(&self) -> bool {
        self.refused.is_empty() && self.lines.iter().all(|line| line.passed) && self.missed().next().is_none()
    }

    /// Says where the audit did not look, one sentence each.
    #[must_use]
    pub fn blind_spots(&self) -> Vec<String> {
        let near_kinks = self.sections.iter().filter(|section| section.without_differences > 0).map(|section| {
            let Section { element, without_differences: none, inputs, .. } = section;
            format!("{element}: no differences at {none} of {inputs} inputs, too near to a kink or a boundary.")
        });
        let outside = self.sections.iter().filter(|section| section.outside > 0).map(|section| {
            let Section { element, outside, domain, .. } = section;
            format!(
                "{element}: {outside} random inputs were replaced, because the formula has no value in the range of \
                 doubles there; a domain says where it is used, as in {domain}."
            )
        });
        let beyond_budget = self.sections.iter().filter(|section| !section.left_out.is_empty()).map(|section| {
            let Section { element, left_out, .. } = section;
            format!("{element}: left out to stay within the budget of operations: {}.", left_out.join(", "))
        });
        let range = "Ordinary inputs are points ½ to 8 apart with parameters ½ to 2, or the domain that a declaration \
                     states; others were not looked at.";
        let extremes: usize = self.sections.iter().map(|section| section.extremes).sum();
        let singular = match extremes {
            0 => "Inputs near rest or a singularity were not looked at; `verify stress` looks there.".to_owned(),
            _ => format!(
                "Near rest and near singularities, {extremes} inputs were looked at; `verify stress` goes closer, down \
                 to 1e-300."
            ),
        };
        near_kinks.chain(outside).chain(beyond_budget).chain([range.to_owned(), singular]).collect()
    }

    /// Returns the losses of digits near rest and near singularities, with their elements.
    pub fn warnings(&self) -> impl Iterator<Item = (&str, &Warning)> {
        self.sections.iter().flat_map(|section| section.warnings.iter().map(|warning| (&*section.element, warning)))
    }

    /// Returns the lines that failed.
    pub fn failures(&self) -> impl Iterator<Item = &Line> {
        self.lines.iter().filter(|line| !line.passed)
    }

    /// Returns the planted faults that were missed, with their elements.
    pub fn missed(&self) -> impl Iterator<Item = (&str, &Mutant)> {
        self.sections.iter().flat_map(|section| {
            let mutants = section.mutations.iter().flat_map(|score| &score.mutants);
            mutants.filter(|mutant| mutant.caught_by.is_empty()).map(|mutant| (&*section.element, mutant))
        })
    }

    /// Returns the number of elements in the report.
    #[must_use]
    pub fn elements(&self) -> usize {
        let mut names: Vec<&str> =
            self.lines.iter().map(|l| &*l.element).chain(self.refused.iter().map(|(name, _)| name.as_str())).collect();
        names.sort_unstable();
        names.dedup();
        names.len()
    }

    /// Merges another report; for each check of a block, the worse line is kept.
    pub fn merge(&mut self, other: Self) {
        for line in other.lines {
            let same = |l: &&mut Line| l.element == line.element && l.check == line.check && l.block == line.block;
            match self.lines.iter_mut().find(same) {
                Some(known) => {
                    let (inputs, passed) = (known.inputs + line.inputs, known.passed && line.passed);
                    if !line.passed && known.passed || line.worst > known.worst {
                        *known = line;
                    }
                    (known.inputs, known.passed) = (inputs, passed);
                }
                None => self.lines.push(line),
            }
        }
        for section in other.sections {
            if !self.sections.iter().any(|known| known.element == section.element) {
                self.sections.push(section);
            }
        }
        self.refused.extend(other.refused);
    }

    pub(super) fn extend(&mut self, other: Self) {
        self.lines.extend(other.lines);
        self.sections.extend(other.sections);
        self.refused.extend(other.refused);
    }
}

/// Describes a failed check.
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
