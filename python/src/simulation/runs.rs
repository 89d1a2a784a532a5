//! Scenes of cloth, run to an output folder.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

use cloth_core::output::OutputError;
use cloth_core::run::{Checkpoint, Ending, Event, Run, RunError, RunOptions};
use cloth_core::scene::Scene;
use pyo3::exceptions::{PyKeyboardInterrupt, PyRuntimeError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};

use crate::errors::{FolderInUseError, ResourceError, with_causes, wrong};

/// A scene's text; JSON objects are written as TOML.
pub(super) fn toml_text(text: &str) -> PyResult<String> {
    if !text.trim_start().starts_with('{') {
        return Ok(text.to_owned());
    }
    let value: serde_json::Value = serde_json::from_str(text).map_err(wrong)?;
    toml::to_string(&value).map_err(wrong)
}

/// Adds the line that a message about a text names: of a dictionary, users never see the text.
pub(super) fn with_line(text: &str, message: &str) -> String {
    let number = message.split(':').nth(1).and_then(|number| number.parse::<usize>().ok());
    match number.and_then(|number| text.lines().nth(number.checked_sub(1)?)) {
        Some(line) => format!("{message}: {}", line.trim()),
        None => message.to_owned(),
    }
}

/// Runs a scene and writes its results to a folder, as `cloth run` does. Returns the number of steps taken.
/// `progress(done, steps)` is called after each step.
#[pyfunction]
#[pyo3(signature = (
    text, path, output, *, overwrite = false, checkpoint = None, ignore_memory = false, threads = None, progress = None
))]
#[expect(clippy::too_many_arguments, reason = "all but three are keywords")]
pub fn run(
    py: Python<'_>,
    text: &str,
    path: &str,
    output: &str,
    overwrite: bool,
    checkpoint: Option<u64>,
    ignore_memory: bool,
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<u64> {
    let mut options = RunOptions::default();
    (options.overwrite, options.checkpoint_interval, options.ignore_memory) = (overwrite, checkpoint, ignore_memory);
    let text = toml_text(text)?;
    to_the_end(py, threads, progress, || {
        Run::new(text.clone(), Path::new(path), Path::new(output), options).map_err(|error| {
            let Refusal { message, kind } = error.into();
            Refusal { message: with_line(&text, &message), kind }
        })
    })
}

/// Resumes an interrupted run from the checkpoint in its folder, as `cloth resume` does.
#[pyfunction]
#[pyo3(signature = (output, *, accept_edited = false, threads = None, progress = None))]
pub fn resume(
    py: Python<'_>,
    output: &str,
    accept_edited: bool,
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
) -> PyResult<u64> {
    to_the_end(py, threads, progress, || Ok(Run::resume(Path::new(output), accept_edited)?))
}

/// Why a run cannot start.
struct Refusal {
    message: String,
    kind: RefusalKind,
}

#[derive(Clone, Copy, PartialEq)]
enum RefusalKind {
    /// The scene or the folder is wrong.
    Wrong,
    /// Another process writes to the folder.
    FolderInUse,
    /// A file cannot be written, or memory is short.
    Resources,
}

impl From<RunError> for Refusal {
    fn from(error: RunError) -> Self {
        let kind = match &error {
            RunError::Output(OutputError::InUse { .. }) => RefusalKind::FolderInUse,
            RunError::Output(OutputError::File { .. } | OutputError::Folder { .. }) | RunError::Memory { .. } => {
                RefusalKind::Resources
            }
            _ => RefusalKind::Wrong,
        };
        Self { message: with_causes(&error), kind }
    }
}

/// How a run ended, without the interpreter's lock.
enum Outcome {
    Refused(Refusal),
    /// A step failed.
    Failed(String),
    /// A file cannot be written.
    Unwritten(String),
    Done(u64),
}

/// Simulates to the end without the interpreter's lock. Ctrl-C, or an exception of `progress`, completes the current
/// step and keeps the results.
fn to_the_end(
    py: Python<'_>,
    threads: Option<usize>,
    progress: Option<Py<PyAny>>,
    start: impl FnOnce() -> Result<Run, Refusal> + Send,
) -> PyResult<u64> {
    let mut raised = None;
    let outcome = py.detach(|| {
        let mut run = match (start(), threads) {
            (Ok(run), Some(threads)) => run.with_threads(threads),
            (Ok(run), None) => run,
            (Err(refusal), _) => return Outcome::Refused(refusal),
        };
        let stop = AtomicBool::new(false);
        let ending = run.go(&stop, |event| {
            let Event::Step(simulation, _) = event else { return };
            let (done, steps) = (simulation.steps_done(), simulation.steps());
            let listen = |py: Python<'_>| {
                py.check_signals()?;
                progress.as_ref().map_or(Ok(()), |progress| progress.call1(py, (done, steps)).map(drop))
            };
            if let Err(error) = Python::attach(listen) {
                raised = Some(error);
                stop.store(true, Ordering::Relaxed);
            }
        });
        match ending {
            Err(error) => Outcome::Unwritten(with_causes(&error)),
            Ok(Ending { failure: Some(failure), .. }) => Outcome::Failed(failure.to_string()),
            Ok(_) => Outcome::Done(run.simulation().steps_done()),
        }
    });
    match (raised, outcome) {
        (Some(error), _) if error.is_instance_of::<PyKeyboardInterrupt>(py) => {
            Err(PyKeyboardInterrupt::new_err("the run was interrupted; its results so far were written"))
        }
        (Some(error), _) => Err(error),
        (None, Outcome::Refused(Refusal { message, kind })) => Err(match kind {
            RefusalKind::Wrong => wrong(message),
            RefusalKind::FolderInUse => FolderInUseError::new_err(message),
            RefusalKind::Resources => ResourceError::new_err(message),
        }),
        (None, Outcome::Unwritten(message)) => Err(ResourceError::new_err(message)),
        (None, Outcome::Failed(message)) => Err(PyRuntimeError::new_err(message)),
        (None, Outcome::Done(steps)) => Ok(steps),
    }
}

