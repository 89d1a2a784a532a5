//! Audits two energies that are declared in a string and prints the report: `cargo run -p verify --example audit`.

use verify::audit::{Options, Target, audit_all, describe_failure};

const DECLARATIONS: &str = "
energy Charges(p, q: Point; k: Scalar[J m]) { k / norm(p - q) }
energy Spring(p, q: Point; k: Scalar[N/m], L: Scalar[m]) { k / 2 * (norm(p - q) - L)^2 }
";

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let targets = Target::of_text(DECLARATIONS, "pair.energy")?;
    let report = audit_all(&targets, None, Options::quick());
    for line in &report.lines {
        let (block, check) = (line.block.to_string(), line.check.title());
        println!("{:8} {block:8} {check:24} {:8.1e} of {:.1e}", line.element, line.worst, line.tolerance);
    }
    for failure in report.failures() {
        println!("{}", describe_failure(failure));
    }
    assert!(report.passed());
    Ok(())
}
