//! Declarations, and their inputs.

use energy_compiler::{InputKind, Interpreted};
use energy_dsl::tape::Column;
use numpy::{PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{doubles, numbers, tuple, wrong_shape};
use crate::errors::wrong;
use crate::evaluation::{Call, Elements};

/// An input of an element.
#[pyclass(frozen, get_all, module = "energy_dsl")]
pub struct Input {
    /// Name, as declared.
    name: String,
    /// `point`, `unknown`, `rest` or `parameter`.
    kind: &'static str,
    /// Shape of the numbers of one element; `()` for a scalar.
    shape: Vec<usize>,
    /// Unit, as declared; empty if none was given.
    unit: String,
}

#[pymethods]
impl Input {
    fn __repr__(&self) -> String {
        let unit = if self.unit.is_empty() { String::new() } else { format!(" [{}]", self.unit) };
        format!("<{} {} {}{unit}>", self.kind, self.name, tuple(&self.shape))
    }
}

/// A declared energy, force, constraint or residual.
#[pyclass(frozen, module = "energy_dsl")]
#[derive(Clone)]
pub struct Element {
    pub inner: Interpreted,
}

/// Compiles all declarations of a text.
#[pyfunction]
#[pyo3(signature = (text, file = "<text>"))]
pub fn energies(py: Python<'_>, text: &str, file: &str) -> PyResult<Vec<Element>> {
    let elements =
        py.detach(|| Interpreted::from_file(text, file).map_err(|errors| errors.to_string())).map_err(wrong)?;
    Ok(elements.into_iter().map(|inner| Element { inner }).collect())
}

/// Returns the texts of the elements of the library, by name. `energy_catalogue` has them, too, but compiles all their
/// routines.
#[pyfunction]
pub fn catalogue() -> Vec<(&'static str, &'static str)> {
    macro_rules! texts {
        ($($name:ident),* $(,)?) => {
            vec![$({
                let declaration = <energy_elements::$name<f64> as energy_dsl::Element>::DECLARATION;
                (declaration.name, declaration.source)
            }),*]
        };
    }
    energy_elements::for_each_element!(texts)
}

#[pymethods]
impl Element {
    #[getter]
    fn name(&self) -> &'static str {
        self.inner.declaration().name
    }

    /// `energy`, `force`, `constraint` or `residual`.
    #[getter]
    fn kind(&self) -> &'static str {
        self.inner.declaration().kind.keyword()
    }

    #[getter]
    fn formula(&self) -> &'static str {
        self.inner.declaration().formula
    }

    /// The text of the declaration.
    #[getter]
    fn source(&self) -> &'static str {
        self.inner.declaration().source
    }

    /// Description, formula, shapes and units.
    #[getter]
    fn description(&self) -> String {
        let declaration = self.inner.declaration();
        let inputs = self.inner.inputs().iter().map(|input| {
            let unit = if input.unit.is_empty() { String::new() } else { format!(", in {}", input.unit) };
            format!("  {}: {} of shape {}{unit}\n", input.name, keyword(input.kind), tuple(&input.shape))
        });
        format!(
            "{}\n\n{}\n\nInputs of one element:\n{}",
            declaration.docs,
            declaration.formula,
            inputs.collect::<String>()
        )
    }

    #[getter]
    fn inputs(&self) -> Vec<Input> {
        let input = |input: &energy_compiler::InputNumbers| Input {
            name: input.name.clone(),
            kind: keyword(input.kind),
            shape: input.shape.clone(),
            unit: input.unit.clone(),
        };
        self.inner.inputs().iter().map(input).collect()
    }

    /// Number of points of one element; 0 for a residual.
    #[getter]
    fn points(&self) -> usize {
        self.point_count()
    }

    /// Number of unknowns of a residual.
    #[getter]
    fn unknowns(&self) -> usize {
        count(&self.inner, InputKind::Unknown)
    }

    fn __repr__(&self) -> String {
        let inputs = self.inner.inputs().iter().map(|input| input.name.as_str()).collect::<Vec<_>>().join(", ");
        format!("<{} {}({inputs})>", self.kind(), self.name())
    }

    /// Binds rest shapes and parameters of `count` elements: one value for all, or one for each along the first axis.
    #[pyo3(signature = (count, **inputs))]
    pub fn bind(&self, count: usize, inputs: Option<&Bound<'_, PyDict>>) -> PyResult<Elements> {
        let columns = Columns::new(self, count, inputs)?;
        let (rest, parameters) = (columns.of(InputKind::Rest)?, columns.of(InputKind::Parameter)?);
        let elements = self.inner.elements::<f64>(count, &rest, &parameters).map_err(wrong)?;
        Ok(Elements::new(elements))
    }
}

impl Element {
    pub fn point_count(&self) -> usize {
        count(&self.inner, InputKind::Point) / 3
    }
}

/// Returns the numbers of all inputs of a kind.
pub fn count(element: &Interpreted, kind: InputKind) -> usize {
    element.inputs().iter().filter(|input| input.kind == kind).map(energy_compiler::InputNumbers::size).sum()
}

