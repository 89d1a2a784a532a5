//! An HTML page on a finished run: pictures, energies, times, evaluation counts, and the audit of its elements.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use verify::audit::{Check, Options, Report, Target, audit_all, describe_failure};

use super::record::{Record, RecordError};
use super::stats;
use crate::fabric::Material;
use crate::materials;
use crate::output::{OutputError, OutputFolder};
use crate::scene::Scene;
use crate::simulation::Summary;

/// A folder for which no page can be made.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
#[non_exhaustive]
pub enum ReportError {
    /// The record of the run cannot be read.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// A picture or plot exists but cannot be read.
    #[error("cannot read {}", .path.display())]
    Unreadable { path: PathBuf, source: std::io::Error },
    /// The page cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
}

/// Writes `report.html` from the files of a finished run and returns its path. The page is self-contained. The elements
/// of the run are audited again.
///
/// # Errors
/// Returns an error if a file is missing, damaged or newer than this program, or the page cannot be written.
pub fn write_report(folder: &Path) -> Result<PathBuf, ReportError> {
    let record = Record::read(folder)?;
    let picture = optional(&folder.join(OutputFolder::PICTURE))?;
    let plots = Plots {
        energy: optional(&folder.join(OutputFolder::LEDGER_PLOT))?,
        contact: optional(&folder.join(OutputFolder::CONTACT_PLOT))?,
    };
    let audit = audited(&record);
    let page = page(&record, picture.as_deref(), &plots, &audit);
    Ok(OutputFolder::unlocked(folder)?.write(OutputFolder::REPORT, page.as_bytes())?)
}

/// The largest picture or plot, in bytes.
const LARGEST_FILE: u64 = 64 << 20;

fn read(path: &Path) -> Result<Vec<u8>, ReportError> {
    energy_files::read_state(path, LARGEST_FILE)
        .map_err(|source| ReportError::Unreadable { path: path.to_owned(), source })
}

/// Reads a file that the scene may have disabled; `None` if it does not exist.
fn optional(path: &Path) -> Result<Option<Vec<u8>>, ReportError> {
    if path.symlink_metadata().is_ok() { read(path).map(Some) } else { Ok(None) }
}

/// The result of the audit of one element.
struct Verdict {
    element: String,
    passed: bool,
    text: String,
}

fn audited(record: &Record) -> Vec<Verdict> {
    let mut elements: Vec<&str> = record.summary.terms.iter().map(|term| term.element.as_str()).collect();
    elements.sort_unstable();
    elements.dedup();
    let own = own_targets(record);
    let target = |name: &str| {
        let declared = own.iter().find(|target| target.name() == name).cloned();
        declared.or_else(|| materials::element(name).map(Target::of_element))
    };
    let verdict = |name: &str| match target(name) {
        Some(target) => verdict_on(name, &audit_all(&[target], None, Options::default())),
        None => {
            let text = "its declaration is no longer where the scene had it".to_owned();
            Verdict { element: name.to_owned(), passed: false, text }
        }
    };
    elements.into_iter().map(verdict).collect()
}

fn verdict_on(name: &str, report: &Report) -> Verdict {
    let worst = |check: Check| {
        let lines = report.lines.iter().filter(|line| line.check == check);
        lines.map(|line| line.worst).reduce(f64::max).map_or("–".into(), |worst| format!("{worst:.0e}"))
    };
    let failures: Vec<String> = report.failures().map(describe_failure).collect();
    let refused = report.refused.iter().map(|(_, reason)| reason.clone());
    let all: Vec<String> = failures.into_iter().chain(refused).collect();
    let text = match &all[..] {
        [] => format!(
            "{} checks; worst relative error {} by dual numbers, {} by finite differences",
            report.lines.len(),
            worst(Check::DualNumbers),
            worst(Check::FiniteDifferences)
        ),
        failures => failures.join("; "),
    };
    Verdict { element: name.to_owned(), passed: all.is_empty(), text }
}

/// Returns the declarations in the scene's own files.
fn own_targets(record: &Record) -> Vec<Target> {
    let Ok(scene) = Scene::parse(&record.scene, &record.path) else { return Vec::new() };
    let files = scene.garments.iter().filter_map(|garment| match &garment.fabric.material {
        Material::File(declared) => Some(declared.path.clone()),
        _ => None,
    });
    files.filter_map(|file| Target::of_file(&file).ok()).flatten().collect()
}

/// The plots of a run, as SVG.
#[derive(Default)]
struct Plots {
    energy: Option<Vec<u8>>,
    contact: Option<Vec<u8>>,
}

