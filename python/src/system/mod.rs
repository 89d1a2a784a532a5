//! Sums of elements over the vertices of a mesh.

mod assembly;
pub mod laws;
mod minimise;

use std::sync::{Mutex, MutexGuard, PoisonError};

use energy_dsl::{Flagged, Kind, Vector3};
use energy_solve::{Bsr, Curvature, State, Storage};
use numpy::{PyArray1, PyArray2, PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::exceptions::{PyIndexError, PyTypeError, PyValueError};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{array, numbers, tuple, wrong_shape};
use crate::element::{Element, copied};
use crate::errors::wrong;
use crate::exclusive::Exclusive;
use crate::stencils::stencils_of;
use assembly::{Assembly, TermSource, Wanted};
use minimise::{Goal, minimise};

/// A sum of energies, forces and residuals over vertices. Some may be pinned: they have no rows in the matrix.
#[pyclass(frozen, subclass, module = "energy_dsl._energy")]
pub struct System {
    vertices: usize,
    state: Exclusive<Assembly>,
    /// The element and the inputs of each term, for new parameters and for pickles.
    bound: Mutex<Vec<(Element, Py<PyDict>)>>,
}

/// x, U, the largest component of the gradient, iterations, and whether it is within the tolerance.
type Minimised<'py> = (Bound<'py, PyArray2<f64>>, f64, f64, usize, bool);

/// The element, the stencils and the inputs of a term.
type BoundTerm<'py> = (Element, Bound<'py, PyArray2<i64>>, Py<PyDict>);

/// Offsets, columns and blocks of a matrix.
type Matrix<'py> = (Bound<'py, PyArray1<i64>>, Bound<'py, PyArray1<i64>>, Bound<'py, PyArrayDyn<f64>>);

#[pymethods]
impl System {
    #[new]
    #[pyo3(signature = (vertices, pinned = None, masses = None))]
    fn new(vertices: usize, pinned: Option<Vec<usize>>, masses: Option<&Bound<'_, PyAny>>) -> PyResult<Self> {
        let pinned = mask(vertices, pinned.unwrap_or_default())?;
        let masses = masses_of(vertices, masses)?;
        let state = Exclusive::new("System", Assembly::new(pinned, masses));
        Ok(Self { vertices, state, bound: Mutex::default() })
    }

    #[getter]
    fn vertices(&self) -> usize {
        self.vertices
    }

    /// The vertices that are not pinned: those that have rows in the matrix.
    #[getter]
    fn free(&self) -> PyResult<Vec<usize>> {
        let state = self.state()?;
        Ok((0..self.vertices).filter(|&vertex| !state.pinned[vertex]).collect())
    }

    /// The vertices that have no rows in the matrix. Assign others at any time.
    #[getter]
    fn pinned(&self) -> PyResult<Vec<usize>> {
        let state = self.state()?;
        Ok((0..self.vertices).filter(|&vertex| state.pinned[vertex]).collect())
    }

    #[setter]
    fn set_pinned(&self, pinned: Vec<usize>) -> PyResult<()> {
        let pinned = mask(self.vertices, pinned)?;
        self.state()?.set_pinned(pinned);
        Ok(())
    }

    /// Masses of the vertices, in kg, of shape (vertices,); `None` for none.
    #[getter]
    fn masses<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyArray1<f64>>>> {
        let state = self.state()?;
        Ok((!state.masses.is_empty()).then(|| PyArray1::from_slice(py, &state.masses)))
    }

    #[setter]
    fn set_masses(&self, masses: Option<&Bound<'_, PyAny>>) -> PyResult<()> {
        let masses = masses_of(self.vertices, masses)?;
        self.state()?.masses = masses;
        Ok(())
    }

    /// The most threads of one call. Results do not depend on their number.
    #[getter]
    fn threads(&self) -> PyResult<usize> {
        Ok(self.state()?.threads)
    }

