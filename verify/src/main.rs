//! The audit on the command line.
#![forbid(unsafe_code)]

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::Context;
use clap::{Parser, Subcommand};
use comfy_table::{CellAlignment, Table, presets};
use verify::audit::{Options, Report, Target, audit_all, audit_at, catalogue_targets, describe_failure};
use verify::fuzz;
use verify::reference::{
    BlockLine, FamilyLine, PolicyLine, ReferenceReport, Source, evaluate_file, fusion_reference, policy, reference,
};
use verify::stress::{markdown, plots, stress};

/// Audits the derivatives of declared elements, and measures them against multi-precision reference values.
#[derive(Parser)]
#[command(version)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Compare every derivative with multi-precision, dual numbers and finite differences, check the laws it must keep, and plant
    /// faults that must be noticed; exit status 1 on any failure.
    Audit {
        /// Elements to audit, of the catalogue or of the file; all of them if none is named.
        names: Vec<String>,
        /// Audit the declarations of this file (`.energy`) instead of the catalogue's.
        #[arg(long)]
        file: Option<PathBuf>,
        /// Random inputs for each element.
        #[arg(long, default_value_t = 200)]
        samples: usize,
        /// What the inputs are drawn from.
        #[arg(long, default_value_t = 1)]
        seed: u64,
        /// Faults to plant in each element.
        #[arg(long, default_value_t = 24)]
        faults: usize,
        /// A few samples only.
        #[arg(long, conflicts_with_all = ["samples", "faults"])]
        quick: bool,
        /// An energy, of the file or the catalogue, that the audited forces must be minus the gradient of.
        #[arg(long, value_name = "ENERGY")]
        against: Option<String>,
        /// Audit at the input of this file only: one object with `positions`, `velocities`, `rest`, `parameters`, or a report
        /// written by `--json`, whose inputs are all run again.
        #[arg(long, value_name = "FILE", conflicts_with_all = ["samples", "seed", "quick", "faults"])]
        at: Option<PathBuf>,
        /// Also write the report to this file.
        #[arg(long)]
        json: Option<PathBuf>,
        /// Also write it as one page with formulas and plots.
        #[arg(long)]
        html: Option<PathBuf>,
        /// Also write it as JUnit XML.
        #[arg(long)]
        junit: Option<PathBuf>,
    },
    /// Measure the generated code against reference values; exit status 1 on a NaN, or a degenerate input not treated as
    /// documented. Errors beyond tier A or B are listed.
    Reference {
        /// A folder of `potref-1` files; the copy in this repository if none is given.
        folder: Option<PathBuf>,
        /// Also write the report to this file.
        #[arg(long)]
        json: Option<PathBuf>,
        /// Exit status 1 on anything beyond tier A or B as well.
        #[arg(long)]
        strict: bool,
    },
    /// Sweep towards every singularity, down to 1e-300, and compare the generated code with the textbook form; then try every
    /// degenerate input with a documented answer. Exit status 1 on a NaN, an error beyond 8 u·κ that is not flagged, or an answer
    /// that is not the documented one.
    Stress {
        /// Elements, of the catalogue or of the file; all of them if none is named.
        names: Vec<String>,
        /// Sweep the declarations of this file (`.energy`) instead of the catalogue's; degenerate inputs are left out.
        #[arg(long)]
        file: Option<PathBuf>,
        /// Also write `stress.md`, `stress.json` and a plot of each sweep to this folder.
        #[arg(short, long)]
        output: Option<PathBuf>,
    },
    /// Time every way to a Hessian on one element of each family, and measure its error against multi-precision.
    Bench {
        /// Elements; all that are timed if none is named.
        names: Vec<String>,
        /// Also write `bench.md`, `bench.csv` and a plot of each element to this folder.
        #[arg(short, long)]
        output: Option<PathBuf>,
    },
    /// Feed the compiler of the language with edited inputs of a corpus; exit status 1 on a panic, or an input that takes more than 20
    /// seconds, which is added to the corpus.
    Fuzz {
        /// What reads the inputs.
        target: fuzz::Target,
        /// For how long.
        #[arg(long, default_value_t = 1.0)]
        minutes: f64,
        /// What the edits are drawn from.
        #[arg(long, default_value_t = 1)]
        seed: u64,
        /// A folder of inputs instead of the repository's own.
        #[arg(long)]
        corpus: Option<PathBuf>,
    },
    /// Print the code generated for an element.
    Show {
        /// An element's name, or a file of declarations (`.energy`).
        name: String,
        /// One routine only: `value`, `gradient`, `hessian`, ….
        #[arg(long)]
        routine: Option<String>,
        /// Instead of code, the routes to each routine's derivatives: their operations, and which was taken.
        #[arg(long, conflicts_with = "routine")]
        plan: bool,
        /// Instead of code, what each routine costs, and the Hessian where a point is pinned.
        #[arg(long, conflicts_with_all = ["routine", "plan"])]
        counts: bool,
    },
    /// Evaluate the records of a file and write them with the results of the generated code, 17 digits, and flags.
    Eval {
        /// A `potref-1` or `potref-policy-1` file.
        records: PathBuf,
        /// Where to write.
        #[arg(short, long)]
        output: PathBuf,
        /// Instead of the generated code's results, the formula's in multi-precision, to so many digits.
        #[arg(long, value_parser = clap::value_parser!(u16).range(1..=500))]
        digits: Option<u16>,
    },
}

