//! The report of an audit as a web page.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use energy_cli::plot::{Curve, logarithmic};

use verify::audit::{Accuracy, Check, Report, Section, describe_failure, escaped};
use verify::blocks::BlockName;

/// Formats the report as a self-contained page: formulas, tables, errors of differences against their step, errors by
/// configuration, planted faults.
#[must_use]
pub fn audit_page(report: &Report) -> String {
    let mut page = String::from(
        "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>Audit</title>\n<style>\n\
         body{font:15px/1.45 system-ui,sans-serif;max-width:72rem;margin:2rem auto;padding:0 1rem;color:#222}\n\
         table{border-collapse:collapse;margin:.6rem 0}td,th{padding:.15rem .7rem;border-bottom:1px solid #ddd;\
         text-align:left;font-variant-numeric:tabular-nums}td.n{text-align:right}\n\
         .ok{color:#176b2c}.failed{color:#b00020;font-weight:600}\
          pre{background:#f6f6f6;padding:.6rem;overflow-x:auto}\n\
         section{border-top:2px solid #444;margin-top:2rem}.plots{display:flex;flex-wrap:wrap;gap:.5rem}\n\
         .heat td{border:1px solid #fff;min-width:3.4rem;text-align:center}summary{cursor:pointer}\n\
         </style></head><body>\n<h1>Audit</h1>\n",
    );
    overview(&mut page, report);
    for section in &report.sections {
        element(&mut page, report, section);
    }
    page.push_str("<section><h2>Not looked at</h2>\n<ul>\n");
    for spot in report.blind_spots() {
        let _ = writeln!(page, "<li>{}</li>", escaped(&spot));
    }
    page.push_str("</ul></section>\n</body></html>\n");
    page
}

fn overview(page: &mut String, report: &Report) {
    let failed = report.failures().count() + report.refused.len() + report.missed().count();
    let class = if failed == 0 { "ok" } else { "failed" };
    let _ = writeln!(
        page,
        "<p class=\"{class}\">{} elements, {} checks, {failed} failed.</p>\n\
         <table><tr><th>element</th><th>worst error, u</th>\
         <th>worst error, u·κ</th><th>planted faults noticed</th><th>verdict</th></tr>",
        report.elements(),
        report.lines.len(),
    );
    for section in &report.sections {
        let worst = |pick: fn(&Accuracy) -> f64| section.accuracy.iter().map(pick).fold(0.0, f64::max);
        let faults =
            section.mutations.as_ref().map_or("–".into(), |m| format!("{} of {}", m.caught(), m.mutants.len()));
        let passed = report.lines.iter().filter(|l| l.element == section.element).all(|l| l.passed);
        let name = escaped(&section.element);
        let _ = writeln!(
            page,
            "<tr><td><a href=\"#{name}\">{name}</a></td>\
             <td class=\"n\">{:.2}</td><td class=\"n\">{:.2}</td><td>{faults}</td>\
             {}</tr>",
            worst(|a| a.worst),
            worst(|a| a.worst_kappa),
            verdict(passed)
        );
    }
    page.push_str("</table>\n");
    for (name, why) in &report.refused {
        let _ = writeln!(page, "<p class=\"failed\">{} cannot be audited: {}</p>", escaped(name), escaped(why));
    }
}

fn verdict(passed: bool) -> &'static str {
    if passed { "<td class=\"ok\">ok</td>" } else { "<td class=\"failed\">failed</td>" }
}

fn element(page: &mut String, report: &Report, section: &Section) {
    let name = escaped(&section.element);
    let _ = writeln!(page, "<section id=\"{name}\"><h2>{name} <small>{}</small></h2>", section.kind);
    let _ = writeln!(page, "<p>{}</p>", escaped(&section.docs));
    match energy_compiler::mathml(&section.source) {
        Some(formula) => page.push_str(&formula),
        None => {
            let _ = writeln!(page, "<pre>{}</pre>", escaped(&section.source));
        }
    }
    for line in report.failures().filter(|line| line.element == section.element) {
        let _ = writeln!(page, "<pre class=\"failed\">{}</pre>", escaped(&describe_failure(line)));
    }
    for warning in &section.warnings {
        let _ = writeln!(page, "<pre>warning: {}</pre>", escaped(&warning.describe(&section.element)));
    }
    accuracy(page, section);
    checks(page, report, section);
    plots(page, section);
    heat_map(page, section);
    faults(page, section);
    page.push_str("</section>\n");
}

