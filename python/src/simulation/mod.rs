//! Scenes of cloth: stepped by hand, with everything that a program controls, or run to an output folder.

pub mod measured;
mod own;
pub mod runs;

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use cloth_core::physics::geometry::Pose;
use cloth_core::scene::Scene;
use cloth_core::simulation::{Controls, OwnForce, SimulationError};
use energy_dsl::Vector3;
use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::exceptions::{PyKeyError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyTuple};

use crate::arrays::{array, numbers, tuple, wrong_shape};
use crate::element::Element;
use crate::errors::{failed, wrong};
use crate::exclusive::Exclusive;
use own::{OwnFunction, OwnText};

/// A scene that is stepped by hand.
#[pyclass(frozen, subclass, module = "energy_dsl")]
pub struct Simulation {
    inner: Exclusive<cloth_core::Simulation>,
    texts: Vec<(String, Arc<OwnText>)>,
    /// The first exception of an own function.
    raised: Arc<Mutex<Option<PyErr>>>,
}

/// Everything that the further motion of a simulation depends on. It can be pickled.
#[pyclass(frozen, module = "energy_dsl")]
pub struct Snapshot {
    inner: cloth_core::simulation::Snapshot,
    /// Inputs of own texts.
    inputs: Vec<(String, Py<PyDict>)>,
}

#[pymethods]
impl Snapshot {
    /// Makes a snapshot from the bytes of a pickle.
    #[new]
    fn new(state: &[u8], inputs: Vec<(String, Py<PyDict>)>) -> PyResult<Self> {
        Ok(Self { inner: serde_json::from_slice(state).map_err(wrong)?, inputs })
    }

    /// Steps done.
    #[getter]
    fn steps_done(&self) -> u64 {
        self.inner.state().totals.steps
    }

    /// Positions of all vertices, in m.
    #[getter]
    fn positions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        vectors(py, &self.inner.state().x)
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<(Bound<'py, PyAny>, Bound<'py, PyTuple>)> {
        let state = PyBytes::new(py, &serde_json::to_vec(&self.inner).map_err(wrong)?);
        let inputs: Vec<_> = self.inputs.iter().map(|(name, inputs)| (name, inputs.clone_ref(py))).collect();
        Ok((py.get_type::<Self>().into_any(), (state, inputs).into_pyobject(py)?))
    }

    fn __copy__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __deepcopy__(slf: Py<Self>, _memo: &Bound<'_, PyAny>) -> Py<Self> {
        slf
    }
}

/// The rotation and the translation of a pose.
type PoseArrays<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray1<f64>>);

/// Columns of a ledger: name and numbers.
type Columns<'py> = Vec<(String, Bound<'py, PyArray1<f64>>)>;
/// Vertices (-1 for obstacles), distances, normals and forces of pairs in contact.
type Contacts<'py> = (
    Bound<'py, PyArray2<i64>>,
    Bound<'py, PyArray1<i64>>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray2<f64>>,
    Bound<'py, PyArray1<f64>>,
);

