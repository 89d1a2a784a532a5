//! Checks of declared elements, and their report.

mod accuracy;
mod auditor;
mod budget;
mod cases;
mod continuity;
mod culprit;
mod entry;
mod extremes;
mod junit;
mod laws;
mod losses;
mod momentum;
mod mutations;
mod properties;
mod remedy;
mod report;
mod routes;
mod subject;

use std::borrow::Cow;
use std::num::NonZero;

use energy_dsl::{AnyElement, Declaration, Element};

pub use self::accuracy::amplification;
use self::auditor::Auditor;
use self::budget::Meter;
use self::cases::{Case, Cases, cases};
use self::continuity::typical_value;
pub use self::junit::{escaped, junit};
use self::losses::Losses;
pub use self::report::{
    Accuracy, Check, Line, Mutant, MutationScore, Report, Section, Spot, StepCurve, Warning, describe_failure,
};
pub use self::subject::{EvaluateAny, Subject, Target};
use crate::blocks::{BlockName, Evaluate, NoAnswer};
use crate::geometry::{Rotation, longest_distance, shortest_distance};
use crate::multiprecision::TrueBlock;
use crate::parallel;
use crate::sample::{Sample, has_points};

/// Thoroughness of an audit.
#[derive(Clone, Copy, Debug)]
pub struct Options {
    /// Random inputs per element.
    pub samples: usize,
    /// Whether the samples that a declaration asks for count instead.
    pub declared_samples: bool,
    /// Number of inputs with multi-precision results.
    pub truths: usize,
    /// Faults to plant in each element.
    pub mutations: usize,
    /// Number of inputs at which a fault may be noticed.
    pub trials: usize,
    /// Number of inputs near rest and near singularities.
    pub extremes: usize,
    /// Operations of doubles that an element may take. What exceeds them is left out, and reported. They are counted
    /// from the operations of the element, so reports do not depend on the speed of a machine.
    pub budget: u64,
    /// Seed of the random inputs.
    pub seed: u64,
    /// Number of threads; `None` uses all processors. Reports do not depend on it.
    pub threads: Option<NonZero<usize>>,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            samples: 200,
            declared_samples: false,
            truths: 24,
            mutations: 24,
            trials: 40,
            extremes: 60,
            budget: 25_000_000_000,
            seed: 1,
            threads: None,
        }
    }
}

impl Options {
    /// Options for every change of the code: seconds for all elements.
    #[must_use]
    pub fn quick() -> Self {
        Self {
            samples: 20,
            truths: 5,
            mutations: 10,
            trials: 25,
            extremes: 10,
            budget: 2_500_000_000,
            ..Self::default()
        }
    }
}

/// Returns the elements of a catalogue with these names; all if the list is empty.
///
/// # Errors
/// If the catalogue does not have one of the names.
pub fn targets_in(catalogue: &[AnyElement], names: &[&str]) -> Result<Vec<Target>, String> {
    let has = |name: &str| catalogue.iter().any(|entry| entry.declaration.name == name);
    if let Some(unknown) = names.iter().find(|name| !has(name)) {
        let known = catalogue.iter().map(|entry| &*entry.declaration.name).collect::<Vec<_>>().join(", ");
        return Err(format!("no declared element is called {unknown}; there are {known}"));
    }
    let chosen = catalogue.iter().filter(|e| names.is_empty() || names.contains(&&*e.declaration.name));
    Ok(chosen.map(Target::of_element).collect())
}

/// Audits all targets; the report is in their order, for any number of threads. If an energy is given, the targets are
/// forces that must be minus its gradient, at the same points and with its parameters by name.
#[must_use]
pub fn audit_all(targets: &[Target], energy: Option<&Target>, options: Options) -> Report {
    let mut all = Report::default();
    for report in parallel::map(targets, options.threads, Target::cost, |t| audit_target(t, energy, options)) {
        all.extend(report);
    }
    all
}

fn audit_target(target: &Target, energy: Option<&Target>, options: Options) -> Report {
    let refused = |why: String| Report { refused: vec![(target.name().into(), why)], ..Report::default() };
    let energy = match energy.map(Target::subject).transpose() {
        Ok(energy) => energy,
        Err(why) => return refused(why),
    };
    match target.subject() {
        Ok(subject) => run(&subject, energy.as_ref(), options).unwrap_or_else(refused),
        Err(why) => refused(why),
    }
}