fn page(record: &Record, picture: Option<&[u8]>, plots: &Plots, audit: &[Verdict]) -> String {
    let mut page = String::new();
    let mut add = |arguments: std::fmt::Arguments<'_>| {
        page.write_fmt(arguments).expect("writing to a string succeeds");
        page.push('\n');
    };
    let title = escaped(&record.path.file_name().unwrap_or_default().to_string_lossy());
    add(format_args!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n{POLICY}\n<title>{title}</title>"
    ));
    add(format_args!("<style>{STYLE}</style>\n</head>\n<body>\n<h1>{title}</h1>"));
    let Summary { vertices, pinned, triangles, integrator, dt, .. } = &record.summary;
    let steps = record.summary.totals.steps;
    add(format_args!(
        "<p>{vertices} vertices ({pinned} pinned), {triangles} triangles; \
         {steps} steps of {dt} s by {}; {} frames.{}</p>",
        escaped(integrator),
        record.frames,
        if record.finished { "" } else { " <b>Stopped before its end.</b>" }
    ));
    add(format_args!("<p>{}.</p>", record.summary.sleep()));
    for warning in &record.summary.warnings {
        add(format_args!("<p class=\"bad\">{}</p>", escaped(warning)));
    }
    if let Some(picture) = picture {
        let data = STANDARD.encode(picture);
        add(format_args!("<img alt=\"The last frame\" src=\"data:image/png;base64,{data}\">"));
    }
    for (title, plot) in [("Energy", &plots.energy), ("Contact", &plots.contact)] {
        if let Some(plot) = plot {
            // In an `img` element, an untrusted SVG cannot run scripts or load other files.
            let data = STANDARD.encode(plot);
            add(format_args!("<h2>{title}</h2>\n<img alt=\"{title}\" src=\"data:image/svg+xml;base64,{data}\">"));
        }
    }
    add(format_args!("<h2>Time</h2>\n{}", times(&record.summary)));
    add(format_args!("<h2>Evaluated and skipped</h2>\n{}", evaluated(&record.summary)));
    add(format_args!("<h2>Audit of the elements</h2>\n{}", verdicts(audit)));
    add(format_args!("<h2>At the end</h2>\n<pre>{}</pre>", escaped(&record.summary.to_string())));
    add(format_args!("<h2>Scene</h2>\n<pre>{}</pre>\n</body>\n</html>", escaped(&record.scene)));
    page
}

/// Nothing in the page is executed or loaded from elsewhere.
const POLICY: &str = "<meta http-equiv=\"Content-Security-Policy\" \
                      content=\"default-src 'none'; img-src data:; style-src 'unsafe-inline'\">";

const STYLE: &str = "\
body{font:15px/1.5 system-ui,sans-serif;max-width:70rem;margin:2rem auto;padding:0 1rem;color:#222}\
img{max-width:100%;height:auto}\
table{border-collapse:collapse;display:block;overflow-x:auto;font-size:13px;font-variant-numeric:tabular-nums}\
td,th{padding:.2rem .6rem;border-bottom:1px solid #ddd;text-align:right}td:not(.text){white-space:nowrap}\
td:first-child,th:first-child,td.text{text-align:left}pre{background:#f5f5f5;padding:1rem;overflow:auto;font-size:13px}\
.good{color:#176617}.bad{color:#a01818}";

fn times(summary: &Summary) -> String {
    let total = summary.totals.stepping_time.as_secs_f64();
    let named = summary.named_phases();
    let known: f64 = named.iter().map(|(_, time)| time.as_secs_f64()).sum();
    let all = named.map(|(name, time)| (name, time.as_secs_f64())).into_iter().chain([("other", total - known)]);
    let per_step = 1e3 / summary.totals.steps.max(1) as f64;
    let row = |name: &str, seconds: f64| {
        let part = 100.0 * seconds / total.max(f64::MIN_POSITIVE);
        format!("<tr><td>{name}</td><td>{seconds:.3}</td><td>{:.3}</td><td>{part:.1}</td></tr>\n", seconds * per_step)
    };
    let rows: String = all.map(|(name, seconds)| row(name, seconds)).chain([row("<b>all</b>", total)]).collect();
    let mean = summary.totals.iterations as f64 / summary.totals.solves.max(1) as f64;
    format!(
        "<table><tr><th>phase</th><th>s</th><th>ms per step</th><th>%</th></tr>\n{rows}</table>\n\
         <p>{} linear solves, {mean:.1} iterations each; \
         {} steps with projected Hessians; {} rejected.</p>",
        summary.totals.solves, summary.totals.projected, summary.totals.rejected
    )
}

fn evaluated(summary: &Summary) -> String {
    let cell = |number: Option<u64>| format!("<td>{}</td>", number.map_or("–".to_owned(), |count| count.to_string()));
    let rows = summary.terms.iter().map(|term| {
        let energy = term.energy.map_or("–".to_owned(), |energy| format!("{energy:.4e}"));
        let counts: String = stats::evaluated(term).into_iter().chain([term.reused]).map(cell).collect();
        let (name, element) = (escaped(&term.name), escaped(&term.element));
        format!("<tr><td>{name}</td><td class=\"text\">{element}</td><td>{energy}</td>{counts}</tr>\n")
    });
    let left_out: String =
        summary.left_out.iter().map(|reason| format!("<p>Left out: {}.</p>\n", escaped(reason))).collect();
    format!(
        "<table><tr><th>term</th><th>element</th><th>energy, J</th><th>value</th><th>skipped</th>\
         <th>gradient</th><th>skipped</th>\
         <th>Hessian</th><th>skipped</th><th>flagged</th><th>projected</th><th>reused</th></tr>\n\
         {}</table>\n{left_out}",
        rows.collect::<String>()
    )
}

fn verdicts(audit: &[Verdict]) -> String {
    let row = |verdict: &Verdict| {
        let (class, word) = if verdict.passed { ("good", "passed") } else { ("bad", "failed") };
        let (element, text) = (escaped(&verdict.element), escaped(&verdict.text));
        format!("<tr><td>{element}</td><td class=\"text {class}\">{word}</td><td class=\"text\">{text}</td></tr>\n")
    };
    format!("<table>{}</table>", audit.iter().map(row).collect::<String>())
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;").replace('\'', "&#39;")
}
