//! The comparison table of the workspace's README.

use std::fmt::Write;

use crate::coincident::Verdict;
use crate::contender::{Contender, Source};
use crate::for_each_kernel;
use crate::measure::Measured;
use crate::report::Report;
use crate::subject::Subject;

/// The line before the table.
pub const BEGIN: &str = "<!-- benchmark: begin -->";
/// The line after the table.
pub const END: &str = "<!-- benchmark: end -->";

/// Times in nanoseconds of contenders that this program cannot run, and of generated code in the same run (one core of
/// an AMD EPYC with AVX-512; 1,024 elements).
const DATED: [(&str, [&str; 5]); 4] = [
    ("TinyAD, scalar (point to plane: gradient only), November 2026", ["185", "1,770", "3,098", "3,118", "854"]),
    ("SymX, AVX2, packed, November 2026", ["8.3", "22", "130", "25", "156"]),
    ("generated, scalar loop, November 2026", ["14", "32", "95", "28", "91"]),
    ("generated, AVX-512 lanes, November 2026", ["4.5", "9.0", "22", "10", "20"]),
];

/// A row that this program measures: the name, the contenders whose best time counts, and the source of their results.
type MeasuredRow = (&'static str, fn(Contender) -> bool, Source);

const MEASURED: [MeasuredRow; 7] = [
    ("generated, scalar loop", |c| matches!(c, Contender::GeneratedScalar(_)), Source::Generated),
    ("generated, SIMD lanes", |c| matches!(c, Contender::GeneratedLanes(_)), Source::Generated),
    ("hand-derived, scalar loop", |c| matches!(c, Contender::HandScalar(_)), Source::HandDerived),
    ("hand-derived, SIMD lanes", |c| matches!(c, Contender::HandLanes(_)), Source::HandDerived),
    ("num-dual", |c| c == Contender::Dual, Source::NumDual),
    ("SymPy, C", |c| c == Contender::SymPy, Source::SymPy),
    ("CasADi, C", |c| c == Contender::CasADi, Source::CasADi),
];

const MISSING: &str = "–";

/// Returns the table in Markdown. It always has all rows and columns; a cell without a measurement is a dash.
#[must_use]
pub fn comparison(report: &Report) -> String {
    let mut columns = vec!["ns for value, gradient, Hessian"];
    macro_rules! title {
        ($kernel:ty) => {
            columns.push(<$kernel as Subject>::TITLE)
        };
    }
    for_each_kernel!(title);
    columns.extend(["gradient error near rest", "coincident points"]);
    let mut table = row(&columns) + &row(&vec!["---"; columns.len()]).replace(' ', "");
    for (name, times) in DATED {
        let cells: Vec<&str> = [name].into_iter().chain(times).chain([MISSING, MISSING]).collect();
        table += &row(&cells);
    }
    for (name, contenders, source) in MEASURED {
        let mut cells = vec![name.to_owned()];
        macro_rules! time {
            ($kernel:ty) => {{
                let measured = report.kernels.iter().find(|measured| measured.key == <$kernel as Subject>::KEY);
                cells.push(
                    measured.and_then(|measured| measured.best(contenders)).map_or(MISSING.to_owned(), nanoseconds),
                );
            }};
        }
        for_each_kernel!(time);
        cells.push(error_near_rest(&report.kernels, source));
        cells.push(coincident_points(&report.kernels, source));
        table += &row(&cells);
    }
    table
}

fn row<T: AsRef<str>>(cells: &[T]) -> String {
    let mut line = String::from("|");
    for cell in cells {
        let _ = write!(line, " {} |", cell.as_ref());
    }
    line + "\n"
}

/// One decimal below 10, thousands separated by commas.
fn nanoseconds(time: f64) -> String {
    match time {
        ..9.95 => format!("{time:.1}"),
        ..999.5 => format!("{time:.0}"),
        _ => format!("{},{:03}", time.round() as u64 / 1000, time.round() as u64 % 1000),
    }
}

/// The largest error of all kernels that have a rest shape.
fn error_near_rest(kernels: &[Measured], source: Source) -> String {
    let errors = kernels.iter().flat_map(|kernel| &kernel.near_rest).filter(|error| error.source == source);
    let largest = errors.map(|error| error.roundoffs).max_by(f64::total_cmp);
    largest.map_or(MISSING.to_owned(), roundoffs)
}

/// An error in units of roundoff, as tables print it.
pub(crate) fn roundoffs(error: f64) -> String {
    if error < 1e3 { format!("{error:.1} u") } else { format!("{error:.0e} u") }
}

/// One verdict if all kernels share it, otherwise the number of kernels with each.
fn coincident_points(kernels: &[Measured], source: Source) -> String {
    let outcomes = kernels.iter().flat_map(|kernel| &kernel.coincident).filter(|outcome| outcome.source == source);
    let verdicts: Vec<Verdict> = outcomes.map(|outcome| outcome.verdict).collect();
    let count = |verdict| (verdicts.iter().filter(|&&found| found == verdict).count(), verdict);
    let counts = [Verdict::Right, Verdict::NotFinite, Verdict::Wrong].map(count);
    let found: Vec<_> = counts.into_iter().filter(|(count, _)| *count > 0).collect();
    match found.as_slice() {
        [] => MISSING.to_owned(),
        [(_, verdict)] => verdict.to_string(),
        several => several.iter().map(|(count, verdict)| format!("{count} {verdict}")).collect::<Vec<_>>().join(", "),
    }
}