#[pymethods]
impl Simulation {
    /// Reads the text of a scene. Relative paths in it start at the folder of `path`. `texts` and `functions` are own
    /// forces: name, element, stencils, inputs; and name, function, stencils, whether it is an energy, whether it has
    /// Jacobians.
    #[new]
    #[pyo3(signature = (
        text, path = PathBuf::from("scene.toml"), threads = None, obstacles = Vec::new(), wind = false,
        texts = Vec::new(), functions = Vec::new()
    ))]
    #[expect(clippy::too_many_arguments, clippy::type_complexity, reason = "the class of Python names them")]
    fn new(
        py: Python<'_>,
        text: &str,
        path: PathBuf,
        threads: Option<usize>,
        obstacles: Vec<String>,
        wind: bool,
        texts: Vec<(String, Py<Element>, Bound<'_, PyAny>, Bound<'_, PyDict>)>,
        functions: Vec<(String, Py<PyAny>, Bound<'_, PyAny>, bool, bool)>,
    ) -> PyResult<Self> {
        let scene = parsed(text, &path)?;
        let is_closed = obstacles.is_empty() && !wind && texts.is_empty() && functions.is_empty();
        let simulation = if is_closed {
            py.detach(|| cloth_core::Simulation::new(&scene)).map_err(wrong)?
        } else {
            // Stencils are checked by the number of vertices, which a first assembly tells.
            let vertices = if texts.is_empty() && functions.is_empty() {
                0
            } else {
                py.detach(|| cloth_core::model::Model::new(&scene)).map_err(wrong)?.x.len()
            };
            let mut controls = Controls { obstacles, wind, forces: Vec::new() };
            let raised = Arc::<Mutex<Option<PyErr>>>::default();
            let mut own: Vec<(String, Arc<OwnText>)> = Vec::new();
            for (name, element, stencils, inputs) in &texts {
                let text = Arc::new(OwnText::new(name, element.get(), stencils, inputs, vertices)?);
                controls.forces.push(Arc::clone(&text) as Arc<dyn OwnForce>);
                own.push((name.clone(), text));
            }
            for (name, function, stencils, is_energy, has_jacobians) in functions {
                let kind = [is_energy, has_jacobians];
                let function = OwnFunction::new(&name, function, &stencils, kind, vertices, Arc::clone(&raised))?;
                controls.forces.push(Arc::new(function));
            }
            let made = py.detach(|| cloth_core::Simulation::controlled(&scene, &controls));
            let made = made.map_err(|error| taken(&raised).unwrap_or_else(|| wrong(error)))?;
            let inner = Exclusive::new("Simulation", limited(made, threads));
            return Ok(Self { inner, texts: own, raised });
        };
        let inner = Exclusive::new("Simulation", limited(simulation, threads));
        Ok(Self { inner, texts: Vec::new(), raised: Arc::default() })
    }

    /// Takes steps of the scene's time grid, at most until its end. Returns the number taken. Ctrl-C stops after the
    /// current step.
    #[pyo3(signature = (steps = 1))]
    fn step(&self, py: Python<'_>, steps: u64) -> PyResult<u64> {
        let mut guard = self.inner.get()?;
        let simulation = &mut *guard;
        for done in 0..steps {
            if simulation.is_finished() {
                return Ok(done);
            }
            py.check_signals()?;
            let stepped = py.detach(|| simulation.step().map(drop));
            match (taken(&self.raised), stepped) {
                (Some(error), _) => return Err(error),
                (None, stepped) => stepped.map_err(failed)?,
            }
        }
        Ok(steps)
    }

    /// Time, in s.
    #[getter]
    fn time(&self) -> PyResult<f64> {
        Ok(self.inner.get()?.time())
    }

    #[getter]
    fn is_finished(&self) -> PyResult<bool> {
        Ok(self.inner.get()?.is_finished())
    }

    /// Steps from start to end.
    #[getter]
    fn steps(&self) -> PyResult<u64> {
        Ok(self.inner.get()?.steps())
    }

    /// Steps taken so far.
    #[getter]
    fn steps_done(&self) -> PyResult<u64> {
        Ok(self.inner.get()?.steps_done())
    }

    #[getter]
    fn warnings(&self) -> PyResult<Vec<String>> {
        Ok(self.inner.get()?.warnings().to_vec())
    }

    /// Positions of all vertices, in m, as a new array of shape (vertices, 3). Assign others between steps.
    #[getter]
    fn positions<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        vectors(py, self.inner.get()?.positions())
    }

    #[setter]
    fn set_positions(&self, py: Python<'_>, positions: &Bound<'_, PyAny>) -> PyResult<()> {
        let mut simulation = self.inner.get()?;
        let x = rows("positions", positions, simulation.positions().len())?;
        let simulation = &mut *simulation;
        py.detach(|| simulation.set_positions(&x)).map_err(|error| self.refusal(error))
    }

    /// Velocities of all vertices, in m/s. Assign others between steps; those of pinned vertices are ignored.
    #[getter]
    fn velocities<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        vectors(py, self.inner.get()?.velocities())
    }

    #[setter]
    fn set_velocities(&self, py: Python<'_>, velocities: &Bound<'_, PyAny>) -> PyResult<()> {
        let mut simulation = self.inner.get()?;
        let v = rows("velocities", velocities, simulation.positions().len())?;
        let simulation = &mut *simulation;
        py.detach(|| simulation.set_velocities(&v)).map_err(|error| self.refusal(error))
    }

    /// Masses of all vertices, in kg, of shape (vertices,).
    #[getter]
    fn masses<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        Ok(PyArray1::from_slice(py, self.inner.get()?.masses()))
    }

    /// Triangles, as indices of vertices.
    #[getter]
    fn triangles<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<i64>>> {
        let simulation = self.inner.get()?;
        let numbers: Vec<i64> = simulation.triangles().iter().flatten().map(|&vertex| vertex as i64).collect();
        let rows = numbers.len() / 3;
        PyArray1::from_vec(py, numbers).reshape([rows, 3])
    }

    /// The pinned vertices.
    #[getter]
    fn pinned<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray1<i64>>> {
        let simulation = self.inner.get()?;
        let pinned = (0..simulation.positions().len()).filter(|&vertex| simulation.is_pinned(vertex));
        Ok(PyArray1::from_vec(py, pinned.map(|vertex| vertex as i64).collect()))
    }

    /// Sets where pinned vertices are at the end of the next step, in m, and from then on: `vertices` of shape (n,),
    /// `targets` of shape (n, 3). `None` for the targets of all vertices lets pins follow the scene again.
    #[pyo3(signature = (vertices = None, targets = None))]
    fn move_pins(&self, vertices: Option<Vec<usize>>, targets: Option<&Bound<'_, PyAny>>) -> PyResult<()> {
        let mut simulation = self.inner.get()?;
        match (vertices, targets) {
            (None, None) => simulation.release_pin_targets(),
            (Some(vertices), Some(targets)) => {
                let targets = rows("targets", targets, vertices.len())?;
                simulation.set_pin_targets(&vertices, &targets).map_err(refused)?;
            }
            _ => return Err(PyValueError::new_err("vertices and targets: expected both, or none")),
        }
        Ok(())
    }

    /// The velocity of the wind without gusts, in m/s, of shape (3,); `None` unless `wind=True` was passed.
    #[getter]
    fn wind(&self) -> PyResult<Option<[f64; 3]>> {
        Ok(self.inner.get()?.wind())
    }

    #[setter]
    fn set_wind(&self, velocity: [f64; 3]) -> PyResult<()> {
        self.inner.get()?.set_wind(velocity).map_err(refused)
    }

    /// Moves an obstacle during the next step: the point p of the scene's shape is then at R p + t. There it stays.
    #[pyo3(signature = (obstacle, translation = [0.0; 3], rotation = None))]
    fn move_obstacle(
        &self,
        obstacle: &str,
        translation: [f64; 3],
        rotation: Option<&Bound<'_, PyAny>>,
    ) -> PyResult<()> {
        let rotation = match rotation {
            None => Pose::IDENTITY.rows(),
            Some(rotation) => {
                let rotation = rows("rotation", rotation, 3)?;
                [rotation[0], rotation[1], rotation[2]]
            }
        };
        let message = || "rotation: expected a rotation, Rᵀ R = 1 to 1e-9 without a reflection, and finite numbers";
        let pose = Pose::new(rotation, translation).ok_or_else(|| PyValueError::new_err(message()))?;
        self.inner.get()?.steer(obstacle, pose).map_err(refused)
    }

    /// Returns R, of shape (3, 3), and t of an obstacle at the end of the next step, if nothing else is set.
    fn obstacle_pose<'py>(&self, py: Python<'py>, obstacle: &str) -> PyResult<PoseArrays<'py>> {
        let pose = self.inner.get()?.pose(obstacle).map_err(refused)?;
        Ok((vectors(py, &pose.rows())?, PyArray1::from_slice(py, &pose.translation())))
    }

    /// Gives an own text other inputs from the next step on; those that are not named stay.
    #[pyo3(signature = (name, **inputs))]
    fn set(&self, py: Python<'_>, name: &str, inputs: Option<&Bound<'_, PyDict>>) -> PyResult<()> {
        // No step is under way while the parameters change.
        let _simulation = self.inner.get()?;
        let text = self.text(name)?;
        inputs.map_or(Ok(()), |inputs| text.set(py, inputs))
    }

    /// Returns copies of the inputs of an own text.
    fn inputs_of<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyDict>> {
        self.text(name)?.inputs.lock().unwrap_or_else(PoisonError::into_inner).bind(py).copy()
    }

    /// Returns the forces of each term on all vertices at the current state, in N: names, and arrays (vertices, 3).
    fn term_forces<'py>(&self, py: Python<'py>) -> PyResult<Vec<(String, Bound<'py, PyArray2<f64>>)>> {
        let mut guard = self.inner.get()?;
        let simulation = &mut *guard;
        let forces = py.detach(|| simulation.term_forces());
        let forces = match taken(&self.raised) {
            Some(error) => return Err(error),
            None => forces.map_err(failed)?,
        };
        forces.into_iter().map(|(name, forces)| Ok((name, vectors(py, &forces)?))).collect()
    }

    /// Forces of certified contact on all vertices at the end of the last step, in N, of shape (vertices, 3).
    #[getter]
    fn contact_forces<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        vectors(py, &self.inner.get()?.contact_forces())
    }

    /// Pairs in certified contact at the end of the last step: vertices, sizes of the first features, distances,
    /// normals, forces.
    fn contact_pairs<'py>(&self, py: Python<'py>) -> PyResult<Contacts<'py>> {
        let pairs = self.inner.get()?.contacts();
        let number = |vertex: &Option<usize>| vertex.map_or(-1, |vertex| vertex as i64);
        let vertices: Vec<i64> = pairs.iter().flat_map(|(vertices, _)| vertices.iter().map(number)).collect();
        let normals: Vec<Vector3<f64>> = pairs.iter().map(|(_, pair)| pair.normal).collect();
        let numbers = |of: fn(&energy_solve::Touching) -> f64| {
            PyArray1::from_vec(py, pairs.iter().map(|(_, pair)| of(pair)).collect())
        };
        Ok((
            PyArray1::from_vec(py, vertices).reshape([pairs.len(), 4])?,
            PyArray1::from_vec(py, pairs.iter().map(|(_, pair)| pair.first as i64).collect()),
            numbers(|pair| pair.distance),
            vectors(py, &normals)?,
            numbers(|pair| pair.force),
        ))
    }

    /// Starts a ledger; every later step adds a row.
    fn keep_ledger(&self) -> PyResult<()> {
        self.inner.get()?.keep_ledger().map_err(failed)
    }

    /// Returns the columns of the ledger, in J, by name; the first is the time in s. None if no ledger is kept.
    fn ledger_columns<'py>(&self, py: Python<'py>) -> PyResult<Option<Columns<'py>>> {
        let simulation = self.inner.get()?;
        let Some(ledger) = simulation.ledger() else { return Ok(None) };
        let entries = ledger.entries();
        let column =
            |of: &dyn Fn(&cloth_core::ledger::Entry) -> f64| PyArray1::from_vec(py, entries.iter().map(of).collect());
        let mut columns = vec![
            ("time".to_owned(), column(&|entry| entry.time)),
            ("kinetic".to_owned(), column(&|entry| entry.kinetic)),
        ];
        for (number, name) in ledger.potentials().iter().enumerate() {
            columns.push((name.clone(), column(&|entry| entry.potential[number])));
        }
        for (number, name) in ledger.works().iter().enumerate() {
            columns.push((format!("work of {name}"), column(&|entry| entry.work[number])));
        }
        columns.push(("work of pins".to_owned(), column(&|entry| entry.pins)));
        columns.push(("work of obstacles".to_owned(), column(&|entry| entry.obstacles)));
        columns.push(("removed by sleep".to_owned(), column(&|entry| entry.sleep)));
        Ok(Some(columns))
    }

    /// Goes on with other parameters of the scene, given as its whole text.
    fn change_scene(&self, py: Python<'_>, text: &str, path: PathBuf) -> PyResult<()> {
        let mut guard = self.inner.get()?;
        let scene = parsed(text, &path)?;
        let simulation = &mut *guard;
        py.detach(|| simulation.change_scene(&scene)).map_err(|error| self.refusal(error))
    }

    /// Returns everything that the further motion depends on, parameters of own texts included.
    fn snapshot(&self, py: Python<'_>) -> PyResult<Snapshot> {
        let inner = self.inner.get()?.snapshot();
        let inputs = self.texts.iter().map(|(name, _)| Ok((name.clone(), self.inputs_of(py, name)?.unbind())));
        Ok(Snapshot { inner, inputs: inputs.collect::<PyResult<_>>()? })
    }

    /// Goes on from a snapshot of a simulation of the same scene with the same controls, with the same bits.
    fn restore(&self, py: Python<'_>, snapshot: &Snapshot) -> PyResult<()> {
        let mut guard = self.inner.get()?;
        for (name, inputs) in &snapshot.inputs {
            self.text(name)?.set(py, inputs.bind(py))?;
        }
        let simulation = &mut *guard;
        py.detach(|| simulation.return_to(&snapshot.inner)).map_err(|error| self.refusal(error.into()))
    }
}