    #[setter]
    fn set_threads(&self, threads: usize) -> PyResult<()> {
        if threads == 0 {
            return Err(PyValueError::new_err("threads: expected at least 1, got 0"));
        }
        self.state()?.set_threads(threads);
        Ok(())
    }

    /// Adds an element for each row of `stencils`, which names the vertices of its points. Returns the number of the
    /// term, for `set`.
    #[pyo3(signature = (element, stencils, **inputs))]
    fn add(
        &self,
        py: Python<'_>,
        element: &Element,
        stencils: &Bound<'_, PyAny>,
        inputs: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<usize> {
        let declaration = element.inner.declaration();
        let points = element.vertices_of_one()?;
        let vertices = stencils_of(stencils, points, self.vertices)?;
        let elements = element.tapes::<f64>(py, vertices.len() / points.max(1), inputs)?;
        let inputs = copied(py, inputs)?;
        let mut state = self.state()?;
        let number = state.terms.len();
        let name = format!("{} {}", declaration.name, number + 1);
        state.add(TermSource::new(name, vertices, points, elements));
        self.bound().push((element.clone(), inputs));
        Ok(number)
    }

    /// Gives a term other inputs; those that are not named stay. The pattern of the matrix stays, too.
    #[pyo3(signature = (term, **inputs))]
    fn set(&self, py: Python<'_>, term: usize, inputs: Option<&Bound<'_, PyDict>>) -> PyResult<()> {
        let mut state = self.state()?;
        let mut bound = self.bound();
        let count = bound.len();
        let message = || format!("term: expected less than {count}, the number of terms, got {term}");
        let (element, known) = bound.get_mut(term).ok_or_else(|| PyIndexError::new_err(message()))?;
        let merged = known.bind(py).copy()?;
        if let Some(inputs) = inputs {
            merged.update(copied(py, Some(inputs))?.bind(py).as_mapping())?;
        }
        let TermSource { vertices, points, .. } = &state.terms[term];
        let elements = element.tapes::<f64>(py, vertices.len() / points, Some(&merged))?;
        state.replace(term, elements);
        *known = merged.unbind();
        Ok(())
    }

    /// Returns U.
    fn energy(&self, x: &Bound<'_, PyAny>) -> PyResult<f64> {
        let (py, positions, mut state) = (x.py(), self.vectors("x", x)?, self.state()?);
        let state = &mut *state;
        // The sum of no terms is −0.
        py.detach(|| state.energy(&positions)).map(|energy| energy + 0.0).map_err(PyErr::from)
    }

    /// Returns U of each term; `None` for forces.
    fn energies(&self, x: &Bound<'_, PyAny>) -> PyResult<Vec<Option<f64>>> {
        let (py, positions, mut state) = (x.py(), self.vectors("x", x)?, self.state()?);
        let state = &mut *state;
        py.detach(|| state.energies(&positions)).map_err(PyErr::from)
    }

    /// Returns f of all vertices, of shape (vertices, 3): −∂U/∂x, and the forces of laws at velocities `v`; 0 by
    /// default.
    #[pyo3(signature = (x, v = None))]
    fn forces<'py>(&self, x: &Bound<'py, PyAny>, v: Option<&Bound<'py, PyAny>>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let (py, x, v) = (x.py(), self.vectors("x", x)?, self.velocities(v)?);
        let mut state = self.state()?;
        let state = &mut *state;
        let forces = py.detach(|| state.forces(State { x: &x, v: &v })).map_err(PyErr::from)?;
        vectors(py, forces)
    }