macro_rules! evaluations {
    ($($(#[$doc:meta])* $name:ident($x:ident $(, $v:ident)?) => $call:ident;)*) => {
        #[pymethods]
        impl Element {
            $($(#[$doc])*
            #[pyo3(signature = ($x, $($v,)? *, out = None, flags = false, **inputs))]
            fn $name<'py>(
                &self,
                $x: &Bound<'py, PyAny>,
                $($v: &Bound<'py, PyAny>,)?
                out: Option<&Bound<'py, PyAny>>,
                flags: bool,
                inputs: Option<&Bound<'py, PyDict>>,
            ) -> PyResult<Bound<'py, PyAny>> {
                let x = doubles(stringify!($x), $x)?;
                let count = x.shape().first().copied().unwrap_or(0);
                self.bind(count, inputs)?.evaluate($x.py(), Call::$call, &x, evaluations!(@v $($v)?), out, flags)
            })*
        }

        #[pymethods]
        impl Elements {
            $($(#[$doc])*
            #[pyo3(signature = ($x, $($v,)? *, out = None, flags = false))]
            fn $name<'py>(
                &self,
                $x: &Bound<'py, PyAny>,
                $($v: &Bound<'py, PyAny>,)?
                out: Option<&Bound<'py, PyAny>>,
                flags: bool,
            ) -> PyResult<Bound<'py, PyAny>> {
                let x = doubles(stringify!($x), $x)?;
                self.evaluate($x.py(), Call::$call, &x, evaluations!(@v $($v)?), out, flags)
            })*
        }
    };
    (@v) => { None };
    (@v $v:ident) => { Some($v) };
}

evaluations! {
    /// Returns U, of shape (n,).
    value(x) => Value;
    /// Returns U and ∂U/∂x, of shape (n, points, 3).
    gradient(x) => Gradient;
    /// Returns U, ∂U/∂x and ∂²U/∂x², of shape (n, 3 points, 3 points).
    hessian(x) => Hessian;
    /// Returns (∂²U/∂x²) v, of shape (n, points, 3).
    hessian_vector(x, v) => HessianVector;
    /// Returns f(x, v), of shape (n, points, 3).
    force(x, v) => Force;
    /// Returns f, ∂f/∂x and ∂f/∂v; the last two of shape (n, 3 points, 3 points).
    force_jacobians(x, v) => ForceJacobians;
    /// Returns C, of shape (n, rows), and ∂C/∂x, of shape (n, rows, 3 points).
    constraint(x) => Constraint;
    /// Returns r(u), of shape (n, rows), for unknowns of shape (n, unknowns).
    residual(u) => Residual;
    /// Returns r and ∂r/∂u, of shape (n, rows, unknowns).
    jacobian(u) => Jacobian;
}

fn keyword(kind: InputKind) -> &'static str {
    match kind {
        InputKind::Point => "point",
        InputKind::Unknown => "unknown",
        InputKind::Rest => "rest",
        InputKind::Parameter => "parameter",
    }
}

/// The numbers of the inputs that elements are bound to.
struct Columns<'a, 'py> {
    element: &'a Interpreted,
    count: usize,
    /// In the order of the inputs; `None` for points.
    arrays: Vec<Option<PyReadonlyArrayDyn<'py, f64>>>,
}

impl<'a, 'py> Columns<'a, 'py> {
    fn new(element: &'a Element, count: usize, given: Option<&Bound<'py, PyDict>>) -> PyResult<Self> {
        let name = element.name();
        let bound = |kind| matches!(kind, InputKind::Rest | InputKind::Parameter);
        let wanted: Vec<&str> =
            element.inner.inputs().iter().filter(|i| bound(i.kind)).map(|input| input.name.as_str()).collect();
        let mut arrays = Vec::new();
        for input in element.inner.inputs() {
            let value = given.map(|given| given.get_item(&input.name)).transpose()?.flatten();
            arrays.push(match (bound(input.kind), value) {
                (true, Some(value)) => Some(doubles(&input.name, &value)?),
                (true, None) => {
                    let kind = keyword(input.kind);
                    let message = format!("{name}: missing {kind} `{}`; expected {}", input.name, wanted.join(", "));
                    return Err(PyTypeError::new_err(message));
                }
                (false, _) => None,
            });
        }
        for key in given.into_iter().flat_map(|given| given.keys()) {
            let key: String = key.extract()?;
            if !wanted.contains(&key.as_str()) {
                let message = format!("{name}: no input `{key}` to bind; expected {}", wanted.join(", "));
                return Err(PyTypeError::new_err(message));
            }
        }
        Ok(Self { element: &element.inner, count, arrays })
    }

    fn of(&self, kind: InputKind) -> PyResult<Vec<Column<'_, f64>>> {
        let inputs = self.element.inputs().iter().zip(&self.arrays).filter(|(input, _)| input.kind == kind);
        inputs
            .map(|(input, array)| {
                let array = array.as_ref().expect("checked");
                let data = numbers(&input.name, array)?;
                let each = [&[self.count], &input.shape[..]].concat();
                match array.shape() {
                    shape if shape == input.shape => Ok(Column::Same(data)),
                    shape if shape == each => Ok(Column::Each(data)),
                    shape => {
                        let expected = format!("{} or {}", tuple(&input.shape), tuple(&each));
                        Err(wrong_shape(&input.name, &expected, shape))
                    }
                }
            })
            .collect()
    }
}
