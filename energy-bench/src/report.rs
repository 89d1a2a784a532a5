//! A whole run: all kernels compared, timed and judged.

use std::path::{Path, PathBuf};

use anyhow::Context;
use energy_cli::progress;
use energy_dsl::available;
use serde::Serialize;

use crate::agreement::{agreement, expected};
use crate::contender::CCompiler;
use crate::contenders::contenders;
use crate::for_each_kernel;
use crate::generated_c;
use crate::measure::{Measured, measure, timed};
use crate::near_rest::NearRest;
use crate::sample::Coincident;
use crate::sample::Sample;
use crate::script::{SCRIPT_TOOLS, run_script};
use crate::subject::{Subject, samples};

/// Short names of all kernels.
pub const KEYS: [&str; 5] = ["K1", "K2", "K3", "K4", "K5"];

/// Settings of a run.
#[derive(Clone, Debug)]
pub struct Options {
    /// Elements of each kernel, a multiple of 16.
    pub elements: usize,
    /// Runs of each contender, at least 1; their median is reported.
    pub repetitions: usize,
    /// Kernels to measure; all of them if empty.
    pub kernels: Vec<String>,
    /// Python interpreter for the contenders in C; they are left out if `None`.
    pub python: Option<PathBuf>,
    /// Commands of C compilers that build generated C.
    pub c_compilers: Vec<(CCompiler, String)>,
    /// Folder that keeps the inputs of scripts, and generated C with its programs; a temporary folder if `None`.
    pub inputs: Option<PathBuf>,
}

impl Options {
    fn wants<K: Subject>(&self) -> bool {
        self.kernels.is_empty() || self.kernels.iter().any(|key| key == K::KEY)
    }
}

/// Results of a run. The crate's README documents its JSON form.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Report {
    /// Elements of each kernel.
    pub elements: usize,
    /// Runs of each contender.
    pub repetitions: usize,
    /// SIMD levels of the machine, from the lowest to the best.
    pub levels: Vec<String>,
    /// Reasons why contenders are missing.
    pub notes: Vec<String>,
    /// One entry per measured kernel.
    pub kernels: Vec<Measured>,
}

/// A kernel's inputs, with the results that they should have.
struct Case {
    key: &'static str,
    samples: Vec<Sample>,
    /// The results of the generated plain method.
    expected: Vec<Vec<f64>>,
    near_rest: Option<NearRest>,
    coincident: Coincident,
}

impl Case {
    fn new<K: Subject>(elements: usize) -> Self {
        let samples = samples::<K>(elements);
        let near_rest = NearRest::new::<K>(&samples);
        let coincident = K::coincident(&samples[0]);
        let expected = expected::<K>(&samples);
        Self { key: K::KEY, samples, expected, near_rest, coincident }
    }

    /// Writes all inputs and the expected results as little-endian doubles.
    fn write(&self, folder: &Path) -> anyhow::Result<()> {
        std::fs::create_dir_all(folder).with_context(|| format!("cannot create {}", folder.display()))?;
        let write = |name: &str, numbers: Vec<f64>| {
            let bytes: Vec<u8> = numbers.into_iter().flat_map(f64::to_le_bytes).collect();
            energy_cli::write_file(&folder.join(format!("{}.{name}", self.key)), &bytes)
        };
        write("inputs", textbook(&self.samples))?;
        write("expected", self.expected.concat())?;
        if let Some(near_rest) = &self.near_rest {
            write("near_rest", textbook(near_rest.samples()))?;
        }
        write("coincident", textbook(std::slice::from_ref(&self.coincident.sample)))?;
        Ok(())
    }
}

fn textbook(samples: &[Sample]) -> Vec<f64> {
    samples.iter().flat_map(|sample| &sample.textbook).copied().collect()
}

/// Writes the inputs and expected results of the wanted kernels to `folder`, as little-endian doubles.
///
/// # Errors
/// Fails if the folder or a file cannot be written.
pub fn write_inputs(options: &Options, folder: &Path) -> anyhow::Result<()> {
    macro_rules! write {
        ($kernel:ty) => {
            if options.wants::<$kernel>() {
                Case::new::<$kernel>(options.elements).write(folder)?;
            }
        };
    }
    for_each_kernel!(write);
    Ok(())
}