    /// Returns which elements of each term are at inputs without a unique derivative, or outside of their formula's
    /// domain: one array for each term, 1 for degenerate, 2 for a kink, 3 for both, else 0.
    #[pyo3(signature = (x, v = None))]
    fn flags<'py>(
        &self,
        x: &Bound<'py, PyAny>,
        v: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Vec<Bound<'py, PyArray1<u8>>>> {
        let (py, x, v) = (x.py(), self.vectors("x", x)?, self.velocities(v)?);
        let state = self.state()?;
        let terms = &state.terms;
        let found = py.detach(|| terms.iter().map(|term| flagged(term, &x, &v)).collect::<Result<Vec<_>, _>>());
        let lists = found.map_err(wrong)?.into_iter().zip(terms);
        Ok(lists.map(|(flagged, term)| PyArray1::from_vec(py, marks(term.elements.len(), flagged))).collect())
    }

    /// Returns U, ∂U/∂x, and ∂²U/∂x² of the free vertices as (offsets, columns, blocks). Elements whose vertices are
    /// all pinned are left out: they are constant. With `curvature` "clamped" or "absolute", each element's Hessian is
    /// made positive semi-definite first. With `half`, the blocks below the diagonal are left out.
    #[pyo3(signature = (x, curvature = "exact", half = false))]
    fn linearise_blocks<'py>(
        &self,
        py: Python<'py>,
        x: &Bound<'py, PyAny>,
        curvature: &str,
        half: bool,
    ) -> PyResult<(f64, Bound<'py, PyArrayDyn<f64>>, Matrix<'py>)> {
        let curvature = curvature_of(curvature)?;
        let (x, mut state) = (self.vectors("x", x)?, self.state()?);
        let state = &mut *state;
        self.only_energies(state, "linearise", "linearise_forces")?;
        let still = vec![[0.0; 3]; x.len()];
        let wanted = Wanted { position: -1.0, velocity: 0.0, mass: 0.0, curvature };
        let linearised = py.detach(|| {
            let force = state.linearise(State { x: &x, v: &still }, wanted)?;
            let energy = state.energy(&x)?;
            Ok::<_, assembly::Failure>((force, energy, state.matrix().to_bsr(part(half))))
        });
        let (force, energy, bsr) = linearised.map_err(PyErr::from)?;
        let gradient = force.into_iter().map(|force| force.map(|f| -f)).collect();
        Ok((energy, vectors(py, gradient)?.to_dyn().clone(), matrix(py, bsr)?))
    }

    /// Returns f at positions x and velocities v, and position · ∂f/∂x + velocity · ∂f/∂v + mass · M of the free
    /// vertices as (offsets, columns, blocks). A step of implicit Euler with step size h has the matrix with
    /// position = −h², velocity = −h, mass = 1.
    #[pyo3(signature = (
        x, v = None, *, position = -1.0, velocity = 0.0, mass = 0.0, curvature = "exact", half = false
    ))]
    #[expect(clippy::too_many_arguments, reason = "all but three are keywords")]
    fn linearise_forces_blocks<'py>(
        &self,
        py: Python<'py>,
        x: &Bound<'py, PyAny>,
        v: Option<&Bound<'py, PyAny>>,
        position: f64,
        velocity: f64,
        mass: f64,
        curvature: &str,
        half: bool,
    ) -> PyResult<(Bound<'py, PyArray2<f64>>, Matrix<'py>)> {
        let wanted = Wanted { position, velocity, mass, curvature: curvature_of(curvature)? };
        let (x, v) = (self.vectors("x", x)?, self.velocities(v)?);
        let mut state = self.state()?;
        let state = &mut *state;
        if mass != 0.0 && state.masses.is_empty() {
            return Err(PyValueError::new_err(
                "mass: the system has no masses; pass masses= to System, or assign them",
            ));
        }
        let linearised = py.detach(|| {
            let force = state.linearise(State { x: &x, v: &v }, wanted)?;
            let matrix = state.matrix();
            let symmetric = matrix.pattern().storage() == Storage::Upper;
            Ok::<_, assembly::Failure>((force, (symmetric || !half).then(|| matrix.to_bsr(part(half)))))
        });
        let (force, bsr) = linearised.map_err(PyErr::from)?;
        let message = "half: expected symmetric forces; these have a matrix that is not symmetric";
        let bsr = bsr.ok_or_else(|| PyValueError::new_err(message))?;
        Ok((vectors(py, force)?, matrix(py, bsr)?))
    }

    /// Minimises; returns x, U, the largest component of the gradient, the number of iterations, and whether it is
    /// within the tolerance.
    #[pyo3(signature = (x, *, tolerance = 1e-9, iterations = 100, mass = 0.0, target = None))]
    fn minimise_energy<'py>(
        &self,
        x: &Bound<'py, PyAny>,
        tolerance: f64,
        iterations: usize,
        mass: f64,
        target: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Minimised<'py>> {
        let (py, start) = (x.py(), self.vectors("x", x)?);
        let target = target.map(|target| self.vectors("target", target)).transpose()?;
        let mut state = self.state()?;
        let state = &mut *state;
        self.only_energies(state, "minimise", "an integrator")?;
        let target = match (mass == 0.0, target) {
            (true, None) => Vec::new(),
            (false, Some(target)) if !state.masses.is_empty() => target,
            (false, Some(_)) => return Err(PyValueError::new_err("mass: the system has no masses; assign them")),
            _ => return Err(PyValueError::new_err("mass and target: expected both, or none")),
        };
        let goal = Goal { mass, target: &target, tolerance, iterations };
        let found = py.detach(|| minimise(state, start, &goal)).map_err(PyErr::from)?;
        Ok((vectors(py, found.x)?, found.energy, found.gradient, found.iterations, found.converged))
    }

    /// The element, the stencils and copies of the inputs of each term.
    fn _terms<'py>(&self, py: Python<'py>) -> PyResult<Vec<BoundTerm<'py>>> {
        let state = self.state()?;
        let bound = self.bound();
        let term = |((element, inputs), term): (&(Element, Py<PyDict>), &TermSource)| {
            let vertices: Vec<i64> = term.vertices.iter().map(|&vertex| vertex.into()).collect();
            let rows = vertices.len() / term.points.max(1);
            let stencils = PyArray1::from_vec(py, vertices).reshape([rows, term.points])?;
            Ok((element.clone(), stencils, inputs.clone_ref(py)))
        };
        bound.iter().zip(&state.terms).map(term).collect()
    }
}

