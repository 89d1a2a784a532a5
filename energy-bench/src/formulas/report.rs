//! A run over the formulas: agreement, times and the table.

use std::collections::BTreeMap;
use std::fmt::{self, Display};
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context, ensure};
use comfy_table::{CellAlignment, Table, presets};
use energy_cli::progress;
use serde::{Deserialize, Serialize};

use super::script::Script;
use super::{FORMULAS, Formula};

/// A program that evaluates a formula.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Program {
    /// Generated lanes; the numbers of as many elements as there are lanes are interleaved.
    Lanes,
    /// Generated lanes; points gathered, results element by element.
    Batches,
    /// Reading as many numbers as the inputs and clearing as many as the results.
    Memory,
    /// C by SymPy, one element at a time.
    Scalar,
    /// C by SymPy, vectorised over eight interleaved elements, with fast mathematics.
    Vectors,
    /// Python by SymPy, compiled by numba with fast mathematics.
    Numba,
}

impl Program {
    const ALL: [Self; 6] = [Self::Lanes, Self::Batches, Self::Memory, Self::Scalar, Self::Vectors, Self::Numba];

    fn is_generated(self) -> bool {
        matches!(self, Self::Lanes | Self::Batches)
    }
}

impl Display for Program {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Lanes => "generated, interleaved",
            Self::Batches => "generated, by element",
            Self::Memory => "memory alone",
            Self::Scalar => "SymPy, C",
            Self::Vectors => "SymPy, C, vectors",
            Self::Numba => "SymPy, numba",
        })
    }
}

/// Settings of a run.
#[derive(Clone, Debug)]
pub struct Options {
    /// Numbers of elements, multiples of 16.
    pub elements: Vec<usize>,
    /// Runs of each program, at least 1; their median is reported.
    pub repetitions: usize,
    /// Names of formulas; all of them if empty.
    pub names: Vec<String>,
    /// Python interpreter with numpy, sympy and, for its program, numba; the programs by SymPy are left out if `None`.
    pub python: Option<PathBuf>,
    /// Folder that keeps the script's inputs; a temporary folder if `None`.
    pub inputs: Option<PathBuf>,
}

impl Options {
    /// Returns the wanted formulas.
    fn formulas(&self) -> anyhow::Result<Vec<&'static Formula>> {
        let known: Vec<&str> = FORMULAS.iter().map(Formula::name).collect();
        for name in &self.names {
            ensure!(known.contains(&name.as_str()), "expected a formula out of {}, got `{name}`", known.join(", "));
        }
        let is_wanted =
            |formula: &&Formula| self.names.is_empty() || self.names.iter().any(|name| name == formula.name());
        Ok(FORMULAS.iter().filter(is_wanted).collect())
    }

    /// The elements of inputs; more elements repeat them.
    fn drawn(&self) -> usize {
        self.elements.iter().copied().min().unwrap_or_default()
    }
}

/// One formula at one number of elements.
#[derive(Clone, Debug, Serialize)]
pub struct Measured {
    /// Name of the formula.
    pub formula: &'static str,
    /// Operations of its Hessian; a fused multiply-add counts as two.
    pub operations: usize,
    /// Instructions of its Hessian; a fused multiply-add counts as one.
    pub instructions: usize,
    /// Number of elements.
    pub elements: usize,
    /// Medians, in nanoseconds per element.
    pub nanoseconds: BTreeMap<Program, f64>,
    /// Seconds from the formula to the program by SymPy, with derivatives and compilation.
    pub seconds_to_build: BTreeMap<Program, f64>,
}

impl Measured {
    /// Returns the time of the best generated program, relative to the best one by SymPy.
    #[must_use]
    pub fn ratio(&self) -> Option<f64> {
        let best = |generated: bool| {
            let all = self.nanoseconds.iter().filter(|(program, _)| **program != Program::Memory);
            let chosen = all.filter(|(program, _)| program.is_generated() == generated);
            chosen.map(|(_, time)| *time).min_by(f64::total_cmp)
        };
        Some(best(true)? / best(false)?)
    }

    /// Returns the time of the best generated program, relative to memory alone.
    #[must_use]
    pub fn ratio_to_memory(&self) -> Option<f64> {
        let time = |program| self.nanoseconds.get(&program).copied();
        Some(time(Program::Lanes)?.min(time(Program::Batches)?) / time(Program::Memory)?)
    }
}

/// Results of a run.
#[derive(Clone, Debug, Serialize)]
pub struct Formulas {
    /// Runs of each program.
    pub repetitions: usize,
    /// Reasons why programs are missing.
    pub notes: Vec<String>,
    /// One entry per formula and number of elements.
    pub formulas: Vec<Measured>,
}

