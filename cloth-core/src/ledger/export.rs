use std::fmt::Write as _;

use plotters::prelude::*;

use super::{Entry, Ledger};
use crate::geometry::norm;

impl Ledger {
    /// Formats the ledger as CSV, one line per entry.
    #[must_use]
    pub fn csv(&self) -> String {
        let mut text = "time [s],kinetic [J]".to_owned();
        let mut line = |arguments: std::fmt::Arguments<'_>| {
            text.write_fmt(arguments).expect("writing to a string succeeds");
        };
        let quoted = |name: &str| name.replace(['"', ',', '\n'], " ");
        self.potentials.iter().for_each(|name| line(format_args!(",potential {} [J]", quoted(name))));
        self.works.iter().for_each(|name| line(format_args!(",work {} [J]", quoted(name))));
        line(format_args!(",work pins [J],work obstacles [J],work sleep [J],energy [J],unaccounted [J]"));
        line(format_args!(",Px [kg m/s],Py [kg m/s],Pz [kg m/s],Lx [kg m^2/s],Ly [kg m^2/s],Lz [kg m^2/s]"));
        if self.in_contact {
            line(format_args!(",contact force [N],on obstacles x [N],on obstacles y [N],on obstacles z [N]"));
        }
        line(format_args!("\n"));
        for entry in &self.entries {
            let numbers = [entry.time, entry.kinetic].into_iter().chain(entry.potential.iter().copied());
            let numbers = numbers.chain(entry.work.iter().copied()).chain([entry.pins, entry.obstacles, entry.sleep]);
            let numbers = numbers.chain([entry.energy(), entry.unaccounted(&self.entries[0])]);
            let numbers = numbers.chain(entry.momentum).chain(entry.angular_momentum);
            let forces = [entry.contact_force].into_iter().chain(entry.force_on_obstacles);
            let numbers = numbers.chain(forces.filter(|_| self.in_contact));
            let row: Vec<String> = numbers.map(|number| format!("{number:e}")).collect();
            line(format_args!("{}\n", row.join(",")));
        }
        text
    }

    /// Plots the forces of certified contact over time, as SVG; `None` without such contact.
    ///
    /// # Errors
    /// Returns an error if the plot cannot be drawn.
    pub fn contact_svg(&self) -> Option<Result<String, String>> {
        let of = |force: &dyn Fn(&Entry) -> f64| self.entries.iter().map(force).collect::<Vec<f64>>();
        let curves = [
            ("largest force on a vertex".to_owned(), of(&|entry| entry.contact_force)),
            ("total force on obstacles".to_owned(), of(&|entry| norm(entry.force_on_obstacles))),
        ];
        let drawn = || plot(&self.times(), &curves, "force of contact, N").map_err(|error| error.to_string());
        self.in_contact.then(drawn)
    }

    fn times(&self) -> Vec<f64> {
        self.entries.iter().map(|entry| entry.time).collect()
    }

    /// Plots the ledger over time, as SVG.
    ///
    /// # Errors
    /// Returns an error if the plot cannot be drawn.
    pub fn svg(&self) -> Result<String, String> {
        let first = &self.entries[0];
        let mut curves: Vec<(String, Vec<f64>)> = Vec::new();
        let mut add = |name: &str, value: &dyn Fn(&Entry) -> f64| {
            let values: Vec<f64> = self.entries.iter().map(value).collect();
            if values.iter().any(|value| *value != 0.0) {
                curves.push((name.to_owned(), values));
            }
        };
        add("kinetic", &|entry| entry.kinetic);
        for (place, name) in self.potentials.iter().enumerate() {
            add(name, &|entry| entry.potential[place] - first.potential[place]);
        }
        for (place, name) in self.works.iter().enumerate() {
            add(&format!("work of {name}"), &|entry| entry.work[place] - first.work[place]);
        }
        add("work of pins", &|entry| entry.pins - first.pins);
        add("work of obstacles", &|entry| entry.obstacles - first.obstacles);
        add("sleep", &|entry| entry.sleep - first.sleep);
        add("unaccounted", &|entry| entry.unaccounted(first));
        plot(&self.times(), &curves, "energy since the start, J").map_err(|error| error.to_string())
    }
}

/// Plots named curves over time.
fn plot(times: &[f64], curves: &[(String, Vec<f64>)], quantity: &str) -> Result<String, Box<dyn std::error::Error>> {
    let all = || curves.iter().flat_map(|(_, values)| values).copied();
    let (low, high) = (all().fold(0.0, f64::min), all().fold(0.0, f64::max));
    let margin = 0.05 * (high - low).max(f64::MIN_POSITIVE);
    let end = times.last().copied().unwrap_or(0.0).max(f64::MIN_POSITIVE);
    let mut text = String::new();
    {
        let area = SVGBackend::with_string(&mut text, (900, 520)).into_drawing_area();
        area.fill(&WHITE)?;
        let mut chart = ChartBuilder::on(&area)
            .margin(14)
            .x_label_area_size(42)
            .y_label_area_size(74)
            .build_cartesian_2d(times.first().copied().unwrap_or(0.0)..end, low - margin..high + margin)?;
        chart
            .configure_mesh()
            .max_light_lines(2)
            .light_line_style(BLACK.mix(0.05))
            .x_desc("time, s")
            .y_desc(quantity)
            .y_label_formatter(&|value| format!("{value:.3e}"))
            .draw()?;
        for (number, (name, values)) in curves.iter().enumerate() {
            let colour = Palette99::pick(number).to_rgba();
            let points = times.iter().copied().zip(values.iter().copied());
            chart
                .draw_series(LineSeries::new(points, colour.stroke_width(2)))?
                .label(name)
                .legend(move |(x, y)| PathElement::new(vec![(x, y), (x + 16, y)], colour.stroke_width(2)));
        }
        let mut labels = chart.configure_series_labels();
        let labels = labels.position(SeriesLabelPosition::UpperRight);
        labels.background_style(WHITE.mix(0.85)).border_style(BLACK.mix(0.3)).draw()?;
        area.present()?;
    }
    Ok(text)
}
