//! A drape over thinner and thinner contact: its shape converges at first order, because cloth rests between a third of
//! the reach of contact and the whole of it.

use super::contact::{GRAVITY, advance, simulation};
use super::{Finding, ValidateError};

/// Returns the mean height of a sheet that is held at its boundary and rests on a ball, in m, given the reach of
/// contact, in m. The small time step makes the barriers stiff compared with the weight.
fn height(cells: usize, reach: f64) -> Result<f64, ValidateError> {
    let mut simulation = simulation(&format!(
        "dt = 1e-3\nduration = 1.0\nintegrator = \"newton\"\ncontact = \"obstacles\"\ntolerances.velocity = 1e-6\n\
         gravity = [0.0, 0.0, -{GRAVITY:?}]\ndrag = 30.0\n[mesh.sheet]\ncells = [{cells}, {cells}]\n\
         size = [0.4, 0.4]\ndiagonals = \"alternating\"\n[fabric]\ndensity = 0.2\nmaterial.stvk = \
         {{ stretch_stiffness = 10.0, poisson_ratio = 0.3, bending.flat.stiffness = 1e-5 }}\n\
         [[pins]]\nboundary = true\n[[obstacles]]\nsphere = {{ centre = [0.0, 0.0, -0.12], radius = 0.1 }}\n\
         thickness = {reach:?}\n"
    ))?;
    advance(&mut simulation, 800)?;
    let x = simulation.positions();
    Ok(x.iter().map(|x| x[2]).sum::<f64>() / x.len() as f64)
}

pub(super) fn ask(quick: bool, report: &mut dyn FnMut(Finding)) -> Result<(), ValidateError> {
    for cells in if quick { &[8][..] } else { &[8, 16] } {
        let [thick, half, quarter] = [3e-3, 1.5e-3, 7.5e-4].map(|reach| height(*cells, reach));
        let (thick, half, quarter) = (thick?, half?, quarter?);
        let order = ((thick - half) / (half - quarter)).log2();
        let case = format!("drape on a ball, reach of contact halved, {cells}² cells: order");
        report(Finding::absolute("contact", case, order, 1.0, 0.1));
    }
    Ok(())
}