fn main() -> ExitCode {
    // A reader that has seen enough (`| head`) ends the program, without a panic.
    sigpipe::reset();
    match run(Arguments::parse().command) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("error: {}", verify::message(&error));
            ExitCode::from(2)
        }
    }
}

fn run(command: Command) -> anyhow::Result<bool> {
    match command {
        Command::Audit { names, file, samples, seed, faults, quick, against, at, json, html, junit } => {
            let options = match quick {
                true => Options { seed, ..Options::quick() },
                false => Options { samples, seed, mutations: faults, ..Options::default() },
            };
            let targets = targets(&names, file.as_deref())?;
            let energy = against.map(|name| target_of_energy(&name, file.as_deref())).transpose()?;
            let report = match at {
                Some(at) => audit_at_inputs(&targets, energy.as_ref(), &at)?,
                None => audit_all(&targets, energy.as_ref(), options),
            };
            print_audit(&report);
            write_json(json.as_deref(), &report)?;
            write_text(html.as_deref(), || verify::audit::html(&report))?;
            write_text(junit.as_deref(), || verify::audit::junit(&report))?;
            Ok(report.passed())
        }
        Command::Reference { folder, json, strict } => {
            let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("data");
            // Body tracking has a file of its own shape.
            let tracking = folder.as_ref().unwrap_or(&data.join("fusion")).join("reference.json");
            let tracked = if tracking.exists() { fusion_reference(&tracking)? } else { Vec::new() };
            print_families(&tracked);
            let exceeded = tracked.iter().any(|line| !line.passed());
            if folder.is_some() && !tracked.is_empty() {
                write_json(json.as_deref(), &tracked)?;
                return Ok(!exceeded);
            }
            let folder = folder.unwrap_or_else(records);
            let report = reference(&folder)?;
            print_reference(&report);
            write_json(json.as_deref(), &report)?;
            let nan = report.lines.iter().any(|line| line.nan > 0);
            let beyond = report.lines.iter().any(|l| !l.beyond_tier_a.is_empty() || !l.beyond_tier_b.is_empty());
            let policy = report.policy.iter().all(|line| line.passed != Some(false));
            let failed = nan || !policy || exceeded || (strict && beyond);
            Ok(!failed)
        }
        Command::Stress { names, file, output } => {
            let mut tracks = Vec::new();
            for target in targets(&names, file.as_deref())? {
                tracks.extend(stress(&target).map_err(anyhow::Error::msg)?);
            }
            let table = markdown(&tracks);
            print!("{table}");
            if let Some(folder) = output {
                std::fs::create_dir_all(&folder).with_context(|| format!("cannot make {}", folder.display()))?;
                write_text(Some(&folder.join("stress.md")), || table)?;
                write_json(Some(&folder.join("stress.json")), &tracks)?;
                for (file, svg) in plots(&tracks) {
                    write_text(Some(&folder.join(file)), || svg)?;
                }
            }
            let policy = if file.is_some() { Vec::new() } else { policy(&records().join("policy.json"))? };
            if !policy.is_empty() {
                print_policy(&policy);
            }
            let failed = tracks.iter().filter(|track| !track.passed()).count();
            println!("\n{} blocks along sweeps, {failed} failed", tracks.len());
            Ok(failed == 0 && policy.iter().all(|line| line.passed != Some(false)))
        }
        Command::Bench { names, output } => {
            let list = verify::bench::bench(&names).map_err(anyhow::Error::msg)?;
            let table = verify::bench::markdown(&list);
            print!("{table}");
            if let Some(folder) = output {
                std::fs::create_dir_all(&folder).with_context(|| format!("cannot make {}", folder.display()))?;
                write_text(Some(&folder.join("bench.md")), || table)?;
                write_text(Some(&folder.join("bench.csv")), || verify::bench::csv(&list))?;
                for (file, svg) in verify::bench::plots(&list) {
                    write_text(Some(&folder.join(file)), || svg)?;
                }
            }
            Ok(true)
        }
        Command::Fuzz { target, minutes, seed, corpus } => {
            let time = std::time::Duration::try_from_secs_f64(60.0 * minutes).context("--minutes")?;
            let corpus = corpus.unwrap_or_else(|| target.corpus());
            let run = |text: &str| target.run(text);
            match fuzz::fuzz(&corpus, target.words(), fuzz::Budget::Time(time), seed, run) {
                Ok(fuzz::Summary { corpus, edited, outcomes }) => {
                    println!(
                        "{corpus} inputs and {edited} edited ones: {outcomes} different outcomes, none a panic or slow"
                    );
                    Ok(true)
                }
                Err(error) => match error.downcast::<fuzz::Finding>() {
                    Ok(finding) => {
                        println!("{finding}");
                        Ok(false)
                    }
                    Err(error) => Err(error),
                },
            }
        }
        Command::Show { name, routine, plan, counts } => {
            for listing in verify::listings(&name)? {
                match &routine {
                    _ if plan => print!("{}", listing.plans()),
                    _ if counts => print!("{}", listing.counts()),
                    None => print!("{}", listing.code()),
                    Some(routine) => {
                        let code = listing.routine(routine).with_context(|| {
                            let known = listing.routines().join(", ");
                            format!("{} has no routine `{routine}`; it has {known}", listing.name())
                        })?;
                        print!("{code}");
                    }
                }
            }
            Ok(true)
        }
        Command::Eval { records, output, digits } => {
            let source = digits.map_or(Source::GeneratedCode, |digits| Source::Truth { digits: digits.into() });
            let count = evaluate_file(&records, &output, source)?;
            println!("{count} records evaluated, written to {}", output.display());
            Ok(true)
        }
    }
}

