//! The audit on the command line.
#![forbid(unsafe_code)]

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use anyhow::Context;
use clap::{Parser, Subcommand};
use comfy_table::{CellAlignment, Table, presets};
use verify::audit::{Options, Report, audit_catalogue, describe_failure};
use verify::reference::{
    BlockLine, FamilyLine, PolicyLine, ReferenceReport, evaluate_file, evaluate_fusion, fusion_reference, reference,
};

/// Audits the derivatives of declared elements, and measures them against multi-precision reference values.
#[derive(Parser)]
#[command(version)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Compare every derivative with dual numbers and finite differences; exit status 1 on any failure.
    Audit {
        /// Elements to audit; all of them if none is named.
        names: Vec<String>,
        /// Random inputs for each element.
        #[arg(long, default_value_t = 200)]
        samples: usize,
        /// What the inputs are drawn from.
        #[arg(long, default_value_t = 1)]
        seed: u64,
        /// A few samples only.
        #[arg(long, conflicts_with = "samples")]
        quick: bool,
        /// Also write the report to this file.
        #[arg(long)]
        json: Option<PathBuf>,
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
    /// Evaluate the records of a file and write them with the results, 17 digits, and flags.
    Eval {
        /// A `potref-1` or `potref-policy-1` file, or one of body tracking (see `data/fusion`).
        records: PathBuf,
        /// Where to write.
        #[arg(short, long)]
        output: PathBuf,
    },
}

fn main() -> ExitCode {
    match run(Arguments::parse().command) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::from(2)
        }
    }
}

fn run(command: Command) -> anyhow::Result<bool> {
    match command {
        Command::Audit { names, samples, seed, quick, json } => {
            let names: Vec<&str> = names.iter().map(String::as_str).collect();
            let options = Options { samples: if quick { 20 } else { samples }, seed };
            let report = audit_catalogue(&names, options).map_err(anyhow::Error::msg)?;
            print_audit(&report);
            write_json(json.as_deref(), &report)?;
            Ok(report.passed())
        }
        Command::Reference { folder, json, strict } => {
            let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("data");
            // Body tracking has a file of its own shape.
            let tracking = folder.as_ref().unwrap_or(&data.join("fusion")).join("reference.json");
            let tracked = if tracking.exists() { fusion_reference(&tracking)? } else { Vec::new() };
            print_families(&tracked);
            let within = tracked.iter().all(FamilyLine::passed);
            if folder.is_some() && !tracked.is_empty() {
                write_json(json.as_deref(), &tracked)?;
                return Ok(within);
            }
            let folder = folder.unwrap_or_else(|| data.join("potentials"));
            let report = reference(&folder)?;
            print_reference(&report);
            write_json(json.as_deref(), &report)?;
            let nan = report.lines.iter().any(|line| line.nan > 0);
            let beyond = report.lines.iter().any(|l| !l.beyond_tier_a.is_empty() || !l.beyond_tier_b.is_empty());
            let policy = report.policy.iter().all(|line| line.passed != Some(false));
            Ok(!nan && policy && within && !(strict && beyond))
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
        Command::Eval { records, output } => {
            let count = match evaluate_fusion(&records, &output)? {
                Some(count) => count,
                None => evaluate_file(&records, &output)?,
            };
            println!("{count} records evaluated, written to {}", output.display());
            Ok(true)
        }
    }
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
    println!(
        "\n{} elements, {} checks, {} failed",
        report.elements(),
        report.lines.len(),
        failures.len() + report.refused.len()
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
