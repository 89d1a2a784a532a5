//! Generated elements in C, built by C compilers of this machine. They run when it is their turn.

use std::cell::RefCell;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::rc::Rc;
use std::time::Duration;

use anyhow::{Context, ensure};
use energy_compiler::{Budget, Interpreted, Precision, Target, sources};
use energy_dsl::Declaration;

use crate::contender::{CCompiler, Contender};
use crate::measure::Timed;
use crate::sample::Sample;
use crate::served::Served;

/// What runs an element, and answers commands on its standard input.
const PROGRAM: &str = include_str!("generated_c.c");

/// Builds an element with a compiler, compares its results with those of Rust bit by bit, and returns its contenders.
/// Files go to `folder`.
pub(crate) fn contenders(
    declaration: &Declaration,
    (compiler, command): (CCompiler, &str),
    (samples, expected): (&[Sample], &[Vec<f64>]),
    folder: &Path,
) -> anyhow::Result<[(Contender, Timed); 2]> {
    std::fs::create_dir_all(folder).with_context(|| format!("cannot create {}", folder.display()))?;
    let program = build(declaration, command, samples, expected[0].len(), folder)?;
    let mut process = Process::start(&program, samples, folder)?;
    let found = process.results(samples.len(), expected[0].len())?;
    for (element, (expected, found)) in expected.iter().zip(&found).enumerate() {
        let same = found.iter().zip(expected.iter().chain(expected)).all(|(a, b)| a.to_bits() == b.to_bits());
        ensure!(same, "{}, element {element}: C by `{command}` has other bits than Rust", declaration.name);
    }
    let process = Rc::new(RefCell::new(process));
    let run = |command: &'static str| -> Timed {
        let process = Rc::clone(&process);
        Box::new(move || process.borrow_mut().command(command))
    };
    Ok([(Contender::GeneratedC(compiler), run("one")), (Contender::GeneratedCBatches(compiler), run("vectors"))])
}

/// Writes the element's files and compiles them.
fn build(
    declaration: &Declaration,
    command: &str,
    samples: &[Sample],
    results: usize,
    folder: &Path,
) -> anyhow::Result<PathBuf> {
    let elements = Interpreted::from_file_with_vertices(&declaration.source, &declaration.name, &Budget::default())
        .map_err(|error| anyhow::anyhow!("{error}"))?;
    let element = &elements[elements.len() - 1];
    let mut name = String::new();
    for file in sources(std::slice::from_ref(element), Target::C, &[Precision::Double])? {
        if let Some(of_element) = file.name.strip_suffix("_f64_lanes.c") {
            name = of_element.to_owned();
        }
        energy_cli::write_file(&folder.join(&file.name), &file.text)?;
    }
    energy_cli::write_file(&folder.join("main.c"), PROGRAM)?;
    let size = |fields: &[energy_dsl::Field]| fields.iter().map(|field| field.size).sum::<usize>();
    let (parameters, unknowns) = (size(&declaration.parameters), size(&declaration.points));
    let stored = samples[0].generated.len() - parameters - unknowns;
    let values = declaration.rows.max(1);
    let is_residual = declaration.rows > 0;
    let first = if is_residual { values * unknowns } else { unknowns };
    let mut words = command.split_whitespace();
    let mut compile = Command::new(words.next().context("expected a command, got an empty one")?);
    compile.args(words).args(["-std=c99", "-O3", "-ffp-contract=off", "-o", "main"]);
    if !command.contains("-march=") {
        compile.arg("-march=native");
    }
    compile.arg(format!("-DHEADER=\"{name}_f64.h\"")).arg(format!("-DNAME={name}_f64"));
    let lengths = [
        ("PARAMETERS", parameters),
        ("STORED", stored),
        ("UNKNOWNS", unknowns),
        ("VALUES", values),
        ("FIRST", first),
        ("SECOND", results - values - first),
    ];
    compile.args(lengths.map(|(name, length)| format!("-D{name}={length}")));
    compile.args(["main.c".to_owned(), format!("{name}_f64.c"), format!("{name}_f64_lanes.c")]).arg("-lm");
    let output = compile.current_dir(folder).output().with_context(|| format!("cannot run `{command}`"))?;
    ensure!(output.status.success(), "`{command}` failed: {}", String::from_utf8_lossy(&output.stderr).trim());
    Ok(folder.join("main"))
}

/// The running program.
struct Process {
    served: Served,
    /// Where it writes results.
    outputs: PathBuf,
}

impl Process {
    fn start(program: &Path, samples: &[Sample], folder: &Path) -> anyhow::Result<Self> {
        let (inputs, outputs) = (folder.join("inputs"), folder.join("outputs"));
        let numbers: Vec<u8> =
            samples.iter().flat_map(|sample| &sample.generated).flat_map(|number| number.to_le_bytes()).collect();
        energy_cli::write_file(&inputs, &numbers)?;
        let mut command = Command::new(program);
        command.arg(samples.len().to_string()).args([&inputs, &outputs]);
        Ok(Self { served: Served::start("the program in C", &mut command)?, outputs })
    }

    /// Returns the time of a command.
    fn command(&mut self, command: &str) -> anyhow::Result<Duration> {
        let line = self.served.ask(command)?;
        let nanoseconds: f64 =
            line.trim().parse().with_context(|| format!("the program in C printed `{}`", line.trim()))?;
        Ok(Duration::from_secs_f64(nanoseconds * 1e-9))
    }

    /// Returns the results of each element, one at a time and then in vectors.
    fn results(&mut self, elements: usize, size: usize) -> anyhow::Result<Vec<Vec<f64>>> {
        self.command("write")?;
        let bytes = std::fs::read(&self.outputs).with_context(|| format!("cannot read {}", self.outputs.display()))?;
        ensure!(bytes.len() == elements * 2 * size * 8, "the program in C wrote {} bytes", bytes.len());
        let (numbers, _) = bytes.as_chunks::<8>();
        Ok(numbers.chunks(2 * size).map(|of_one| of_one.iter().copied().map(f64::from_le_bytes).collect()).collect())
    }
}