/// The elements of the catalogue, or of a file, with these names; all of them for an empty list.
fn targets(names: &[String], file: Option<&Path>) -> anyhow::Result<Vec<Target>> {
    let Some(file) = file else {
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        return catalogue_targets(&names).map_err(anyhow::Error::msg);
    };
    let all = Target::of_file(file)?;
    if let Some(unknown) = names.iter().find(|name| all.iter().all(|target| target.name() != *name)) {
        let known: Vec<&str> = all.iter().map(Target::name).collect();
        anyhow::bail!("{} declares no {unknown}; it declares {}", file.display(), known.join(", "));
    }
    Ok(all.into_iter().filter(|target| names.is_empty() || names.iter().any(|name| name == target.name())).collect())
}

fn target_of_energy(name: &str, file: Option<&Path>) -> anyhow::Result<Target> {
    let own = file.map(Target::of_file).transpose()?.unwrap_or_default();
    let found = own.into_iter().find(|target| target.name() == name);
    let found = found.or_else(|| energy_elements::find(name).map(Target::of_catalogue));
    found.with_context(|| format!("neither the file nor the catalogue has an energy `{name}`"))
}

/// All checks at the inputs of a file, each at the element it names, or all at the one target.
fn audit_at_inputs(targets: &[Target], energy: Option<&Target>, file: &Path) -> anyhow::Result<Report> {
    let inputs = verify::audit::read_inputs(file)?;
    let mut report = Report::default();
    for (element, sample) in &inputs {
        let chosen: Vec<&Target> = match element {
            Some(name) => targets.iter().filter(|target| target.name() == name).collect(),
            None => targets.iter().collect(),
        };
        anyhow::ensure!(
            element.is_some() || chosen.len() == 1,
            "{}: name the element the input is for",
            file.display()
        );
        for target in chosen {
            let part = audit_at(target, energy, sample).map_err(|why| anyhow::anyhow!("{}: {why}", file.display()))?;
            report.merge(part);
        }
    }
    Ok(report)
}

/// The reference records of this repository.
fn records() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("data/potentials")
}

fn write_text(path: Option<&Path>, text: impl FnOnce() -> String) -> anyhow::Result<()> {
    let Some(path) = path else { return Ok(()) };
    verify::write_whole(path, text().as_bytes()).with_context(|| format!("cannot write {}", path.display()))
}

fn write_json(path: Option<&Path>, report: &impl serde::Serialize) -> anyhow::Result<()> {
    let Some(path) = path else { return Ok(()) };
    let text = serde_json::to_string_pretty(report)?;
    verify::write_whole(path, text.as_bytes()).with_context(|| format!("cannot write {}", path.display()))
}

