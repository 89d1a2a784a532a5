use serde::Serialize;

use crate::blocks::BlockName;
use crate::sample::Sample;

/// What is looked at.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Check {
    /// As accurate as the reference demands of every record, against multi-precision.
    Accuracy,
    /// Equal to hyper-dual numbers run through the textbook form.
    DualNumbers,
    /// Equal to finite differences of the block one order below.
    FiniteDifferences,
    /// The same from every routine that returns it.
    Routines,
    /// Exactly symmetric.
    Symmetry,
    /// Σ f = 0.
    LinearMomentum,
    /// Σ x × f = 0.
    AngularMomentum,
    /// The same bits wherever it is.
    Translation,
    /// The same quantities in other units.
    Units,
    /// The declaration keeps what it claims: invariance, no force at rest, evenness.
    Claims,
    /// No negative eigenvalue at rest.
    RestStability,
    /// The force without velocities is −∇U.
    MinusGradient,
    /// What velocities add to a force takes power away.
    Dissipation,
    /// No number is NaN or infinite, and no condition is flagged, at an ordinary input.
    Finite,
}

impl Check {
    /// All of them.
    pub const ALL: [Self; 14] = [
        Self::Accuracy,
        Self::DualNumbers,
        Self::FiniteDifferences,
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
    ];

    /// How a person calls it.
    #[must_use]
    pub fn title(self) -> &'static str {
        match self {
            Self::Accuracy => "accuracy, u·κ",
            Self::DualNumbers => "dual numbers",
            Self::FiniteDifferences => "finite differences",
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
        }
    }

    /// The largest error allowed: of [`Self::Accuracy`] in units of roundoff times max(1, κ), of all others relative to the largest
    /// number of the block (or of what is summed).
    #[must_use]
    pub fn tolerance(self) -> f64 {
        match self {
            Self::Accuracy => 8.0,
            // The textbook form loses digits: what it leaves of them.
            Self::DualNumbers => 1e-9,
            Self::FiniteDifferences => 2e-7,
            Self::Claims => 1e-10,
            Self::Symmetry | Self::Translation | Self::Units | Self::Finite => 0.0,
            Self::Routines => 1e-13,
            Self::LinearMomentum => 16.0 * f64::EPSILON / 2.0,
            Self::MinusGradient | Self::RestStability | Self::Dissipation => 1e-12,
            Self::AngularMomentum => 1e-11,
        }
    }
}

/// One line of the report: the worst of a check of a block over all inputs.
#[derive(Clone, Debug, Serialize)]
pub struct Line {
    /// The element.
    pub element: &'static str,
    /// The block.
    pub block: BlockName,
    /// What was checked.
    pub check: Check,
    /// At how many inputs.
    pub inputs: usize,
    /// The worst relative error.
    pub worst: f64,
    /// The error allowed.
    pub tolerance: f64,
    /// Whether it held.
    pub passed: bool,
    /// The least order of convergence that was observed, of finite differences.
    pub order: Option<f64>,
    /// Which entry, the values, which routes agree, and the input they were found at.
    pub detail: String,
    /// The input of the worst error, to be run again.
    pub input: Option<Sample>,
}

impl Line {
    pub(super) fn new(element: &'static str, block: BlockName, check: Check) -> Self {
        Self {
            element,
            block,
            check,
            inputs: 0,
            worst: 0.0,
            tolerance: check.tolerance(),
            passed: true,
            order: None,
            detail: String::new(),
            input: None,
        }
    }
}

/// The accuracy of a block over all inputs that multi-precision was computed at.
#[derive(Clone, Debug, Serialize)]
pub struct Accuracy {
    /// The block.
    pub block: BlockName,
    /// At how many inputs.
    pub inputs: usize,
    /// Worst error in units of roundoff of the block's largest number.
    pub worst: f64,
    /// The entry it was found in.
    pub entry: String,
    /// The input it was found at.
    pub input: Option<Sample>,
    /// Worst error in units of roundoff times max(1, κ).
    pub worst_kappa: f64,
    /// The input it was found at.
    pub input_kappa: Option<Sample>,
}