/// Runs all checks at one given input.
///
/// # Errors
/// If the element cannot be audited, or the input does not fit it.
pub fn audit_at(target: &Target, energy: Option<&Target>, sample: &Sample) -> Result<Report, String> {
    let subject = target.subject()?;
    sample.fits(&subject.declaration)?;
    let turn = Rotation::from_unit_quaternion([0.5, -0.5, 0.5, 0.5]);
    let case = Case::new(&subject, sample.clone(), turn, true);
    let mut section = section(&subject, 1);
    let mut auditor = Auditor::new(&subject);
    audit_case(&mut auditor, &mut section, &case).map_err(|error| error.to_string())?;
    if let Some(energy) = energy {
        against_energy(&mut auditor, &energy.subject()?, &case)?;
    }
    Ok(Report { lines: auditor.lines, sections: vec![section], refused: Vec::new() })
}

/// Audits one generated element. No faults are planted, because that needs its source.
#[must_use]
pub fn audit(declaration: &'static Declaration, evaluate: Evaluate, options: Options) -> Report {
    let report = Subject::new(Cow::Borrowed(declaration), Box::new(evaluate), None)
        .and_then(|subject| run(&subject, None, options));
    report.unwrap_or_else(|why| Report { refused: vec![(declaration.name.to_string(), why)], ..Report::default() })
}

fn run(subject: &Subject, energy: Option<&Subject>, options: Options) -> Result<Report, String> {
    let declared = subject.declared_samples().filter(|_| options.declared_samples);
    let samples = declared.unwrap_or(options.samples);
    let Cases { list: cases, outside, outside_inputs, missing } = cases(subject, samples, options.truths, options.seed);
    if cases.is_empty() && samples > 0 {
        let domain = remedy::domain(&subject.declaration);
        return Err(format!("the formula has no value at any input tried; state where it has one, as in {domain}"));
    }
    let mut auditor = Auditor::new(subject);
    let mut section = Section { outside, ..section(subject, cases.len()) };
    let mut budget = Budget { section: &mut section, meter: &subject.meter, limit: options.budget / 3 };
    budget.left_out(missing, samples, "inputs, not found in the domain");
    let typical = typical_value(&cases);
    for (number, case) in cases.iter().enumerate() {
        if number >= FEWEST && budget.is_spent() {
            budget.left_out(cases.len() - number, cases.len(), "inputs");
            break;
        }
        audit_case(&mut auditor, budget.section, case).map_err(|error| error.to_string())?;
        auditor.continuity(case, &cases[(number + 1) % cases.len()].sample, typical);
        if let Some(energy) = energy {
            against_energy(&mut auditor, energy, case)?;
        }
    }
    outside_inputs.iter().for_each(|sample| auditor.outside(sample));
    budget.limit = 2 * (options.budget / 3);
    if let Some(first) = cases.first() {
        look_near_singularities(&mut auditor, &mut budget, &first.sample, options);
    }
    if let Some(last) = cases.last() {
        section.without_differences = auditor.rejected_differences(&last.sample);
    }
    let lines = auditor.lines;
    // Faults in a faulty element tell nothing.
    if options.mutations > 0 && lines.iter().all(|line| line.passed) {
        let score = subject.interpreted.as_ref().map(|interpreted| {
            let budget = (&subject.meter, options.budget);
            mutations::score(interpreted, options.mutations, options.trials, options.seed, budget)
        });
        section.mutations = score.transpose()?;
        if let Some(left_out) = section.mutations.as_ref().map(|score| score.left_out).filter(|&number| number > 0) {
            section.left_out.push(format!("{left_out} of {} planted faults", options.mutations));
        }
    }
    Ok(Report { lines, sections: vec![section], refused: Vec::new() })
}

/// Ordinary inputs that are looked at whatever they cost.
const FEWEST: usize = 3;

/// A limit of the operations, and the section that lists what it leaves out.
struct Budget<'a> {
    section: &'a mut Section,
    meter: &'a Meter,
    limit: u64,
}

impl Budget<'_> {
    fn is_spent(&self) -> bool {
        self.meter.spent() > self.limit
    }

    fn left_out(&mut self, count: usize, of: usize, what: &str) {
        if count > 0 {
            self.section.left_out.push(format!("{count} of {of} {what}"));
        }
    }
}