/// Compares, times and judges all contenders of the wanted kernels.
///
/// # Errors
/// Fails if a contender's results differ from the generated ones, or if the Python script fails.
pub fn benchmark(options: &Options) -> anyhow::Result<Report> {
    let mut report = Report {
        elements: options.elements,
        repetitions: options.repetitions,
        levels: available().map(|level| level.to_string()).collect(),
        ..Report::default()
    };
    let mut cases = Vec::new();
    macro_rules! run {
        ($kernel:ty) => {
            if options.wants::<$kernel>() {
                let case = Case::new::<$kernel>(options.elements);
                report.kernels.push(run_kernel::<$kernel>(options, &case)?);
                cases.push(case);
            }
        };
    }
    for_each_kernel!(run);
    if options.c_compilers.is_empty() {
        report.notes.push("generated C was not measured: pass --gcc or --clang with a command of theirs".to_owned());
    }
    match &options.python {
        Some(python) => add_script(options, python, &cases, &mut report)?,
        None => report.notes.push(format!(
            "{SCRIPT_TOOLS} were not measured: pass --python with an interpreter that has the packages sympy, casadi \
             and numpy"
        )),
    }
    Ok(report)
}

fn run_kernel<K: Subject>(options: &Options, case: &Case) -> anyhow::Result<Measured> {
    let bar = progress::bar(options.repetitions as u64 + 2, "{prefix} {bar:30} {pos}/{len} {msg}");
    bar.set_prefix(format!("{} {}", K::KEY, K::TITLE));
    bar.set_message("comparing results");
    let mut measured = Measured::new::<K>(agreement::<K>(&case.samples).map_err(anyhow::Error::msg)?);
    measured.near_rest = case.near_rest.as_ref().map(NearRest::errors::<K>).unwrap_or_default();
    measured.coincident = case.coincident.verdicts::<K>();
    bar.inc(1);
    bar.set_message("timing");
    let in_rust = contenders::<K>(&case.samples).into_iter();
    let mut contenders: Vec<_> = in_rust.map(|(contender, work)| (contender, timed(work))).collect();
    let temporary = std::env::temp_dir().join(format!("energy-bench-c-{}", std::process::id()));
    for (compiler, command) in &options.c_compilers {
        let folder = options.inputs.as_ref().unwrap_or(&temporary).join(format!("{}-{compiler}", K::KEY));
        let results = (&*case.samples, &*case.expected);
        contenders.extend(generated_c::contenders(K::DECLARATION, (*compiler, command), results, &folder)?);
    }
    measured.times = measure(&mut contenders, case.samples.len(), options.repetitions, || bar.inc(1))?;
    let _ = std::fs::remove_dir_all(temporary);
    bar.finish_and_clear();
    Ok(measured)
}

/// Runs the Python script on the inputs of all cases and adds its results to the report.
fn add_script(options: &Options, python: &Path, cases: &[Case], report: &mut Report) -> anyhow::Result<()> {
    let spinner = progress::spinner("generating, compiling and timing C");
    let temporary = std::env::temp_dir().join(format!("energy-bench-{}", std::process::id()));
    let folder = options.inputs.as_deref().unwrap_or(&temporary);
    let written = cases.iter().try_for_each(|case| case.write(folder));
    let output = written.and_then(|()| run_script(python, folder, options.repetitions));
    if options.inputs.is_none() {
        let _ = std::fs::remove_dir_all(&temporary);
    }
    let output = output?;
    for result in output.results {
        let (Some(case), Some(measured)) = (
            cases.iter().find(|case| case.key == result.kernel),
            report.kernels.iter_mut().find(|measured| measured.key == result.kernel),
        ) else {
            continue;
        };
        measured.times.push(result.time);
        if let Some(near_rest) = &case.near_rest {
            measured.near_rest.push(near_rest.error(result.source, &result.near_rest));
        }
        measured.coincident.push(case.coincident.judge(result.source, &result.coincident));
    }
    report.notes.extend(output.notes);
    spinner.finish_and_clear();
    Ok(())
}