impl System {
    fn state(&self) -> PyResult<MutexGuard<'_, Assembly>> {
        self.state.get()
    }

    fn bound(&self) -> MutexGuard<'_, Vec<(Element, Py<PyDict>)>> {
        self.bound.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn vectors(&self, name: &str, x: &Bound<'_, PyAny>) -> PyResult<Vec<Vector3<f64>>> {
        let array: PyReadonlyArrayDyn<'_, f64> = array(name, x)?;
        let expected = [self.vertices, 3];
        if array.shape() != expected {
            return Err(wrong_shape(name, &tuple(&expected), array.shape()));
        }
        Ok(numbers(name, &array)?.as_chunks::<3>().0.to_vec())
    }

    fn velocities(&self, v: Option<&Bound<'_, PyAny>>) -> PyResult<Vec<Vector3<f64>>> {
        v.map_or_else(|| Ok(vec![[0.0; 3]; self.vertices]), |v| self.vectors("v", v))
    }

    fn only_energies(&self, state: &Assembly, method: &str, instead: &str) -> PyResult<()> {
        match state.terms.iter().find(|term| term.kind() == Kind::Force) {
            None => Ok(()),
            Some(force) => {
                let name = &force.name;
                Err(PyTypeError::new_err(format!("{method}: `{name}` is a force, which has no energy; use {instead}")))
            }
        }
    }
}