impl Accuracy {
    pub(super) fn new(block: BlockName) -> Self {
        Self { block, inputs: 0, worst: 0.0, entry: String::new(), input: None, worst_kappa: 0.0, input_kappa: None }
    }
}

/// The deviation of finite differences from a block against their step, at the first input.
#[derive(Clone, Debug, Serialize)]
pub struct StepCurve {
    /// The block.
    pub block: BlockName,
    /// What was differenced.
    pub of: BlockName,
    /// Step over feature length; relative deviation of central differences, and extrapolated once.
    pub errors: Vec<(f64, f64, f64)>,
}

/// A planted fault.
#[derive(Clone, Debug, Serialize)]
pub struct Mutant {
    /// Where and what.
    pub fault: String,
    /// The checks that failed; none if it was missed.
    pub caught_by: Vec<Check>,
}

/// What became of planted faults.
#[derive(Clone, Debug, Default, Serialize)]
pub struct MutationScore {
    /// The faults.
    pub mutants: Vec<Mutant>,
    /// Faults that were drawn, but proved to change nothing but rounding, and so were not planted.
    pub equivalent: usize,
    /// Faults that were planted and change results, but at every input tried by less than the roundoffs that accuracy is allowed.
    pub within_rounding: usize,
    /// Faults that were planted and change nothing at any input tried, not even in multi-precision: what no ordinary input reaches.
    pub without_effect: usize,
}

impl MutationScore {
    /// How many were noticed.
    #[must_use]
    pub fn caught(&self) -> usize {
        self.mutants.iter().filter(|mutant| !mutant.caught_by.is_empty()).count()
    }
}

/// What an input looked like, and how far off a block was there.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Spot {
    /// The block.
    pub block: BlockName,
    /// Size of the configuration: the longest distance.
    pub size: f64,
    /// The shortest distance over the longest.
    pub shape: f64,
    /// Error in units of roundoff.
    pub error: f64,
}

/// The audit of one element beside its lines.
#[derive(Clone, Debug, Serialize)]
pub struct Section {
    /// The element.
    pub element: &'static str,
    /// `energy`, `force`, ….
    pub kind: &'static str,
    /// Its documentation.
    pub docs: &'static str,
    /// Its declaration.
    pub source: &'static str,
    /// Its inputs drawn.
    pub inputs: usize,
    /// Accuracy, block by block.
    pub accuracy: Vec<Accuracy>,
    /// The curves of differences.
    pub curves: Vec<StepCurve>,
    /// Errors by configuration.
    pub spots: Vec<Spot>,
    /// Planted faults; none where the element's source is not at hand.
    pub mutations: Option<MutationScore>,
}

/// The audit of one or more elements.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Report {
    /// All lines, element by element.
    pub lines: Vec<Line>,
    /// What is known of each element beside.
    pub sections: Vec<Section>,
    /// Elements that could not be audited, with the reason.
    pub refused: Vec<(String, String)>,
}

impl Report {
    /// Whether every check of every element held, and every planted fault was noticed.
    #[must_use]
    pub fn passed(&self) -> bool {
        self.refused.is_empty() && self.lines.iter().all(|line| line.passed) && self.missed().next().is_none()
    }

    /// The lines that failed.
    pub fn failures(&self) -> impl Iterator<Item = &Line> {
        self.lines.iter().filter(|line| !line.passed)
    }

    /// Planted faults that went unnoticed, with their elements.
    pub fn missed(&self) -> impl Iterator<Item = (&'static str, &Mutant)> {
        self.sections.iter().flat_map(|section| {
            let mutants = section.mutations.iter().flat_map(|score| &score.mutants);
            mutants.filter(|mutant| mutant.caught_by.is_empty()).map(|mutant| (section.element, mutant))
        })
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

    /// Adds another report: of each check of a block only the worse line is kept.
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