fn accuracy(page: &mut String, section: &Section) {
    page.push_str(
        "<h3>Accuracy against multi-precision</h3>\
         <table><tr><th>block</th><th>inputs</th><th>worst, u</th><th>entry</th>\
         <th>worst, u·κ</th></tr>",
    );
    for line in &section.accuracy {
        let _ = writeln!(
            page,
            "<tr><td>{}</td><td class=\"n\">{}</td><td class=\"n\">{:.2}</td><td>{}</td>\
             <td class=\"n\">{:.2}</td></tr>",
            line.block,
            line.inputs,
            line.worst,
            escaped(&line.entry),
            line.worst_kappa
        );
    }
    page.push_str("</table>\n");
}

fn checks(page: &mut String, report: &Report, section: &Section) {
    page.push_str(
        "<h3>Checks</h3><table><tr><th>block</th><th>check</th><th>inputs</th><th>worst error</th><th>allowed</th>\
         <th>order</th><th>verdict</th></tr>",
    );
    for line in report.lines.iter().filter(|line| line.element == section.element) {
        let order = line.order.map_or_else(String::new, |order| format!("{order:.2}"));
        let _ = writeln!(
            page,
            "<tr><td>{}</td><td>{}</td><td class=\"n\">{}</td><td class=\"n\">{:.1e}</td><td class=\"n\">{:.1e}</td>\
             <td class=\"n\">{order}</td>{}</tr>",
            line.block,
            line.check.title(),
            line.inputs,
            line.worst,
            line.tolerance,
            verdict(line.passed)
        );
    }
    page.push_str("</table>\n");
}

fn plots(page: &mut String, section: &Section) {
    if section.curves.is_empty() {
        return;
    }
    page.push_str("<h3>Finite differences: error against step</h3><div class=\"plots\">");
    for curve in &section.curves {
        let points = |pick: fn(&(f64, f64, f64)) -> f64| curve.errors.iter().map(|e| (e.0, pick(e))).collect();
        let curves = [
            Curve { name: "central".into(), points: points(|e| e.1), joined: true },
            Curve { name: "extrapolated".into(), points: points(|e| e.2), joined: true },
        ];
        let title = format!("{} from {}", curve.block, curve.of);
        page.push_str(
            &logarithmic(&title, ("step / length", "relative error"), &curves, (420, 280)).unwrap_or_default(),
        );
    }
    page.push_str("</div>\n");
}

/// Draws the worst error by size and shape of the configuration.
fn heat_map(page: &mut String, section: &Section) {
    const SHAPES: usize = 5;
    let mut cells: BTreeMap<(BlockName, i32), [f64; SHAPES]> = BTreeMap::new();
    for spot in &section.spots {
        let row = cells.entry((spot.block, spot.size.log2().floor() as i32)).or_insert([f64::NAN; SHAPES]);
        let column = ((spot.shape * SHAPES as f64) as usize).min(SHAPES - 1);
        row[column] = row[column].max(spot.error);
    }
    if cells.is_empty() {
        return;
    }
    page.push_str("<h3>Worst error in u by configuration</h3><table class=\"heat\"><tr><th>block</th><th>size</th>");
    for column in 0..SHAPES {
        let (from, to) = (column as f64 / SHAPES as f64, (column + 1) as f64 / SHAPES as f64);
        let _ = write!(page, "<th>shortest/longest {from:.1}–{to:.1}</th>");
    }
    page.push_str("</tr>");
    for ((block, size), row) in cells {
        let _ = write!(page, "<tr><th>{block}</th><th>{}–{}</th>", f64::from(size).exp2(), f64::from(size + 1).exp2());
        for error in row {
            let _ = match error.is_nan() {
                true => write!(page, "<td></td>"),
                // From white at 0 to red at the 8 u that tier A allows.
                false => {
                    let shade = 255.0 - 155.0 * (error / 8.0).clamp(0.0, 1.0);
                    write!(page, "<td style=\"background:rgb(255,{shade:.0},{shade:.0})\">{error:.1}</td>")
                }
            };
        }
        page.push_str("</tr>");
    }
    page.push_str("</table>\n");
}

fn faults(page: &mut String, section: &Section) {
    let Some(score) = &section.mutations else { return };
    let _ = writeln!(
        page,
        "<h3>Planted faults</h3><p>{} of {} noticed; of others drawn, {} provably change nothing, \
         {} change last bits only, {} change nothing at \
         any input tried.</p>\
         <details><summary>which check notices which</summary><table><tr><th>fault</th><th>noticed by</th></tr>",
        score.caught(),
        score.mutants.len(),
        score.equivalent,
        score.within_rounding,
        score.without_effect
    );
    for mutant in &score.mutants {
        let by: Vec<&str> = mutant.caught_by.iter().map(|check: &Check| check.title()).collect();
        let by = if by.is_empty() { "<span class=\"failed\">nothing</span>".into() } else { by.join(", ") };
        let _ = writeln!(page, "<tr><td>{}</td><td>{by}</td></tr>", escaped(&mutant.fault));
    }
    page.push_str("</table></details>\n");
}