fn table(headings: &[&str], numeric: &[usize]) -> Table {
    let mut table = Table::new();
    table.load_preset(presets::NOTHING).set_header(headings);
    for &column in numeric {
        if let Some(column) = table.column_mut(column) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    table
}

fn print_audit(report: &Report) {
    let mut table = table(&["element", "block", "check", "worst error", "allowed", "order", "verdict"], &[3, 4, 5]);
    for line in &report.lines {
        table.add_row([
            line.element.to_owned(),
            line.block.to_string(),
            line.check.title().to_owned(),
            format!("{:.1e}", line.worst),
            format!("{:.1e}", line.tolerance),
            line.order.map_or_else(String::new, |order| format!("{order:.2}")),
            if line.passed { "ok" } else { "FAILED" }.to_owned(),
        ]);
    }
    println!("{table}");
    let failures: Vec<_> = report.failures().collect();
    for line in &failures {
        println!("\n{}", describe_failure(line));
    }
    for (name, why) in &report.refused {
        println!("\n{name} cannot be audited: {why}");
    }
    for (element, mutant) in report.missed() {
        println!("\n{element}: nothing noticed a planted fault: {}", mutant.fault);
    }
    let scores: Vec<_> = report.sections.iter().filter_map(|section| section.mutations.as_ref()).collect();
    if !scores.is_empty() {
        println!(
            "\n{} of {} planted faults noticed; of others drawn, {} provably change nothing, {} change last bits only, {} change \
             nothing at any input tried",
            scores.iter().map(|score| score.caught()).sum::<usize>(),
            scores.iter().map(|score| score.mutants.len()).sum::<usize>(),
            scores.iter().map(|score| score.equivalent).sum::<usize>(),
            scores.iter().map(|score| score.within_rounding).sum::<usize>(),
            scores.iter().map(|score| score.without_effect).sum::<usize>()
        );
    }
    println!(
        "\n{} elements, {} checks, {} failed",
        report.elements(),
        report.lines.len(),
        failures.len() + report.refused.len() + report.missed().count()
    );
}

fn print_reference(report: &ReferenceReport) {
    let mut errors = table(
        &[
            "potential",
            "block",
            "records",
            "NaN",
            "worst, u",
            "worst, u·κ",
            "worst, u, exact edges",
            "tier A",
            "tier B",
        ],
        &[2, 3, 4, 5, 6],
    );
    for line in &report.lines {
        errors.add_row([
            line.potential.clone(),
            line.block.clone(),
            line.records.to_string(),
            line.nan.to_string(),
            format!("{:.2}", Short(line.worst)),
            format!("{:.2}", Short(line.worst_kappa)),
            line.worst_exact_edges.map_or_else(String::new, |worst| format!("{:.2}", Short(worst))),
            verdict(&line.beyond_tier_a, "8 u·κ"),
            line.tier_b.map_or_else(String::new, |bound| verdict(&line.beyond_tier_b, &format!("{bound} u"))),
        ]);
    }
    println!("{errors}");
    let beyond = |pick: fn(&BlockLine) -> &Vec<String>| {
        report.lines.iter().flat_map(|l| pick(l).iter().map(|id| format!("{id} ({})", l.block))).collect::<Vec<_>>()
    };
    let (a, b) = (beyond(|l| &l.beyond_tier_a), beyond(|l| &l.beyond_tier_b));
    println!("\nbeyond tier A: {}", if a.is_empty() { "none".into() } else { a.join(", ") });
    println!("beyond tier B: {}", if b.is_empty() { "none".into() } else { b.join(", ") });
    if !report.undeclared.is_empty() {
        println!("no element declared yet: {}", report.undeclared.join(", "));
    }
    if !report.policy.is_empty() {
        print_policy(&report.policy);
    }
}

fn print_families(lines: &[FamilyLine]) {
    if lines.is_empty() {
        return;
    }
    let mut table = table(&["tracking", "array", "cases", "worst error", "allowed", "verdict"], &[2, 3, 4]);
    for line in lines {
        table.add_row([
            line.family.to_owned(),
            line.array.clone(),
            line.cases.to_string(),
            format!("{:.1e}", line.worst),
            format!("{:.1e}", line.bound),
            if line.passed() { "ok".to_owned() } else { format!("FAILED ({})", line.worst_case) },
        ]);
    }
    println!("{table}\n");
}

fn print_policy(lines: &[PolicyLine]) {
    let mut table = table(&["degenerate input", "potential", "block", "status", "returned", "verdict"], &[]);
    for line in lines {
        let verdict = match line.passed {
            Some(true) => "ok",
            Some(false) => "FAILED",
            None => "–",
        };
        table.add_row([&line.record, &line.potential, &line.block, &line.status, &line.found, verdict]);
    }
    let judged = lines.iter().filter(|l| l.passed.is_some()).count();
    let passed = lines.iter().filter(|l| l.passed == Some(true)).count();
    println!("\n{table}\n\n{passed} of {judged} blocks at degenerate inputs as documented");
}

fn verdict(beyond: &[String], bound: &str) -> String {
    if beyond.is_empty() { format!("≤ {bound}") } else { format!("{} beyond {bound}", beyond.len()) }
}

/// A number that is written with an exponent only where it must be.
struct Short(f64);

impl std::fmt::Display for Short {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if self.0 < 1e5 { write!(f, "{:.2}", self.0) } else { write!(f, "{:.2e}", self.0) }
    }
}
