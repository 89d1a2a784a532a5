use std::num::NonZero;
use std::path::{Path, PathBuf};

use clap::Args;
use energy_cli::print;
use serde::Serialize;
use verify::audit::{Options, Report, Target, audit_all, audit_at, describe_failure};

use super::output::{table, write_json, write_text};
use super::targets::{energy_target, targets};

/// Compares every derivative with multi-precision, dual numbers and finite differences, checks the laws that it must
/// obey, and plants faults that must be noticed. Looks near rest and near singularities, and warns where digits are
/// lost. Exit status 1 on any failure, 0 with warnings.
#[derive(Args)]
pub struct Audit {
    /// Elements of the catalogue or of the file [default: all].
    names: Vec<String>,
    /// Audit the declarations of this file (`.energy`) instead of the catalogue's.
    #[arg(long)]
    file: Option<PathBuf>,
    /// Random inputs per element [default: those that its `#[audit(samples = …)]` asks for, else 200].
    #[arg(long)]
    samples: Option<usize>,
    /// Seed of the random inputs.
    #[arg(long, default_value_t = 1)]
    seed: u64,
    /// Faults to plant in each element.
    #[arg(long, default_value_t = 24)]
    faults: usize,
    /// Use a few samples and faults only.
    #[arg(long, conflicts_with_all = ["samples", "faults"])]
    quick: bool,
    /// Threads; the report does not depend on their number [default: all processors].
    #[arg(long)]
    threads: Option<NonZero<usize>>,
    /// Also check that the audited forces are minus the gradient of this energy, from the file or the catalogue.
    #[arg(long, value_name = "ENERGY")]
    against: Option<String>,
    /// Audit at the inputs of this file only: an object with `positions`, `velocities`, `rest` and `parameters`, or a
    /// report written by `--json`.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["samples", "seed", "quick", "faults"])]
    at: Option<PathBuf>,
    /// Also write the report to this file.
    #[arg(long)]
    json: Option<PathBuf>,
    /// Also write the report as a web page with formulas and plots.
    #[arg(long)]
    html: Option<PathBuf>,
    /// Also write the report as JUnit XML.
    #[arg(long)]
    junit: Option<PathBuf>,
}

/// The report as it is written.
#[derive(Serialize)]
struct Written<'a> {
    #[serde(flatten)]
    report: &'a Report,
    not_looked_at: Vec<String>,
}

impl Audit {
    pub fn run(self) -> anyhow::Result<bool> {
        let Self { samples, seed, faults, threads, .. } = self;
        let options = match (self.quick, samples) {
            (true, _) => Options { seed, threads, ..Options::quick() },
            (false, None) => Options { declared_samples: true, seed, mutations: faults, threads, ..Options::default() },
            (false, Some(samples)) => Options { samples, seed, mutations: faults, threads, ..Options::default() },
        };
        let file = self.file.as_deref();
        let targets = targets(&self.names, file)?;
        let energy = self.against.map(|name| energy_target(&name, file)).transpose()?;
        let report = match self.at {
            Some(at) => audit_at_inputs(&targets, energy.as_ref(), &at)?,
            None => audit_all(&targets, energy.as_ref(), options),
        };
        show(&report)?;
        write_json(self.json.as_deref(), &Written { report: &report, not_looked_at: report.blind_spots() })?;
        write_text(self.html.as_deref(), || verify_command::audit_page(&report))?;
        write_text(self.junit.as_deref(), || verify::audit::junit(&report))?;
        Ok(report.passed())
    }
}

/// Runs all checks at the inputs of a file. An input that names no element is for the only target.
fn audit_at_inputs(targets: &[Target], energy: Option<&Target>, file: &Path) -> anyhow::Result<Report> {
    let inputs = verify_command::read_inputs(file)?;
    let mut report = Report::default();
    for (element, sample) in &inputs {
        let chosen: Vec<&Target> = match element {
            Some(name) => targets.iter().filter(|target| target.name() == name).collect(),
            None => targets.iter().collect(),
        };
        anyhow::ensure!(
            element.is_some() || chosen.len() == 1,
            "{}: name the element that the input is for",
            file.display()
        );
        for target in chosen {
            let part = audit_at(target, energy, sample).map_err(|why| anyhow::anyhow!("{}: {why}", file.display()))?;
            report.merge(part);
        }
    }
    Ok(report)
}

fn show(report: &Report) -> anyhow::Result<()> {
    let mut table = table(&["element", "block", "check", "worst error", "allowed", "order", "verdict"], &[3, 4, 5]);
    for line in &report.lines {
        table.add_row([
            line.element.to_string(),
            line.block.to_string(),
            line.check.title().to_owned(),
            format!("{:.1e}", line.worst),
            format!("{:.1e}", line.tolerance),
            line.order.map_or_else(String::new, |order| format!("{order:.2}")),
            if line.passed { "ok" } else { "FAILED" }.to_owned(),
        ]);
    }
    print(&format!("{table}\n"))?;
    for line in report.failures() {
        print(&format!("\n{}\n", describe_failure(line)))?;
    }
    for (name, why) in &report.refused {
        print(&format!("\n{name} cannot be audited: {why}\n"))?;
    }
    for (element, warning) in report.warnings() {
        print(&format!("\nwarning: {}\n", warning.describe(element)))?;
    }
    for (element, mutant) in report.missed() {
        print(&format!("\n{element}: no check noticed a planted fault: {}\n", mutant.fault))?;
    }
    print_mutation_scores(report)?;
    print(&format!("\n{}\n", report.blind_spots().join("\n")))?;
    print(&format!(
        "\n{} elements, {} checks, {} failed, {} warnings\n",
        report.elements(),
        report.lines.len(),
        report.failures().count() + report.refused.len() + report.missed().count(),
        report.warnings().count()
    ))
}

fn print_mutation_scores(report: &Report) -> anyhow::Result<()> {
    let scores: Vec<_> = report.sections.iter().filter_map(|section| section.mutations.as_ref()).collect();
    if scores.is_empty() {
        return Ok(());
    }
    print(&format!(
        "\n{} of {} planted faults noticed; of others drawn, {} provably change nothing, \
         {} change last bits only, {} change nothing at any input tried\n",
        scores.iter().map(|score| score.caught()).sum::<usize>(),
        scores.iter().map(|score| score.mutants.len()).sum::<usize>(),
        scores.iter().map(|score| score.equivalent).sum::<usize>(),
        scores.iter().map(|score| score.within_rounding).sum::<usize>(),
        scores.iter().map(|score| score.without_effect).sum::<usize>()
    ))
}