/// Looks at inputs near rest and near singularities, and warns of losses of digits.
fn look_near_singularities(auditor: &mut Auditor<'_>, budget: &mut Budget<'_>, ordinary: &Sample, options: Options) {
    let mut inputs = extremes::extremes(auditor.subject, ordinary, options.seed);
    inputs.truncate(options.extremes);
    let mut losses = Losses::default();
    let count = inputs.len();
    for (number, extreme) in inputs.into_iter().enumerate() {
        if budget.is_spent() {
            budget.left_out(count - number, count, "inputs near rest and near singularities");
            break;
        }
        auditor.extreme(extreme, &mut losses);
    }
    budget.section.extremes = losses.inputs;
    budget.section.warnings = losses.warnings(auditor);
}

fn section(subject: &Subject, inputs: usize) -> Section {
    let declaration = &subject.declaration;
    Section {
        element: declaration.name.clone(),
        kind: declaration.kind.keyword(),
        docs: declaration.docs.clone(),
        source: declaration.source.clone(),
        inputs,
        without_differences: 0,
        accuracy: Vec::new(),
        curves: Vec::new(),
        spots: Vec::new(),
        extremes: 0,
        warnings: Vec::new(),
        outside: 0,
        domain: remedy::domain(declaration),
        left_out: Vec::new(),
        mutations: None,
    }
}

fn audit_case(auditor: &mut Auditor<'_>, section: &mut Section, case: &Case<'_>) -> Result<(), NoAnswer> {
    let answer = auditor.answer(&case.sample)?;
    auditor.laws(case, &answer)?;
    let curves = auditor.routes(case, &answer, &mut section.accuracy)?;
    if section.curves.is_empty() {
        section.curves = curves;
    }
    if has_points(auditor.declaration) {
        let size = longest_distance(&case.sample.positions).unwrap_or(1.0);
        let shape = shortest_distance(&case.sample.positions).unwrap_or(size) / size;
        let error = |truth: &TrueBlock| truth.error_in_roundoffs(&answer.block(truth.block.name).numbers);
        let spots = case.truths().iter().filter(|truth| truth.is_defined && truth.largest() > 0.0);
        section.spots.extend(spots.map(|t| Spot { block: t.block.name, size, shape, error: error(t) }));
    }
    Ok(())
}

/// Compares a force with minus the gradient of an energy at one input.
fn against_energy(auditor: &mut Auditor<'_>, energy: &Subject, case: &Case<'_>) -> Result<(), String> {
    let (force, potential) = (auditor.declaration, &energy.declaration);
    if !auditor.subject.has_velocities() {
        return Err(format!("{} is not a force, so it cannot be compared with {}", force.name, potential.name));
    }
    let mut still = case.sample.clone();
    still.velocities.fill(0.0);
    let mut sample = Sample { velocities: Vec::new(), parameters: Vec::new(), ..still.clone() };
    for wanted in &*potential.parameters {
        let mut numbers = still.parameters.as_slice();
        let found = force.parameters.iter().find_map(|field| {
            let (own, others) = numbers.split_at(field.size);
            numbers = others;
            (field.name == wanted.name && field.size == wanted.size).then_some(own)
        });
        let found = found.ok_or_else(|| {
            format!("{} has a parameter `{}`, which {} lacks", potential.name, wanted.name, force.name)
        })?;
        sample.parameters.extend_from_slice(found);
    }
    if sample.positions.len() != potential.points.iter().map(|p| p.size).sum::<usize>() {
        return Err(format!("{} and {} have different numbers of points", force.name, potential.name));
    }
    let answer = auditor.answer(&still).map_err(|e| e.to_string())?;
    let gradient = energy.answer(&sample).map_err(|e| e.to_string())?;
    let expected: Vec<f64> = gradient.block(BlockName::Gradient).numbers.iter().map(|g| -g).collect();
    auditor.minus_gradient(&still, answer.block(BlockName::Force), &expected, &potential.name);
    Ok(())
}

/// Audits an element in a test.
///
/// # Panics
/// If a check fails. The message has the element, block and entry, the results of all routes, the step of the
/// differences, and the input.
pub fn assert_derivatives<E: Element>(samples: usize) {
    let options = Options { samples, truths: samples.min(5), mutations: 0, extremes: 10, ..Options::default() };
    let report = audit(E::DECLARATION, E::evaluate::<f64>, options);
    let mut problems: Vec<String> =
        report.refused.iter().map(|(name, why)| format!("{name} cannot be audited: {why}")).collect();
    problems.extend(report.failures().map(describe_failure));
    assert!(problems.is_empty(), "\n{}", problems.join("\n"));
}
