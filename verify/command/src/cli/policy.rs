//! Results at degenerate inputs, which two commands print.

use energy_cli::print;
use verify_command::reference::PolicyLine;

use super::output::table;

/// Whether every result with a documented value is that value.
pub fn passed(lines: &[PolicyLine]) -> bool {
    lines.iter().all(|line| line.passed != Some(false))
}

/// Prints the results, if there are any.
pub fn show(lines: &[PolicyLine]) -> anyhow::Result<()> {
    if lines.is_empty() {
        return Ok(());
    }
    let mut table = table(&["degenerate input", "potential", "block", "status", "returned", "verdict"], &[]);
    for line in lines {
        let verdict = match line.passed {
            Some(true) => "ok",
            Some(false) => "FAILED",
            None => "–",
        };
        table.add_row([&line.record, &line.potential, &line.block, &line.status, &line.found, verdict]);
    }
    let checked = lines.iter().filter(|line| line.passed.is_some()).count();
    let passed = lines.iter().filter(|line| line.passed == Some(true)).count();
    print(&format!("\n{table}\n\n{passed} of {checked} blocks at degenerate inputs as documented\n"))
}