fn mask(vertices: usize, pinned: Vec<usize>) -> PyResult<Vec<bool>> {
    // Terms number vertices by `u32`.
    if u32::try_from(vertices).is_err() {
        return Err(PyValueError::new_err(format!("vertices: expected at most {}, got {vertices}", u32::MAX)));
    }
    let mut mask = vec![false; vertices];
    for vertex in pinned {
        let message = || format!("pinned: there is no vertex {vertex}, only 0 to {}", vertices.saturating_sub(1));
        *mask.get_mut(vertex).ok_or_else(|| PyValueError::new_err(message()))? = true;
    }
    Ok(mask)
}

fn masses_of(vertices: usize, masses: Option<&Bound<'_, PyAny>>) -> PyResult<Vec<f64>> {
    let Some(masses) = masses else { return Ok(Vec::new()) };
    let array: PyReadonlyArrayDyn<'_, f64> = array("masses", masses)?;
    if array.shape() != [vertices] {
        return Err(wrong_shape("masses", &tuple(&[vertices]), array.shape()));
    }
    let masses = numbers("masses", &array)?.to_vec();
    match masses.iter().position(|mass| !(mass.is_finite() && *mass >= 0.0)) {
        Some(vertex) => {
            let message = format!("masses: expected finite numbers of at least 0, got {} at {vertex}", masses[vertex]);
            Err(PyValueError::new_err(message))
        }
        None => Ok(masses),
    }
}

fn curvature_of(name: &str) -> PyResult<Curvature> {
    match name {
        "exact" => Ok(Curvature::Exact),
        "clamped" => Ok(Curvature::Clamped),
        "absolute" => Ok(Curvature::Absolute),
        other => {
            let message = format!("curvature: expected \"exact\", \"clamped\" or \"absolute\", got {other:?}");
            Err(PyValueError::new_err(message))
        }
    }
}

fn part(half: bool) -> Storage {
    if half { Storage::Upper } else { Storage::Whole }
}

/// Evaluates all elements of a term, for their flags.
fn flagged(
    TermSource { elements, vertices, .. }: &TermSource,
    x: &[Vector3<f64>],
    v: &[Vector3<f64>],
) -> Result<Flagged, energy_compiler::EvaluateError> {
    let of = |all: &[Vector3<f64>]| -> Vec<f64> { vertices.iter().flat_map(|&vertex| all[vertex as usize]).collect() };
    let (all, positions, declaration) = (0..elements.len(), of(x), elements.element().declaration());
    match declaration.kind {
        Kind::Energy | Kind::Constraint => {
            let (mut u, mut g) = (vec![0.0; elements.len()], vec![0.0; positions.len()]);
            elements.gradients(all, &positions, &mut u, &mut g)
        }
        Kind::Force => elements.forces(all, &positions, &of(v), &mut vec![0.0; positions.len()]),
        Kind::Residual => elements.residuals(all, &positions, &mut vec![0.0; elements.len() * declaration.rows]),
    }
}

fn marks(count: usize, flagged: Flagged) -> Vec<u8> {
    let mut marks = vec![0; count];
    for (element, flags) in flagged {
        marks[element] = u8::from(flags.degenerate) + 2 * u8::from(flags.kink);
    }
    marks
}

fn matrix(py: Python<'_>, bsr: Bsr<f64>) -> PyResult<Matrix<'_>> {
    let indices = |list: Vec<usize>| PyArray1::from_vec(py, list.into_iter().map(|i| i as i64).collect());
    let blocks = bsr.blocks.len();
    let numbers: Vec<f64> = bsr.blocks.into_iter().flatten().flatten().collect();
    let numbers = PyArray1::from_vec(py, numbers).reshape([blocks, 3, 3])?.to_dyn().clone();
    Ok((indices(bsr.offsets), indices(bsr.columns), numbers))
}

fn vectors(py: Python<'_>, vectors: Vec<Vector3<f64>>) -> PyResult<Bound<'_, PyArray2<f64>>> {
    let rows = vectors.len();
    PyArray1::from_vec(py, vectors.into_flattened()).reshape([rows, 3])
}
