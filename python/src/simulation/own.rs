//! Own forces and energies of a simulation: texts, and functions of Python.

use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};

use cloth_core::simulation::{OwnElements, OwnForce};
use energy_compiler::Elements as Tapes;
use energy_dsl::{Declaration, Element as _, Kind, energy};
use energy_solve::{Character, Order, OwnLaw, OwnResults, OwnTerm, SteeredTapeTerm, SteeredTapes, Term};
use numpy::{PyArray1, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

use crate::arrays::{array, tuple, wrong_shape};
use crate::element::{Element, copied};
use crate::stencils::stencils_of;
use crate::system::laws::{SharedElements, TextForce, TextResidual, lock};

/// A force or an energy of a text, whose parameters change between steps.
pub struct OwnText {
    pub on: OwnElements,
    pub element: Element,
    /// Copies of the inputs.
    pub inputs: Mutex<Py<PyDict>>,
    elements: Mutex<Tapes<f64>>,
    /// How new parameters reach the terms.
    handles: Mutex<Vec<Handle>>,
}

fn on(name: &str, points: usize, stencils: Vec<u32>) -> OwnElements {
    let vertices = stencils.into_iter().map(|vertex| vertex as usize).collect();
    OwnElements { name: name.to_owned(), points, vertices }
}

enum Handle {
    /// Numbers of the elements of an island.
    Energy(Vec<usize>, SteeredTapes),
    Whole(SharedElements),
}

impl OwnText {
    pub fn new(
        name: &str,
        element: &Element,
        stencils: &Bound<'_, PyAny>,
        inputs: &Bound<'_, PyDict>,
        vertices: usize,
    ) -> PyResult<Self> {
        let py = stencils.py();
        let points = element.vertices_of_one()?;
        let stencils = stencils_of(stencils, points, vertices)?;
        let elements = element.tapes(py, stencils.len() / points.max(1), Some(inputs))?;
        Ok(Self {
            on: on(name, points, stencils),
            element: element.clone(),
            inputs: Mutex::new(copied(py, Some(inputs))?),
            elements: Mutex::new(elements),
            handles: Mutex::default(),
        })
    }

    /// Gives the elements other inputs from the next step on; those that are not named stay.
    pub fn set(&self, py: Python<'_>, inputs: &Bound<'_, PyDict>) -> PyResult<()> {
        let mut known = self.inputs.lock().unwrap_or_else(PoisonError::into_inner);
        let merged = known.bind(py).copy()?;
        merged.update(copied(py, Some(inputs))?.bind(py).as_mapping())?;
        let count = self.on.vertices.len() / self.on.points.max(1);
        let elements = self.element.tapes::<f64>(py, count, Some(&merged))?;
        for handle in &*self.handles.lock().unwrap_or_else(PoisonError::into_inner) {
            match handle {
                Handle::Energy(numbers, tapes) => tapes.replace(elements.tape().selected(numbers)),
                Handle::Whole(shared) => *lock(shared) = elements.clone(),
            }
        }
        *self.elements.lock().unwrap_or_else(PoisonError::into_inner) = elements;
        *known = merged.unbind();
        Ok(())
    }
}

impl OwnForce for OwnText {
    fn elements(&self) -> &OwnElements {
        &self.on
    }

    fn is_whole(&self) -> bool {
        matches!(self.element.inner.declaration().kind, Kind::Force | Kind::Residual)
    }

    fn term(&self, numbers: &[usize], vertices: Vec<u32>) -> Box<dyn Term> {
        let elements = self.elements.lock().unwrap_or_else(PoisonError::into_inner).clone();
        let declaration = self.element.inner.declaration();
        let mut handles = self.handles.lock().unwrap_or_else(PoisonError::into_inner);
        // Terms of an earlier assembly of the scene are gone.
        handles.retain(|handle| match handle {
            Handle::Energy(_, tapes) => tapes.is_shared(),
            Handle::Whole(shared) => Arc::strong_count(shared) > 1,
        });
        let name = self.on.name.clone();
        if !self.is_whole() {
            let tapes = SteeredTapes::new(elements.tape().selected(numbers));
            handles.push(Handle::Energy(numbers.to_vec(), tapes.clone()));
            let vertices = vertices.into_iter().map(|vertex| vertex as usize);
            return Box::new(SteeredTapeTerm::new(name, declaration, tapes, vertices));
        }
        let shared: SharedElements = Arc::new(Mutex::new(elements));
        handles.push(Handle::Whole(Arc::clone(&shared)));
        match declaration.kind {
            Kind::Force => Box::new(OwnTerm::new(name, TextForce::new(shared), vertices)),
            _ => Box::new(OwnTerm::new(name, TextResidual::new(shared, self.on.points), vertices)),
        }
    }
}

energy! {
    // Texts of reports about the terms of functions.

    /// An energy that a function of Python evaluates.
    energy PythonEnergy(p: Point) { norm_squared(p) }

    /// A force that a function of Python evaluates.
    force PythonForce(p: Point) { p }
}

/// A force or an energy that a function of Python evaluates.
#[derive(Clone)]
pub struct OwnFunction {
    pub on: OwnElements,
    pub function: Arc<Py<PyAny>>,
    /// Whether the function is an energy; else it is a force.
    is_energy: bool,
    /// Whether the function returns Jacobians.
    has_jacobians: bool,
    /// The forces of a step without Jacobians, from its start on; empty before the first step.
    fixed: Vec<f64>,
    /// The first exception of the function, until the simulation reports it.
    raised: Arc<Mutex<Option<PyErr>>>,
}

impl OwnFunction {
    pub fn new(
        name: &str,
        function: Py<PyAny>,
        stencils: &Bound<'_, PyAny>,
        [is_energy, has_jacobians]: [bool; 2],
        vertices: usize,
        raised: Arc<Mutex<Option<PyErr>>>,
    ) -> PyResult<Self> {
        let given = stencils.py().import("numpy")?.call_method1("asarray", (stencils,))?;
        let shape: Vec<usize> = given.getattr("shape")?.extract()?;
        let &[_, points] = &shape[..] else { return Err(wrong_shape("stencils", "(n, points)", &shape)) };
        if points == 0 {
            return Err(PyValueError::new_err(format!("{name}: expected at least one vertex for each element")));
        }
        let stencils = stencils_of(&given, points, vertices)?;
        let (on, function) = (on(name, points, stencils), Arc::new(function));
        Ok(Self { on, function, is_energy, has_jacobians, fixed: Vec::new(), raised })
    }

    /// Whether integrators evaluate the force, with its Jacobians, at the end of a step.
    fn is_implicit_force(&self) -> bool {
        !self.is_energy && self.has_jacobians
    }

    /// Whether the function is evaluated once, at the start of a step.
    fn is_fixed(&self) -> bool {
        !self.is_energy && !self.has_jacobians
    }

    fn note(&self, error: PyErr) {
        self.raised.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
    }

    /// Calls the function, and writes what it returns.
    fn call(&self, py: Python<'_>, order: Order, x: &[f64], v: &[f64], results: &mut OwnResults) -> PyResult<()> {
        let (n, points) = (x.len() / (3 * self.on.points), self.on.points);
        let number = match order {
            Order::Energy => 0,
            Order::Force => 1,
            Order::Jacobians => 1 + u8::from(self.has_jacobians),
        };
        let positions = PyArray1::from_slice(py, x).reshape([n, points, 3])?;
        let returned = if self.is_energy {
            self.function.call1(py, (positions, number))?
        } else {
            let velocities = PyArray1::from_slice(py, v).reshape([n, points, 3])?;
            self.function.call1(py, (positions, velocities, number))?
        };
        let returned = returned.into_bound(py);
        let parts: Vec<Bound<'_, PyAny>> = match returned.cast::<PyTuple>() {
            Ok(tuple) => tuple.iter().collect(),
            Err(_) => vec![returned],
        };
        let (vectors, matrix) = ([n, points, 3], [n, 3 * points, 3 * points]);
        let part = |at: usize, what: &str, shape: &[usize], to: &mut [f64], sign: f64| {
            let Some(given) = parts.get(at).filter(|given| !given.is_none()) else {
                let message = format!("{}: expected {what} as result {at} at order {number}", self.on.name);
                return Err(PyValueError::new_err(message));
            };
            let given = array::<f64>(what, given)?;
            if given.shape() != shape {
                return Err(wrong_shape(&format!("{}, {what}", self.on.name), &tuple(shape), given.shape()));
            }
            let given = given.as_slice().map_err(|error| PyValueError::new_err(error.to_string()))?;
            to.iter_mut().zip(given).for_each(|(to, given)| *to = sign * given);
            Ok(())
        };
        if self.is_energy {
            part(0, "U", &[n], &mut results.energies, 1.0)?;
            if number >= 1 {
                part(1, "gradient", &vectors, &mut results.forces, -1.0)?;
            }
            if number == 2 {
                part(2, "Hessian", &matrix, &mut results.by_position, -1.0)?;
            }
            return Ok(());
        }
        part(0, "force", &vectors, &mut results.forces, 1.0)?;
        if number == 2 {
            part(1, "∂f/∂x", &matrix, &mut results.by_position, 1.0)?;
            part(2, "∂f/∂v", &matrix, &mut results.by_velocity, 1.0)?;
        }
        Ok(())
    }
}