/// Returns the paths of the meshes and materials that a scene names; none if the scene is invalid.
#[pyfunction]
pub fn input_files(text: &str, path: PathBuf) -> PyResult<Vec<PathBuf>> {
    let text = toml_text(text)?;
    Ok(Scene::parse(&text, &path).map_or_else(|_| Vec::new(), |scene| scene.input_files()))
}

/// Returns the tables of a scene file.
#[pyfunction]
pub fn read_scene(py: Python<'_>, path: PathBuf) -> PyResult<Bound<'_, PyAny>> {
    let text = Scene::text(&path).map_err(|error| wrong(with_causes(&error)))?;
    scene_tables(py, &text, path)
}

/// Returns the tables of a scene's text.
#[pyfunction]
pub fn scene_tables<'py>(py: Python<'py>, text: &str, path: PathBuf) -> PyResult<Bound<'py, PyAny>> {
    let text = toml_text(text)?;
    let table = text.parse::<toml::Table>().map_err(|error| wrong(format!("{}: {error}", path.display())))?;
    object(py, &toml::Value::Table(table))
}

/// Returns a value of TOML as an object of Python. Dates, which no scene has, are texts.
fn object<'py>(py: Python<'py>, value: &toml::Value) -> PyResult<Bound<'py, PyAny>> {
    Ok(match value {
        toml::Value::String(text) => text.into_pyobject(py)?.into_any(),
        toml::Value::Integer(number) => number.into_pyobject(py)?.into_any(),
        toml::Value::Float(number) => number.into_pyobject(py)?.into_any(),
        toml::Value::Boolean(truth) => truth.into_pyobject(py)?.to_owned().into_any(),
        toml::Value::Datetime(date) => date.to_string().into_pyobject(py)?.into_any(),
        toml::Value::Array(list) => {
            let list = list.iter().map(|value| object(py, value)).collect::<PyResult<Vec<_>>>()?;
            PyList::new(py, list)?.into_any()
        }
        toml::Value::Table(table) => {
            let dict = PyDict::new(py);
            for (key, value) in table {
                dict.set_item(key, object(py, value)?)?;
            }
            dict.into_any()
        }
    })
}

/// Version of the package and of the checkpoints that it reads and writes.
#[pyfunction]
pub fn version() -> String {
    format!("{}, checkpoints {}", env!("CARGO_PKG_VERSION"), Checkpoint::VERSION)
}
