//! Surveys as tables.

use std::fmt;

use comfy_table::{CellAlignment, Table, presets};

use super::{GarmentSurvey, Pull, Survey};
use crate::measure::{Distribution, PinReading};

/// The largest number of rows of extension against force. Others are in JSON.
const ROWS: usize = 25;
/// The largest number of pins in the table of loads.
const PINS: usize = 40;

impl fmt::Display for Survey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(time) = self.time {
            writeln!(f, "t = {time:.4} s\n")?;
        }
        write!(f, "{}", drapes(&self.garments))?;
        if self.garments.iter().any(|garment| garment.strain.is_some()) {
            write!(f, "\n\n{}", strains(&self.garments))?;
        }
        if let Some(table) = self.loads() {
            write!(f, "\n\n{table}")?;
        }
        if let Some(pull) = &self.pull {
            write!(f, "\n\n{}", pull_table(pull))?;
        }
        Ok(())
    }
}

impl Survey {
    /// Returns the loads on pins and groups at the last reading; `None` without readings or loads.
    fn loads(&self) -> Option<Table> {
        let all = &self.measurements;
        let loads = all.loads(all.readings.last()?);
        let mut table = titled(&["on pins", "Fx N", "Fy N", "Fz N", "|F| N", "x m", "y m", "z m"]);
        let (pins, groups) = loads.split_at(all.pins.len().min(loads.len()));
        for (label, PinReading { force, position, .. }) in pins.iter().take(PINS).chain(groups) {
            let size = crate::geometry::norm(*force);
            let numbers = [force.as_slice(), &[size], position].concat();
            table.add_row(std::iter::once(label.clone()).chain(numbers.iter().map(|number| format!("{number:.5}"))));
        }
        if pins.len() > PINS {
            table.add_row([format!("… and {} other pins", pins.len() - PINS)]);
        }
        (!loads.is_empty()).then_some(table)
    }
}

fn drapes(garments: &[GarmentSurvey]) -> Table {
    let mut table = titled(&["drape", "%", "nodes", "area cm²", "disc mm", "specimen mm", "radii mm", "prominence mm"]);
    for GarmentSurvey { name, drape, .. } in garments {
        let millimetres = |length: f64| format!("{:.1}", 1e3 * length);
        table.add_row([
            name.clone(),
            format!("{:.2}", drape.coefficient),
            drape.nodes.to_string(),
            format!("{:.2}", 1e4 * drape.area),
            millimetres(drape.disc),
            millimetres(drape.specimen),
            drape.radii.map(millimetres).join(" / "),
            format!("{:.2}", 1e3 * drape.prominence),
        ]);
    }
    table
}

fn strains(garments: &[GarmentSurvey]) -> Table {
    let mut table = titled(&["strain", "", "mean", "largest", "5 %", "95 %"]);
    for GarmentSurvey { name, strain, .. } in garments {
        let Some(strain) = strain else {
            table.add_row([name.as_str(), "no warp direction"]);
            continue;
        };
        for (quantity, of, scale) in
            [("warp %", strain.warp, 100.0), ("weft %", strain.weft, 100.0), ("shear °", strain.shear, 1.0)]
        {
            let Distribution { mean, largest, low, high } = of;
            let numbers = [mean, largest, low, high].map(|number| format!("{:.4}", scale * number));
            table.add_row([name.clone(), quantity.to_owned()].into_iter().chain(numbers));
        }
    }
    table
}

fn pull_table(Pull { between: [one, other], gauge_length, points }: &Pull) -> String {
    let mut table = titled(&["time s", "extension mm", "strain %", "force N"]);
    let stride = points.len().div_ceil(ROWS).max(1);
    let last = points.len().saturating_sub(1);
    let kept = points.iter().enumerate().filter(|(at, _)| at.is_multiple_of(stride) || *at == last);
    for (_, point) in kept {
        let numbers = [point.time, 1e3 * point.extension, 100.0 * point.strain, point.force];
        table.add_row(numbers.map(|number| format!("{number:.4}")));
    }
    format!("between {one} and {other}, {:.2} mm apart at the start\n{table}", 1e3 * gauge_length)
}

fn titled(titles: &[&str]) -> Table {
    let mut table = Table::new();
    table.load_preset(presets::NOTHING);
    table.set_header(titles);
    table.column_iter_mut().skip(1).for_each(|column| column.set_cell_alignment(CellAlignment::Right));
    table
}