impl fmt::Debug for OwnFunction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("OwnFunction").field("name", &self.on.name).finish_non_exhaustive()
    }
}

impl OwnForce for OwnFunction {
    fn elements(&self) -> &OwnElements {
        &self.on
    }

    fn is_whole(&self) -> bool {
        true
    }

    fn term(&self, _: &[usize], vertices: Vec<u32>) -> Box<dyn Term> {
        Box::new(OwnTerm::new(self.on.name.clone(), self.clone(), vertices))
    }
}

impl OwnLaw for OwnFunction {
    fn declaration(&self) -> &Declaration {
        if self.is_energy { PythonEnergy::<f64>::DECLARATION } else { PythonForce::<f64>::DECLARATION }
    }

    fn points(&self) -> usize {
        self.on.points
    }

    fn character(&self) -> Character {
        // Nothing is known of the Jacobians of a function. A force without them is fixed over a step.
        let is_implicit = self.is_implicit_force();
        let curved = self.has_jacobians;
        Character { symmetric: !is_implicit, velocity_dependent: is_implicit, quadratic: false, curved }
    }

    fn has_energy(&self) -> bool {
        !self.is_implicit_force()
    }

    fn evaluate(&self, order: Order, x: &[f64], v: &[f64], results: &mut OwnResults) {
        if self.is_fixed() {
            // The potential −f · x of a constant force.
            let elements = self.fixed.chunks(3 * self.on.points).zip(x.chunks(3 * self.on.points));
            for (energy, (force, x)) in results.energies.iter_mut().zip(elements) {
                *energy = -force.iter().zip(x).map(|(f, x)| f * x).sum::<f64>();
            }
            results.forces.iter_mut().zip(&self.fixed).for_each(|(force, fixed)| *force = *fixed);
            return;
        }
        if order == Order::Energy && !self.is_energy {
            return;
        }
        if let Err(error) = Python::attach(|py| self.call(py, order, x, v, results)) {
            // Numbers that no step accepts; the simulation then reports the exception.
            results.energies.fill(f64::NAN);
            results.forces.fill(f64::NAN);
            self.note(error);
        }
    }

    fn begin_step(&mut self, x: &[f64], v: &[f64]) {
        if self.is_fixed() {
            let mut results = OwnResults { forces: vec![0.0; x.len()], ..OwnResults::default() };
            if let Err(error) = Python::attach(|py| self.call(py, Order::Force, x, v, &mut results)) {
                results.forces.fill(f64::NAN);
                self.note(error);
            }
            self.fixed = results.forces;
        }
    }

    fn varies(&self) -> bool {
        true
    }
}
