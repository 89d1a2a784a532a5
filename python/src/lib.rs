//! The compiled half of the Python package `energy_dsl`: elements from text, sums over meshes, cloth.

mod arrays;
mod compiled;
mod element;
mod errors;
mod evaluation;
mod exclusive;
mod interrupt;
mod limits;
mod simulation;
mod stencils;
mod system;
mod tools;

use pyo3::prelude::*;

#[pymodule]
fn _energy(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("EnergyError", module.py().get_type::<errors::EnergyError>())?;
    module.add("FolderInUseError", module.py().get_type::<errors::FolderInUseError>())?;
    module.add("ResourceError", module.py().get_type::<errors::ResourceError>())?;
    module.add_class::<element::Element>()?;
    module.add_class::<element::Input>()?;
    module.add_class::<evaluation::Elements>()?;
    module.add_class::<system::System>()?;
    module.add_class::<simulation::Simulation>()?;
    module.add_class::<simulation::Snapshot>()?;
    module.add_function(wrap_pyfunction!(element::energies, module)?)?;
    module.add_function(wrap_pyfunction!(element::catalogue, module)?)?;
    module.add_function(wrap_pyfunction!(element::library_element, module)?)?;
    module.add_function(wrap_pyfunction!(simulation::runs::run, module)?)?;
    module.add_function(wrap_pyfunction!(simulation::runs::resume, module)?)?;
    module.add_function(wrap_pyfunction!(simulation::runs::input_files, module)?)?;
    module.add_function(wrap_pyfunction!(simulation::runs::read_scene, module)?)?;
    module.add_function(wrap_pyfunction!(simulation::runs::scene_tables, module)?)?;
    module.add_function(wrap_pyfunction!(simulation::measured::measurement_columns, module)?)?;
    module.add_function(wrap_pyfunction!(simulation::measured::measured_at_end, module)?)?;
    module.add_function(wrap_pyfunction!(simulation::measured::drape, module)?)?;
    module.add_function(wrap_pyfunction!(simulation::runs::version, module)?)?;
    module.add_function(wrap_pyfunction!(tools::audit, module)?)?;
    module.add_function(wrap_pyfunction!(tools::show, module)?)
}
