use std::path::PathBuf;

use clap::Args;
use energy_cli::print;
use verify_command::reference::{BlockLine, FamilyLine, ReferenceReport, fusion_reference, reference};

use super::output::{data, records, table, write_json};
use super::policy;

/// Measures the errors of the generated code against reference values. Exit status 1 on a NaN, or if a degenerate
/// input is not treated as documented. Errors beyond tier A or B are listed.
#[derive(Args)]
pub struct Reference {
    /// A folder of `potref-1` files [default: the copy in this repository].
    folder: Option<PathBuf>,
    /// Also write the report to this file.
    #[arg(long)]
    json: Option<PathBuf>,
    /// Exit status 1 also on errors beyond tier A or B.
    #[arg(long)]
    strict: bool,
}

impl Reference {
    pub fn run(self) -> anyhow::Result<bool> {
        // Records of tracking have a format of their own.
        let tracking = self.folder.clone().unwrap_or_else(|| data().join("fusion")).join("reference.json");
        let tracked = if tracking.exists() { fusion_reference(&tracking)? } else { Vec::new() };
        print_families(&tracked)?;
        let exceeded = tracked.iter().any(|line| !line.passed());
        if self.folder.is_some() && !tracked.is_empty() {
            write_json(self.json.as_deref(), &tracked)?;
            return Ok(!exceeded);
        }
        let report = reference(&self.folder.unwrap_or_else(records))?;
        show(&report)?;
        write_json(self.json.as_deref(), &report)?;
        let nan = report.lines.iter().any(|line| line.nan > 0);
        let beyond = report.lines.iter().any(|l| !l.beyond_tier_a.is_empty() || !l.beyond_tier_b.is_empty());
        let failed = nan || !policy::passed(&report.policy) || exceeded || (self.strict && beyond);
        Ok(!failed)
    }
}

fn show(report: &ReferenceReport) -> anyhow::Result<()> {
    let headings =
        ["potential", "block", "records", "NaN", "worst, u", "worst, u·κ", "worst, u, exact edges", "tier A", "tier B"];
    let mut errors = table(&headings, &[2, 3, 4, 5, 6]);
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
    print(&format!("{errors}\n"))?;
    let beyond = |pick: fn(&BlockLine) -> &Vec<String>| {
        report.lines.iter().flat_map(|l| pick(l).iter().map(|id| format!("{id} ({})", l.block))).collect::<Vec<_>>()
    };
    let (a, b) = (beyond(|l| &l.beyond_tier_a), beyond(|l| &l.beyond_tier_b));
    print(&format!("\nbeyond tier A: {}\n", if a.is_empty() { "none".into() } else { a.join(", ") }))?;
    print(&format!("beyond tier B: {}\n", if b.is_empty() { "none".into() } else { b.join(", ") }))?;
    if !report.undeclared.is_empty() {
        print(&format!("potentials without a declared element: {}\n", report.undeclared.join(", ")))?;
    }
    policy::show(&report.policy)
}

fn print_families(lines: &[FamilyLine]) -> anyhow::Result<()> {
    if lines.is_empty() {
        return Ok(());
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
    print(&format!("{table}\n\n"))
}

fn verdict(beyond: &[String], bound: &str) -> String {
    if beyond.is_empty() { format!("≤ {bound}") } else { format!("{} beyond {bound}", beyond.len()) }
}

/// A number that is printed with an exponent only if it is large.
struct Short(f64);

impl std::fmt::Display for Short {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if self.0 < 1e5 { write!(f, "{:.2}", self.0) } else { write!(f, "{:.2e}", self.0) }
    }
}
