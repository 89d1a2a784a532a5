use comfy_table::{CellAlignment, Table, presets};
use energy_dsl::LevelName;

use crate::contender::{CCompiler, Contender, Source};
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
    times(&mut rows);
    ratios_to_hand_derived(&mut rows);
    ratios_to_generated(&mut rows);
    counts_and_accuracy(&mut rows);
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}

fn levels() -> impl Iterator<Item = LevelName> {
    LevelName::ALL.into_iter()
}

/// The best time of generated code in a scalar loop.
fn generated_scalar(kernel: &Measured) -> Option<f64> {
    kernel.best(|contender| matches!(contender, Contender::GeneratedScalar(_)))
}

fn times(rows: &mut Rows<'_>) {
    rows.time(Contender::GeneratedPlain);
    rows.time(Contender::UncompensatedPlain);
    rows.time(Contender::HandPlain);
    let over_levels: [fn(LevelName) -> Contender; 7] = [
        Contender::GeneratedScalar,
        Contender::GeneratedLanes,
        Contender::UncompensatedLanes,
        Contender::GeneratedSingles,
        Contender::HandScalar,
        Contender::HandLanes,
        Contender::HandSingles,
    ];
    for contender in over_levels {
        levels().for_each(|level| rows.time(contender(level)));
    }
    for contender in [Contender::Dual, Contender::SymPy, Contender::CasADi] {
        rows.time(contender);
    }
    for contender in [Contender::GeneratedC, Contender::GeneratedCBatches] {
        CCompiler::ALL.into_iter().for_each(|compiler| rows.time(contender(compiler)));
    }
    for contender in [Contender::Batches, Contender::ScatterOnly, Contender::System, Contender::Clamped] {
        rows.time(contender);
    }
}

fn ratios_to_hand_derived(rows: &mut Rows<'_>) {
    let hand = |kernel: &Measured| kernel.best(|contender| matches!(contender, Contender::HandScalar(_)));
    rows.ratio("generated/hand-derived, plain calls", |kernel| {
        Some(kernel.time(Contender::GeneratedPlain)? / kernel.time(Contender::HandPlain)?)
    });
    rows.ratio("uncompensated/hand-derived, plain calls", |kernel| {
        Some(kernel.time(Contender::UncompensatedPlain)? / kernel.time(Contender::HandPlain)?)
    });
    rows.ratio("generated/hand-derived, scalar loop", |kernel| Some(generated_scalar(kernel)? / hand(kernel)?));
    for level in levels() {
        rows.ratio(&format!("generated/hand-derived, f64 lanes, {level}"), |kernel| {
            Some(kernel.time(Contender::GeneratedLanes(level))? / kernel.time(Contender::HandLanes(level))?)
        });
    }
    for level in levels() {
        rows.ratio(&format!("uncompensated/hand-derived, f64 lanes, {level}"), |kernel| {
            Some(kernel.time(Contender::UncompensatedLanes(level))? / kernel.time(Contender::HandLanes(level))?)
        });
    }
}

fn ratios_to_generated(rows: &mut Rows<'_>) {
    rows.ratio("generated, plain method/scalar loop", |kernel| {
        let scalar_loop = kernel.time(Contender::GeneratedScalar(LevelName::Avx2))?;
        Some(kernel.time(Contender::GeneratedPlain)? / scalar_loop)
    });
    for contender in [Contender::Dual, Contender::SymPy, Contender::CasADi] {
        rows.ratio(&format!("{contender}/generated, scalar"), |kernel| {
            Some(kernel.time(contender)? / generated_scalar(kernel)?)
        });
    }
    for compiler in CCompiler::ALL {
        rows.ratio(&format!("C/generated, scalar, {compiler}"), |kernel| {
            Some(kernel.time(Contender::GeneratedC(compiler))? / generated_scalar(kernel)?)
        });
        rows.ratio(&format!("C in vectors/batches, {compiler}"), |kernel| {
            Some(kernel.time(Contender::GeneratedCBatches(compiler))? / kernel.time(Contender::Batches)?)
        });
    }
    let lanes = |kernel: &Measured| kernel.best(|contender| matches!(contender, Contender::GeneratedLanes(_)));
    rows.ratio("batches/generated, lanes", |kernel| Some(kernel.time(Contender::Batches)? / lanes(kernel)?));
    rows.ratio("scatter only/generated, lanes", |kernel| Some(kernel.time(Contender::ScatterOnly)? / lanes(kernel)?));
    rows.ratio("assembled/generated, lanes", |kernel| Some(kernel.time(Contender::System)? / lanes(kernel)?));
    rows.ratio("assembled/generated, scalar", |kernel| {
        Some(kernel.time(Contender::System)? / generated_scalar(kernel)?)
    });
}

fn counts_and_accuracy(rows: &mut Rows<'_>) {
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