impl Simulation {
    fn text(&self, name: &str) -> PyResult<&OwnText> {
        let found = self.texts.iter().find(|(known, _)| known == name);
        let known = || self.texts.iter().map(|(name, _)| name.as_str()).collect::<Vec<_>>().join(", ");
        let message = || format!("no own text {name:?}; there are: {}", known());
        found.map(|(_, text)| &**text).ok_or_else(|| PyKeyError::new_err(message()))
    }

    /// Returns the exception for a state that is refused: that of an own function, if one was raised.
    fn refusal(&self, error: SimulationError) -> PyErr {
        taken(&self.raised).unwrap_or_else(|| PyValueError::new_err(crate::errors::with_causes(&error)))
    }
}

/// Reads the text of a scene. A message quotes the line that it names.
fn parsed(text: &str, path: &Path) -> PyResult<Scene> {
    let text = runs::toml_text(text)?;
    Scene::parse(&text, path).map_err(|error| wrong(runs::with_line(&text, &error.to_string())))
}

fn limited(simulation: cloth_core::Simulation, threads: Option<usize>) -> cloth_core::Simulation {
    match threads {
        Some(threads) => simulation.with_threads(threads),
        None => simulation,
    }
}

fn taken(raised: &Mutex<Option<PyErr>>) -> Option<PyErr> {
    raised.lock().unwrap_or_else(PoisonError::into_inner).take()
}

fn refused(error: cloth_core::simulation::ControlError) -> PyErr {
    PyValueError::new_err(error.to_string())
}

/// Returns an array of shape (count, 3).
fn rows(name: &str, value: &Bound<'_, PyAny>, count: usize) -> PyResult<Vec<Vector3<f64>>> {
    let array: PyReadonlyArrayDyn<'_, f64> = array(name, value)?;
    if array.shape() != [count, 3] {
        return Err(wrong_shape(name, &tuple(&[count, 3]), array.shape()));
    }
    Ok(numbers(name, &array)?.as_chunks::<3>().0.to_vec())
}

fn vectors<'py>(py: Python<'py>, vectors: &[Vector3<f64>]) -> PyResult<Bound<'py, PyArray2<f64>>> {
    PyArray1::from_vec(py, vectors.as_flattened().to_vec()).reshape([vectors.len(), 3])
}
