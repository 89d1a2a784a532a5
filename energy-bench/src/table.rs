use comfy_table::{CellAlignment, Table, presets};
use energy_dsl::LevelName;

use crate::contender::{Contender, Source};
use crate::measure::Measured;
use crate::readme::roundoffs;

/// Returns all times, ratios, errors and verdicts, one column per kernel.
#[must_use]
pub fn table(kernels: &[Measured]) -> Table {
    let mut table = Table::new();
    table.load_preset(presets::NOTHING);
    let title = |kernel: &Measured| format!("{} {}", kernel.key, kernel.title);
    table.set_header(std::iter::once("ns per element".to_owned()).chain(kernels.iter().map(title)));
    let mut rows = Rows { kernels, table: &mut table };

    let levels = || LevelName::ALL.into_iter();
    rows.time(Contender::GeneratedPlain);
    rows.time(Contender::UncompensatedPlain);
    rows.time(Contender::HandPlain);
    levels().for_each(|level| rows.time(Contender::GeneratedScalar(level)));
    levels().for_each(|level| rows.time(Contender::GeneratedLanes(level)));
    levels().for_each(|level| rows.time(Contender::UncompensatedLanes(level)));
    levels().for_each(|level| rows.time(Contender::GeneratedSingles(level)));
    levels().for_each(|level| rows.time(Contender::HandScalar(level)));
    levels().for_each(|level| rows.time(Contender::HandLanes(level)));
    levels().for_each(|level| rows.time(Contender::HandSingles(level)));
    for contender in [Contender::Dual, Contender::SymPy, Contender::CasADi] {
        rows.time(contender);
    }
    for contender in [Contender::Batches, Contender::ScatterOnly, Contender::System, Contender::Clamped] {
        rows.time(contender);
    }

    let generated = |kernel: &Measured| kernel.best(|c| matches!(c, Contender::GeneratedScalar(_)));
    let hand = |kernel: &Measured| kernel.best(|c| matches!(c, Contender::HandScalar(_)));
    rows.ratio("generated/hand, plain calls", |kernel| {
        Some(kernel.time(Contender::GeneratedPlain)? / kernel.time(Contender::HandPlain)?)
    });
    rows.ratio("uncompensated/hand, plain calls", |kernel| {
        Some(kernel.time(Contender::UncompensatedPlain)? / kernel.time(Contender::HandPlain)?)
    });
    rows.ratio("generated/hand, scalar loop", |kernel| Some(generated(kernel)? / hand(kernel)?));
    for level in levels() {
        rows.ratio(&format!("generated/hand, f64 lanes, {level}"), |kernel| {
            Some(kernel.time(Contender::GeneratedLanes(level))? / kernel.time(Contender::HandLanes(level))?)
        });
    }
    for level in levels() {
        rows.ratio(&format!("uncompensated/hand, f64 lanes, {level}"), |kernel| {
            Some(kernel.time(Contender::UncompensatedLanes(level))? / kernel.time(Contender::HandLanes(level))?)
        });
    }
    rows.ratio("plain method/in the loop", |kernel| {
        Some(
            kernel.time(Contender::GeneratedPlain)?
                / kernel.best(|c| c == Contender::GeneratedScalar(LevelName::Avx2))?,
        )
    });
    for contender in [Contender::Dual, Contender::SymPy, Contender::CasADi] {
        rows.ratio(&format!("{contender}/generated, scalar"), |kernel| {
            Some(kernel.time(contender)? / generated(kernel)?)
        });
    }
    let lanes = |kernel: &Measured| kernel.best(|c| matches!(c, Contender::GeneratedLanes(_)));
    rows.ratio("batches/generated, lanes", |kernel| Some(kernel.time(Contender::Batches)? / lanes(kernel)?));
    rows.ratio("scatter only/generated, lanes", |kernel| Some(kernel.time(Contender::ScatterOnly)? / lanes(kernel)?));
    rows.ratio("assembled/generated, lanes", |kernel| Some(kernel.time(Contender::System)? / lanes(kernel)?));
    rows.ratio("assembled/generated, scalar", |kernel| Some(kernel.time(Contender::System)? / generated(kernel)?));

    rows.row("operations", |kernel| Some(kernel.operations.to_string()));
    rows.row("instructions (fused as one)", |kernel| Some(kernel.instructions.to_string()));
    rows.row("divisions and roots", |kernel| Some(kernel.divisions_and_roots.to_string()));
    rows.row("largest relative difference", |kernel| Some(format!("{:.0e}", kernel.difference)));
    let sources =
        [Source::Generated, Source::Uncompensated, Source::HandDerived, Source::NumDual, Source::SymPy, Source::CasADi];
    for source in sources {
        rows.error_near_rest(source);
    }
    for source in sources {
        rows.coincident(source);
    }
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}

struct Rows<'a> {
    kernels: &'a [Measured],
    table: &'a mut Table,
}

impl Rows<'_> {
    /// Adds a row, unless it is empty: not every machine has every level.
    fn row(&mut self, title: &str, cell: impl Fn(&Measured) -> Option<String>) {
        let cells: Vec<Option<String>> = self.kernels.iter().map(cell).collect();
        if cells.iter().any(Option::is_some) {
            let cells = cells.into_iter().map(|cell| cell.unwrap_or_else(|| "–".to_owned()));
            self.table.add_row(std::iter::once(title.to_owned()).chain(cells));
        }
    }

    fn time(&mut self, contender: Contender) {
        self.row(&contender.to_string(), |kernel| kernel.time(contender).map(|time| format!("{time:.1}")));
    }

    fn ratio(&mut self, title: &str, ratio: impl Fn(&Measured) -> Option<f64>) {
        self.row(title, |kernel| ratio(kernel).map(|ratio| format!("× {ratio:.2}")));
    }

    fn error_near_rest(&mut self, source: Source) {
        self.row(&format!("gradient error near rest, {source}"), |kernel| {
            let error = kernel.near_rest.iter().find(|error| error.source == source)?;
            Some(roundoffs(error.roundoffs))
        });
    }

    fn coincident(&mut self, source: Source) {
        self.row(&format!("coincident points, {source}"), |kernel| {
            let outcome = kernel.coincident.iter().find(|outcome| outcome.source == source)?;
            Some(outcome.verdict.to_string())
        });
    }
}
