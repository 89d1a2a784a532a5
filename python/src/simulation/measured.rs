//! Numbers for a lab: loads on pins, strains of garments, and drape.

use std::path::PathBuf;

use cloth_core::measure::{Drape, DrapeOptions, Measurements};
use cloth_core::run::Record;
use energy_dsl::Vector3;
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use super::{Columns, Simulation, rows, vectors};
use crate::errors::{with_causes, wrong};
use crate::stencils::stencils_of;

#[pymethods]
impl Simulation {
    /// Forces of the cloth on what holds each vertex exactly, in N, of shape (vertices, 3); zero for free vertices.
    #[getter]
    fn pin_forces<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        vectors(py, &self.inner.get()?.pin_forces())
    }

    /// Returns force, moment and position of each pin and group, and strains of each garment, by column.
    fn reading_columns(&self) -> PyResult<Vec<(String, f64)>> {
        let simulation = self.inner.get()?;
        let all = simulation.measurements();
        Ok(all.columns().into_iter().zip(all.row(&simulation.reading())).collect())
    }
}

fn recorded(folder: &std::path::Path) -> PyResult<Measurements> {
    Ok(Record::read(folder).map_err(|error| wrong(with_causes(&error)))?.measurements)
}

/// Returns the readings of a finished run, by column: name and one number per reading.
#[pyfunction]
pub fn measurement_columns(py: Python<'_>, folder: PathBuf) -> PyResult<Columns<'_>> {
    let all = recorded(&folder)?;
    let rows: Vec<Vec<f64>> = all.readings.iter().map(|reading| all.row(reading)).collect();
    let column =
        |(number, name): (usize, String)| (name, PyArray1::from_vec(py, rows.iter().map(|row| row[number]).collect()));
    Ok(all.columns().into_iter().enumerate().map(column).collect())
}

/// Returns forces and strains at the end of a finished run, by column, as the index of a sweep lists them.
#[pyfunction]
pub fn measured_at_end(folder: PathBuf) -> PyResult<Vec<(String, f64)>> {
    Ok(recorded(&folder)?.at_end())
}

/// Measures the drape of triangles at positions in m on a disc.
#[pyfunction]
#[pyo3(signature = (
    positions, triangles, *, area = None, disc = None, specimen = None, prominence = None, centre = None,
    up = [0.0, 0.0, 1.0]
))]
#[expect(clippy::too_many_arguments, reason = "all but two are keywords")]
pub fn drape<'py>(
    py: Python<'py>,
    positions: &Bound<'py, PyAny>,
    triangles: &Bound<'py, PyAny>,
    area: Option<f64>,
    disc: Option<f64>,
    specimen: Option<f64>,
    prominence: Option<f64>,
    centre: Option<[f64; 3]>,
    up: [f64; 3],
) -> PyResult<Bound<'py, PyDict>> {
    let x = rows("positions", positions, positions.len()?)?;
    let corners = stencils_of(triangles, 3, x.len())?;
    let corners = corners.chunks_exact(3).map(|three| [0, 1, 2].map(|corner| three[corner] as usize));
    let triangles: Vec<[usize; 3]> = corners.collect();
    let mut options = DrapeOptions::default();
    (options.disc, options.specimen, options.prominence) = (disc, specimen, prominence);
    (options.centre, options.up) = (centre, up);
    let at_rest = area.unwrap_or_else(|| triangles.iter().map(|corners| area_of(corners.map(|at| x[at]))).sum());
    let drape = py.detach(|| Drape::measure(&x, &triangles, at_rest, &options)).map_err(wrong)?;
    let found = PyDict::new(py);
    found.set_item("coefficient", drape.coefficient)?;
    found.set_item("nodes", drape.nodes)?;
    found.set_item("area", drape.area)?;
    found.set_item("disc", drape.disc)?;
    found.set_item("specimen", drape.specimen)?;
    found.set_item("prominence", drape.prominence)?;
    found.set_item("radii", drape.radii.to_vec())?;
    Ok(found)
}

fn area_of([a, b, c]: [Vector3<f64>; 3]) -> f64 {
    use cloth_core::physics::geometry::{cross, norm, subtract};
    0.5 * norm(cross(subtract(b, a), subtract(c, a)))
}
