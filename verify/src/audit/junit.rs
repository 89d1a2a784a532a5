use std::fmt::Write as _;

use super::report::{Report, describe_failure};

/// Formats the report as JUnit XML: one suite per element, one case per check of a block and per planted fault.
#[must_use]
pub fn junit(report: &Report) -> String {
    let mut suites = String::new();
    let (mut tests, mut failures) = (0, 0);
    for section in &report.sections {
        let mut cases = String::new();
        let (mut own, mut failed) = (0, 0);
        let mut case = |name: &str, failure: Option<String>| {
            own += 1;
            let name = escaped(name);
            let class = escaped(&section.element);
            let _ = match failure {
                None => writeln!(cases, "    <testcase classname=\"{class}\" name=\"{name}\"/>"),
                Some(text) => {
                    failed += 1;
                    let text = escaped(&text);
                    writeln!(
                        cases,
                        "    <testcase classname=\"{class}\" name=\"{name}\"><failure>{text}</failure></testcase>"
                    )
                }
            };
        };
        for line in report.lines.iter().filter(|line| line.element == section.element) {
            let failure = (!line.passed).then(|| describe_failure(line));
            case(&format!("{} of {}", line.check.title(), line.block), failure);
        }
        for mutant in section.mutations.iter().flat_map(|score| &score.mutants) {
            let missed = mutant.caught_by.is_empty().then(|| "no check noticed it".to_owned());
            case(&format!("planted fault: {}", mutant.fault), missed);
        }
        let name = escaped(&section.element);
        let _ = writeln!(
            suites,
            "  <testsuite name=\"{name}\" tests=\"{own}\" failures=\"{failed}\">\n{cases}  </testsuite>"
        );
        tests += own;
        failures += failed;
    }
    for (name, why) in &report.refused {
        let (name, why) = (escaped(name), escaped(why));
        let _ = writeln!(
            suites,
            "  <testsuite name=\"{name}\" tests=\"1\" failures=\"0\" errors=\"1\">\n    <testcase classname=\"{name}\" \
             name=\"audit\"><error>{why}</error></testcase>\n  </testsuite>"
        );
        tests += 1;
    }
    let errors = report.refused.len();
    format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuites tests=\"{tests}\" failures=\"{failures}\" \
         errors=\"{errors}\">\n{suites}</testsuites>\n"
    )
}

/// Escapes the characters that XML and HTML reserve.
#[must_use]
pub fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
