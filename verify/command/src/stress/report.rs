use std::fmt::Write as _;

use energy_cli::plot::{Curve, logarithmic};

use super::{Point, Track};

/// Formats a Markdown table: one row per block of each sweep of each element.
#[must_use]
pub fn markdown(tracks: &[Track]) -> String {
    let mut text = String::from(
        "| element | sweep | block | generated, worst u | over κ | textbook, worst u | textbook NaN | flagged | |\n\
         |---|---|---|---:|---:|---:|---:|---:|---|\n",
    );
    for track in tracks {
        let worst = |pick: fn(&Point) -> f64| {
            let values = track.points.iter().filter(|p| p.is_defined && !p.flagged && !p.overflows).map(pick);
            values.filter(|x| x.is_finite()).fold(0.0, f64::max)
        };
        let count = |pick: fn(&Point) -> bool| track.points.iter().filter(|p| pick(p)).count();
        let _ = writeln!(
            text,
            "| {} | {} | {} | {} | {:.1} | {} | {} | {} | {} |",
            track.element,
            track.sweep,
            track.block,
            short(worst(|p| p.robust)),
            worst(|p| p.robust_kappa),
            short(worst(|p| p.naive)),
            count(|p| p.is_defined && p.naive.is_nan()),
            count(|p| p.flagged),
            if track.passed() { "ok" } else { "**fails**" }
        );
    }
    text
}

/// Formats a number, with an exponent only if needed.
fn short(value: f64) -> String {
    if value < 1e4 { format!("{value:.1}") } else { format!("{value:.0e}") }
}

/// Draws a plot for each block of each sweep, with its file name: errors of generated code and textbook form against
/// the parameter.
#[must_use]
pub fn plots(tracks: &[Track]) -> Vec<(String, String)> {
    tracks
        .iter()
        .filter_map(|track| {
            let points = |pick: fn(&Point) -> f64| {
                // Exact results lie at the lower edge of the plot.
                track.points.iter().filter(|p| p.is_defined).map(|p| (p.parameter, pick(p).max(1e-2))).collect()
            };
            let curves = [
                Curve { name: "generated code".into(), points: points(|p| p.robust), joined: true },
                Curve {
                    name: "textbook form".into(),
                    points: points(|p| if p.naive.is_nan() { 0.0 } else { p.naive }),
                    joined: false,
                },
            ];
            let title = format!("{}: {}, {}", track.element, track.sweep, track.block);
            let svg = logarithmic(&title, ("parameter", "error, u"), &curves, (520, 320))?;
            let file = format!("{}-{}-{}.svg", track.element, track.sweep.replace(' ', "-"), track.block);
            Some((file, svg))
        })
        .collect()
}
