use comfy_table::{CellAlignment, Table, presets};
use energy_dsl::LevelName;

use crate::accuracy::NearRest;
use crate::contender::Contender;
use crate::measure::Measured;

/// Times and their ratios, one kernel a column.
#[must_use]
pub fn table(kernels: &[Measured]) -> Table {
    let mut table = Table::new();
    table.load_preset(presets::NOTHING);
    let title = |kernel: &Measured| format!("{} {}", kernel.key, kernel.title);
    table.set_header(std::iter::once("ns an element".to_owned()).chain(kernels.iter().map(title)));
    let mut rows = Rows { kernels, table: &mut table };

    let levels = || LevelName::ALL.into_iter();
    rows.time(Contender::LibraryPlain);
    rows.time(Contender::UncompensatedPlain);
    rows.time(Contender::HandPlain);
    levels().for_each(|level| rows.time(Contender::LibraryScalar(level)));
    levels().for_each(|level| rows.time(Contender::LibraryLanes(level)));
    levels().for_each(|level| rows.time(Contender::UncompensatedLanes(level)));
    levels().for_each(|level| rows.time(Contender::LibrarySingles(level)));
    levels().for_each(|level| rows.time(Contender::HandScalar(level)));
    levels().for_each(|level| rows.time(Contender::HandLanes(level)));
    levels().for_each(|level| rows.time(Contender::HandSingles(level)));
    for contender in [Contender::Dual, Contender::SymPy, Contender::CasADi] {
        rows.time(contender);
    }
    for contender in [Contender::Batches, Contender::Sums, Contender::System, Contender::Clamped] {
        rows.time(contender);
    }

    let library = |kernel: &Measured| kernel.best(|c| matches!(c, Contender::LibraryScalar(_)));
    let hand = |kernel: &Measured| kernel.best(|c| matches!(c, Contender::HandScalar(_)));
    rows.ratio("library/hand, a call an element", |kernel| {
        Some(kernel.time(Contender::LibraryPlain)? / kernel.time(Contender::HandPlain)?)
    });
    rows.ratio("uncompensated/hand, a call an element", |kernel| {
        Some(kernel.time(Contender::UncompensatedPlain)? / kernel.time(Contender::HandPlain)?)
    });
    rows.ratio("library/hand, scalar loop", |kernel| Some(library(kernel)? / hand(kernel)?));
    for level in levels() {
        rows.ratio(&format!("library/hand, f64 lanes, {level}"), |kernel| {
            Some(kernel.time(Contender::LibraryLanes(level))? / kernel.time(Contender::HandLanes(level))?)
        });
    }
    for level in levels() {
        rows.ratio(&format!("uncompensated/hand, f64 lanes, {level}"), |kernel| {
            Some(kernel.time(Contender::UncompensatedLanes(level))? / kernel.time(Contender::HandLanes(level))?)
        });
    }
    rows.ratio("plain method/in the loop", |kernel| {
        Some(kernel.time(Contender::LibraryPlain)? / kernel.best(|c| c == Contender::LibraryScalar(LevelName::Avx2))?)
    });
    for of in [Contender::Dual, Contender::SymPy, Contender::CasADi] {
        rows.ratio(&format!("{of}/library, scalar"), |kernel| Some(kernel.time(of)? / library(kernel)?));
    }
    let lanes = |kernel: &Measured| kernel.best(|c| matches!(c, Contender::LibraryLanes(_)));
    rows.ratio("batches/library, lanes", |kernel| Some(kernel.time(Contender::Batches)? / lanes(kernel)?));
    rows.ratio("sums alone/library, lanes", |kernel| Some(kernel.time(Contender::Sums)? / lanes(kernel)?));
    rows.ratio("assembled/library, lanes", |kernel| Some(kernel.time(Contender::System)? / lanes(kernel)?));
    rows.ratio("assembled/library, scalar", |kernel| Some(kernel.time(Contender::System)? / library(kernel)?));

    rows.row("operations", |kernel| Some(kernel.operations.to_string()));
    rows.row("instructions (fused as one)", |kernel| Some(kernel.instructions.to_string()));
    rows.row("divisions and roots", |kernel| Some(kernel.divisions_and_roots.to_string()));
    rows.row("largest relative difference", |kernel| Some(format!("{:.0e}", kernel.difference)));
    rows.error("library", |errors| errors.library);
    rows.error("uncompensated", |errors| errors.uncompensated);
    rows.error("hand", |errors| errors.hand);
    rows.error("num-dual", |errors| errors.dual);
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
    /// A row, unless it is empty: a machine need not have every level.
    fn row(&mut self, title: &str, cell: impl Fn(&Measured) -> Option<String>) {
        let cells: Vec<Option<String>> = self.kernels.iter().map(cell).collect();
        if cells.iter().any(Option::is_some) {
            let cells = cells.into_iter().map(|cell| cell.unwrap_or_else(|| "–".to_owned()));
            self.table.add_row(std::iter::once(title.to_owned()).chain(cells));
        }
    }

    fn time(&mut self, of: Contender) {
        self.row(&of.to_string(), |kernel| kernel.time(of).map(|time| format!("{time:.1}")));
    }

    fn ratio(&mut self, title: &str, ratio: impl Fn(&Measured) -> Option<f64>) {
        self.row(title, |kernel| ratio(kernel).map(|ratio| format!("× {ratio:.2}")));
    }

    fn error(&mut self, of: &str, error: fn(&NearRest) -> f64) {
        self.row(&format!("error near rest, {of}"), |kernel| {
            let roundoffs = error(kernel.near_rest.as_ref()?);
            Some(if roundoffs < 1e3 { format!("{roundoffs:.1} u") } else { format!("{roundoffs:.0e} u") })
        });
    }
}
