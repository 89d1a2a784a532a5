//! Results of all tests of a fabric: table, CSV, JSON and plots.

use std::fmt;
use std::fmt::Write as _;

use comfy_table::{CellAlignment, Table, presets};
use energy_cli::plot::{Axes, Line, linear};
use serde::Serialize;

use super::{Curve, Outcome, TesterError};

/// Names of the files of results, other than the plots `tensile.svg` and so on.
pub const RESULT_FILES: [&str; 2] = ["curves.csv", "results.json"];

/// The finished tests of a fabric. `Display` prints their numbers as a table.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Results {
    /// The name of the fabric.
    pub fabric: String,
    /// The finished tests.
    pub outcomes: Vec<Outcome>,
}

impl Results {
    /// Formats all curves as CSV: test, `simulated` or `input`, x, y.
    #[must_use]
    pub fn csv(&self) -> String {
        let mut text = "test,curve,x,y,axes\n".to_owned();
        for Outcome { trial, axes: [across, up], simulated, input, .. } in &self.outcomes {
            for (name, curve) in [("simulated", simulated), ("input", input)] {
                for [x, y] in curve {
                    let _ = writeln!(text, "{trial},{name},{x:e},{y:e},{across}; {up}");
                }
            }
        }
        text
    }

    /// Plots the simulated curves and the input, one plot per kind of test: file name and SVG.
    ///
    /// # Errors
    /// Returns an error if a plot cannot be drawn.
    pub fn plots(&self) -> Result<Vec<(String, String)>, TesterError> {
        let mut plots: Vec<(String, String)> = Vec::new();
        for kind in super::Trial::KINDS {
            let own: Vec<&Outcome> = self.outcomes.iter().filter(|outcome| outcome.kind == kind).collect();
            if !own.is_empty() {
                let name = format!("{kind}.svg");
                let svg = self.plot(kind, &own);
                plots.push((name.clone(), svg.map_err(|message| TesterError::Plot { name, message })?));
            }
        }
        Ok(plots)
    }

    fn plot(&self, kind: &str, outcomes: &[&Outcome]) -> Result<String, String> {
        // Colours of Okabe and Ito, which people with colour blindness can tell apart.
        let colours = [[(0, 114, 178), (86, 180, 233)], [(213, 94, 0), (230, 159, 0)]];
        let named = |outcome: &Outcome, curve: &str| format!("{} {curve}", outcome.trial);
        let names: Vec<[String; 2]> =
            outcomes.iter().map(|outcome| ["simulated", "input"].map(|curve| named(outcome, curve))).collect();
        let points = |curve: &Curve| curve.iter().map(|[x, y]| (*x, *y)).collect::<Vec<_>>();
        let mut lines = Vec::new();
        for ((outcome, names), colours) in outcomes.iter().zip(&names).zip(colours) {
            let [simulated, input] = [&outcome.simulated, &outcome.input].map(points);
            lines.push(Line { name: &names[1], colour: colours[1], points: input });
            lines.push(Line { name: &names[0], colour: colours[0], points: simulated });
        }
        let range = |pick: fn(&(f64, f64)) -> f64| {
            let values = || lines.iter().flat_map(|line| &line.points).map(pick).filter(|value| value.is_finite());
            let (low, high) = (values().fold(0.0, f64::min), values().fold(0.0, f64::max));
            let margin = 0.04 * (high - low).max(f64::MIN_POSITIVE);
            low - margin..high + margin
        };
        let title = format!("{}: {kind}", self.fabric);
        let (across, up) = (range(|point| point.0), range(|point| point.1));
        let [across_label, up_label] = outcomes.first().map_or(["", ""], |outcome| outcome.axes);
        let size = if kind == "drape" { (640, 640) } else { (820, 520) };
        linear(&Axes { title: &title, labels: (across_label, up_label), across, up, size }, &lines)
    }
}

impl fmt::Display for Results {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut table = Table::new();
        table.load_preset(presets::NOTHING);
        table.set_header([self.fabric.as_str(), "simulated", "input", "unit", "in KES units"]);
        let text = |number: Option<f64>| number.map_or_else(|| "–".to_owned(), |number| format!("{number:.4}"));
        for number in self.outcomes.iter().flat_map(|outcome| &outcome.numbers) {
            let kes = number.kes.map_or_else(String::new, |(number, unit)| format!("{number:.4} {unit}"));
            let cells = [text(number.simulated), text(number.input), number.unit.to_owned(), kes];
            table.add_row([number.name.clone()].into_iter().chain(cells));
        }
        table.column_iter_mut().skip(1).take(2).for_each(|column| column.set_cell_alignment(CellAlignment::Right));
        write!(f, "{table}")
    }
}
