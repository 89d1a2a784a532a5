use std::borrow::Cow;
use std::path::Path;

use anyhow::Context;
use energy_compiler::{Budget, Interpreted, Limits, Textbook};
use energy_dsl::{AnyElement, Declaration, Inputs, Kind, Outputs, RestError};
use fastrand::Rng;

use super::budget::Meter;
use super::report::Check;
use crate::blocks::{Answer, BlockName, NoAnswer, evaluate, largest};
use crate::chart;
use crate::formula::rows;
use crate::sample::{Sample, Sampler};

/// A function or closure that evaluates an element.
pub type EvaluateAny = Box<dyn Fn(&Inputs<'_, f64>) -> Result<Outputs<f64>, RestError>>;

/// An element to audit: from the catalogue, or from a text read at run time.
#[derive(Clone, Debug)]
pub struct Target(Origin);

#[derive(Clone, Debug)]
enum Origin {
    Catalogue(AnyElement),
    /// With the claims of its text, which its source is without.
    Text(Box<Interpreted>),
}

/// The largest `.energy` file, in bytes.
const LARGEST_TEXT: u64 = 16 << 20;

impl Target {
    /// Creates the target of an element of the catalogue.
    #[must_use]
    pub fn of_element(entry: &AnyElement) -> Self {
        Self(Origin::Catalogue(*entry))
    }

    /// Returns every declaration of a text in the format of an `.energy` file; messages call it `name`.
    ///
    /// # Errors
    /// If the text has errors.
    pub fn of_text(text: &str, name: &str) -> Result<Vec<Self>, energy_compiler::Diagnostics> {
        Self::of_text_within(text, name, &Budget::default())
    }

    /// Returns every declaration of a text, compiled within a budget.
    ///
    /// # Errors
    /// If the text has errors, or takes more than the budget.
    pub fn of_text_within(text: &str, name: &str, budget: &Budget) -> Result<Vec<Self>, energy_compiler::Diagnostics> {
        let elements = Interpreted::from_file_within(text, name, budget)?;
        Ok(elements.into_iter().map(|element| Self(Origin::Text(Box::new(element)))).collect())
    }

    /// Returns every declaration of a file.
    ///
    /// # Errors
    /// If the file cannot be read, or the text has errors.
    pub fn of_file(path: &Path) -> anyhow::Result<Vec<Self>> {
        let text =
            energy_files::read_text(path, LARGEST_TEXT).with_context(|| format!("cannot read {}", path.display()))?;
        let name = path.display().to_string();
        let targets = Self::of_text_within(&text, &name, &Budget::default().trusting());
        let targets = targets.map_err(|errors| anyhow::anyhow!("{errors}"))?;
        anyhow::ensure!(!targets.is_empty(), "{} contains no declaration", path.display());
        Ok(targets)
    }

    /// Returns the name of the element.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.declaration().name
    }

    /// Returns the operations of all routines, which the time of an audit grows with.
    #[must_use]
    pub fn cost(&self) -> usize {
        self.declaration().routines.iter().map(|routine| routine.full.total()).sum()
    }

    /// Returns the declaration of the element.
    #[must_use]
    pub fn declaration(&self) -> &Declaration {
        match &self.0 {
            Origin::Catalogue(entry) => entry.declaration,
            Origin::Text(element) => element.declaration(),
        }
    }

    /// Returns the element in the form that audits need.
    ///
    /// # Errors
    /// If the declaration does not compile.
    pub fn subject(&self) -> Result<Subject, String> {
        match &self.0 {
            Origin::Catalogue(entry) => {
                // A declaration's source includes the functions that it uses, so it compiles on its own.
                let mut declared =
                    Interpreted::from_source_within(&entry.declaration.source, &Budget::default().trusting())
                        .map_err(|errors| errors.to_string())?;
                let interpreted = declared.pop();
                Subject::new(Cow::Borrowed(entry.declaration), Box::new(entry.evaluate), interpreted)
            }
            Origin::Text(element) => Subject::of_routines(element, Some(element.as_ref().clone())),
        }
    }

    /// Returns the element without the compiled routines that faults are planted in. This takes little time.
    ///
    /// # Errors
    /// If the declaration does not compile.
    pub fn subject_without_faults(&self) -> Result<Subject, String> {
        match &self.0 {
            Origin::Catalogue(entry) => Subject::new(Cow::Borrowed(entry.declaration), Box::new(entry.evaluate), None),
            Origin::Text(element) => Subject::of_routines(element, None),
        }
    }
}

/// An element under audit.
pub struct Subject {
    /// The declaration of the element.
    pub declaration: Cow<'static, Declaration>,
    /// Evaluates all blocks of the element.
    pub evaluate: EvaluateAny,
    /// The textbook form.
    pub formula: Textbook,
    /// The compiled routines, in which faults are planted; `None` if the source is not available.
    pub interpreted: Option<Interpreted>,
    /// The routines that `evaluate` interprets, to run one of them alone; `None` if it runs generated code.
    routines: Option<Interpreted>,
    /// Counts the operations of the audit.
    pub(super) meter: Meter,
}

impl Subject {
    /// Creates the subject of an audit.
    ///
    /// # Errors
    /// If the source of the declaration does not compile.
    pub fn new(
        declaration: Cow<'static, Declaration>,
        evaluate: EvaluateAny,
        interpreted: Option<Interpreted>,
    ) -> Result<Self, String> {
        // The text was compiled within its budget, and the textbook form takes less.
        let formula = Textbook::from_source_within(&declaration.source, &Budget::new(Limits::NONE))
            .map_err(|errors| errors.to_string())?;
        let meter = Meter::new(&declaration);
        Ok(Self { declaration, evaluate, formula, interpreted, routines: None, meter })
    }