/// Writes the inputs and expected results of the wanted formulas to `folder`, as little-endian doubles.
///
/// # Errors
/// Fails if a name is unknown, or if the folder or a file cannot be written.
pub fn write_inputs(options: &Options, folder: &Path) -> anyhow::Result<()> {
    let formulas = options.formulas()?;
    std::fs::create_dir_all(folder).with_context(|| format!("cannot create {}", folder.display()))?;
    for formula in formulas {
        let inputs = formula.inputs(options.drawn());
        for (name, numbers) in [("expected", formula.expected(&inputs)), ("inputs", inputs)] {
            let bytes: Vec<u8> = numbers.into_iter().flat_map(f64::to_le_bytes).collect();
            energy_cli::write_file(&folder.join(format!("{}.{name}", formula.name())), &bytes)?;
        }
    }
    Ok(())
}

/// Times the wanted formulas, and the programs by SymPy if there is a Python interpreter. Their results are compared
/// first.
///
/// # Errors
/// Fails if a name is unknown, if the script fails, or if results differ.
pub fn formulas(options: &Options) -> anyhow::Result<Formulas> {
    let mut report = Formulas { repetitions: options.repetitions, notes: Vec::new(), formulas: Vec::new() };
    let Some(python) = &options.python else {
        report.notes.push(
            "programs by SymPy were not measured: pass --python with an interpreter that has the packages numpy and \
             sympy, and numba for its program"
                .to_owned(),
        );
        measure_all(options, None, &mut report)?;
        return Ok(report);
    };
    let temporary = std::env::temp_dir().join(format!("energy-bench-formulas-{}", std::process::id()));
    let folder = options.inputs.as_deref().unwrap_or(&temporary);
    let measured = write_inputs(options, folder).and_then(|()| {
        let (mut script, notes) = Script::start(python, folder)?;
        report.notes = notes;
        measure_all(options, Some(&mut script), &mut report)
    });
    if options.inputs.is_none() {
        let _ = std::fs::remove_dir_all(&temporary);
    }
    measured.map(|()| report)
}

fn measure_all(options: &Options, mut script: Option<&mut Script>, report: &mut Formulas) -> anyhow::Result<()> {
    for formula in options.formulas()? {
        for &elements in &options.elements {
            report.formulas.push(measure(formula, elements, options, script.as_deref_mut())?);
        }
    }
    Ok(())
}

/// Runs all programs in turns.
fn measure(
    formula: &Formula,
    elements: usize,
    options: &Options,
    mut script: Option<&mut Script>,
) -> anyhow::Result<Measured> {
    let bar = progress::bar(options.repetitions as u64, "{prefix} {bar:30} {pos}/{len} {msg}");
    bar.set_prefix(format!("{}, {elements} elements", formula.name()));
    bar.set_message("derivatives and compilation");
    let seconds_to_build = match &mut script {
        Some(script) => script.prepare(formula.name(), elements)?,
        None => BTreeMap::new(),
    };
    bar.set_message("timing");
    let mut contenders = (formula.contenders)(&formula.inputs(options.drawn()), elements);
    let mut times: BTreeMap<Program, Vec<f64>> = BTreeMap::new();
    for _ in 0..options.repetitions {
        for (program, work) in &mut contenders {
            // Caches then hold what is left of this program, not of others.
            work();
            let start = Instant::now();
            work();
            times.entry(*program).or_default().push(start.elapsed().as_secs_f64() * 1e9 / elements as f64);
        }
        if let Some(script) = &mut script {
            script.run()?.into_iter().for_each(|(program, time)| times.entry(program).or_default().push(time));
        }
        bar.inc(1);
    }
    bar.finish_and_clear();
    let median = |mut times: Vec<f64>| {
        times.sort_by(f64::total_cmp);
        times[times.len() / 2]
    };
    let count = formula.operations();
    Ok(Measured {
        formula: formula.name(),
        operations: count.total(),
        instructions: count.instructions(),
        elements,
        nanoseconds: times.into_iter().map(|(program, times)| (program, median(times))).collect(),
        seconds_to_build,
    })
}

/// Returns the table: one row per formula and number of elements.
#[must_use]
pub fn table(report: &Formulas) -> Table {
    let mut table = Table::new();
    table.load_preset(presets::ASCII_MARKDOWN);
    let is_measured = |program: &Program| report.formulas.iter().any(|one| one.nanoseconds.contains_key(program));
    let programs: Vec<Program> = Program::ALL.into_iter().filter(is_measured).collect();
    let mut titles = vec!["ns per element".to_owned(), "elements".to_owned(), "operations".to_owned()];
    titles.extend(programs.iter().map(ToString::to_string));
    titles.extend(["generated/SymPy", "generated/memory"].map(str::to_owned));
    table.set_header(titles);
    for one in &report.formulas {
        let cell = |number: Option<f64>, digits: usize| number.map_or("–".to_owned(), |n| format!("{n:.digits$}"));
        let mut cells = vec![one.formula.to_owned(), one.elements.to_string(), one.operations.to_string()];
        cells.extend(programs.iter().map(|program| cell(one.nanoseconds.get(program).copied(), 1)));
        cells.extend([cell(one.ratio(), 2), cell(one.ratio_to_memory(), 2)]);
        table.add_row(cells);
    }
    for column in table.column_iter_mut().skip(1) {
        column.set_cell_alignment(CellAlignment::Right);
    }
    table
}