    /// Creates the subject of an audit of interpreted routines.
    ///
    /// # Errors
    /// If the source of the declaration does not compile.
    pub fn of_routines(routines: &Interpreted, interpreted: Option<Interpreted>) -> Result<Self, String> {
        let runs = routines.clone();
        let declaration = Cow::Owned(Declaration::clone(routines.declaration()));
        let subject = Self::new(declaration, Box::new(move |inputs| runs.evaluate(inputs)), interpreted)?;
        Ok(Self { routines: Some(routines.clone()), ..subject })
    }

    /// Evaluates the block whose differences are taken. Runs one routine instead of all, because differences need
    /// hundreds of values.
    ///
    /// # Errors
    /// If the rest shape is degenerate or a block has the wrong size.
    pub(super) fn lower_block(&self, block: BlockName, sample: &Sample) -> Result<Vec<f64>, NoAnswer> {
        let routine = match block {
            BlockName::Energy => Some(("value", 0)),
            BlockName::Gradient => Some(("gradient", 1)),
            BlockName::Force => Some(("force", 0)),
            BlockName::Residual => Some(("residual", 0)),
            BlockName::Next => Some(("next", 0)),
            _ => None,
        };
        if let (Some(routines), Some((name, group))) = (&self.routines, routine) {
            let inputs = sample.inputs();
            self.meter.answer(0);
            if let Some((mut groups, _)) = routines.routine(name, &inputs).map_err(NoAnswer::Rest)? {
                return Ok(groups.swap_remove(group));
            }
        }
        self.answer(sample).map(|answer| answer.block(block).numbers.clone())
    }

    /// Evaluates all blocks at an input.
    ///
    /// # Errors
    /// If the rest shape is degenerate or a block has the wrong size.
    pub fn answer(&self, sample: &Sample) -> Result<Answer, NoAnswer> {
        let answer = evaluate(&self.declaration, &self.evaluate, &sample.inputs())?;
        self.meter.answer(answer.flags.iter().filter(|flags| flags.degenerate).count());
        Ok(answer)
    }

    /// Whether the formula and the next state have a value at an input, by doubles.
    fn has_value(&self, sample: &Sample) -> bool {
        self.meter.formula();
        let next = self.formula.evaluate_next(&sample.inputs());
        !rows(&self.formula, sample).iter().chain(&next).any(|row| row.is_nan())
    }

    /// Whether the formula or the next state has no value at an input and its surroundings: they are outside of its
    /// domain. At an input where it is 0/0, it has values nearby.
    pub(super) fn is_outside(&self, sample: &Sample) -> bool {
        const NEARBY: f64 = 1.0 / (1 << 20) as f64;
        if self.has_value(sample) {
            return false;
        }
        let mut random = Rng::with_seed(1);
        (0..3).all(|_| {
            let mut moved = sample.clone();
            let scale = largest(&sample.positions).max(f64::MIN_POSITIVE);
            moved.positions.iter_mut().for_each(|x| *x += NEARBY * scale * (2.0 * random.f64() - 1.0));
            chart::normalise(&self.declaration, &mut moved.positions);
            !self.has_value(&moved)
        })
    }

    /// Whether the value of the formula is so large that derivatives may be beyond the range of doubles, such as that of
    /// an exponential function of large strains.
    fn overflows(&self, sample: &Sample) -> bool {
        self.meter.formula();
        let largest = 2.0_f64.powi(900);
        rows(&self.formula, sample).into_iter().any(|row| row.abs() > largest)
    }

    /// Whether nothing can be compared at an ordinary input: it is outside of the domain, or the value overflows.
    pub(super) fn is_unusable(&self, sample: &Sample) -> bool {
        self.is_outside(sample) || self.overflows(sample)
    }

    /// Returns a sampler of the domain that the declaration states.
    #[must_use]
    pub fn sampler(&self, seed: u64) -> Sampler<'_> {
        let routines = self.routines.as_ref().or(self.interpreted.as_ref());
        let is_regular = move |sample: &Sample| routines.is_none_or(|one| one.check_rest(&sample.inputs()).is_ok());
        Sampler::within(&self.formula.program().audit_scope, &self.declaration, seed).with_rest(is_regular)
    }

    /// Returns the samples that the declaration asks for, if it was read at run time.
    pub(super) fn declared_samples(&self) -> Option<usize> {
        self.routines.as_ref().and_then(Interpreted::audit_samples)
    }

    /// Returns the largest error that a check allows, or that the declaration states.
    pub(super) fn tolerance(&self, check: Check) -> f64 {
        let stated = self.formula.program().audit_scope.tolerance;
        let loses_digits = matches!(check, Check::FiniteDifferences | Check::DualNumbers);
        stated.filter(|_| loses_digits).unwrap_or_else(|| check.tolerance())
    }

    /// Returns the branches of the formula that an input takes. The formula may have a kink or a jump between inputs
    /// that take different ones.
    #[must_use]
    pub fn branches(&self, sample: &Sample) -> Vec<bool> {
        self.meter.formula();
        self.formula.branches(&sample.inputs())
    }

    /// Returns whether the element depends on velocities.
    #[must_use]
    pub fn has_velocities(&self) -> bool {
        matches!(self.declaration.kind, Kind::Force | Kind::Constraint)
    }
}
