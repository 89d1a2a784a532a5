//! Sheets that lie on each other: each interface carries the weight above it, at the distance that its barriers give.
//!
//! The energy of a pair is K β(s), with K chosen for each pair and step (see [`crate::barrier`]). Forces at rest do not
//! depend on K, heights do. In flat sheets with hardly any bending stiffness, only inertia resists a displacement along
//! the normal: K/g² = 10/β″(½) · m/h² for every pair, with the mass m of a vertex, the gap g and the step h. Drag
//! adds a little.
//!
//! Pairs share the weight of the n sheets above. For each cell of a grid there are eight. The vertices of both sides
//! meet the other side as points on triangles: 2. Edges along x cross those along y of the other side: 2. Edges along x
//! and y cross diagonals: 4, for a line of length l crosses lines at the distance d and the angle θ l sin θ/d times.
//! The mass cancels:
//!
//! 8 · 10/β″(½) · g/h² · (1 − s)(1/s − 1 − 2 ln s) = n · gravity.
//!
//! This holds for all grids, aligned or shifted. Each sheet is a little smaller than that below: without friction,
//! edges exactly above edges roll off each other.

use super::contact::{GRAVITY, advance, contact_forces, simulation};
use super::special::zero_between;
use super::{Finding, ValidateError};
use crate::barrier::{CURVATURE_AT_HALF, STIFFNESS_RATIO};
use crate::simulation::Simulation;

/// Sheets above the pinned one.
const SHEETS: usize = 5;
/// Mass per area, in kg/m².
const DENSITY: f64 = 1.0;
/// Thickness of a sheet, in m.
const THICKNESS: f64 = 1e-3;
/// The activation gap, in m.
const GAP: f64 = 2e-3;
/// Time step, in s.
const DT: f64 = 5e-3;
/// Pairs of points and triangles, and of edges, for each cell of two grids that face each other.
const PAIRS: f64 = 8.0;
/// Steps until the sheets are at rest, and steps over which forces are averaged.
const STEPS: u64 = 100;
/// Drag per mass, in 1/s. Without it, sheets that lie on each other without friction slide for ever.
const DRAG: f64 = 4.0;

pub(super) fn ask(quick: bool, report: &mut dyn FnMut(Finding)) -> Result<(), ValidateError> {
    for &cells in if quick { &[5][..] } else { &[5, 8, 12] } {
        let places = [("shifted", 1e-3), ("centred", 0.0)];
        for &(name, shift) in if quick { &places[..1] } else { &places } {
            let mut simulation = stack(cells, shift)?;
            advance(&mut simulation, STEPS)?;
            let case = |what: &str| format!("stack of {SHEETS}, {cells}² cells, {name}: {what}");
            let (force, exact) = worst_force(&mut simulation)?;
            report(Finding::relative("contact", case("force, N"), force, exact, 0.01));
            report(Finding::relative("contact", case("height, m"), height(&simulation), exact_height(), 0.01));
        }
    }
    Ok(())
}

/// Length of a side of a sheet, counted from the pinned one, in m.
fn size(sheet: usize) -> f64 {
    0.2 - 4e-3 * sheet as f64
}

/// A pinned sheet with free ones above it, every other one shifted by a distance along both axes.
fn stack(cells: usize, shift: f64) -> Result<Simulation, ValidateError> {
    let sheet = |number: usize| {
        let (aside, up) = (shift * (number % 2) as f64, number as f64 * (THICKNESS + 0.9 * GAP));
        let size = size(number);
        format!(
            "[[garment]]\nname = \"{number}\"\nplacement.translate = [{aside:?}, {aside:?}, {up:?}]\n\
             mesh.sheet = {{ cells = [{cells}, {cells}], size = [{size:?}, {size:?}] }}\n\
             fabric = {{ density = {DENSITY:?}, thickness = {THICKNESS:?}, material.stvk = \
             {{ stretch_stiffness = 40.0, poisson_ratio = 0.3, bending.flat.stiffness = 1e-6 }} }}\n"
        )
    };
    let sheets: String = (0..=SHEETS).map(sheet).collect();
    simulation(&format!(
        "dt = {DT:?}\nduration = 1.0\nintegrator = \"newton\"\ncontact = \"on\"\ntolerances.velocity = 1e-6\n\
         gravity = [0.0, 0.0, -{GRAVITY:?}]\ndrag = {DRAG:?}\n{sheets}[[pins]]\nof = \"0\"\nall = true\n"
    ))
}

/// Returns the force across the interface with the largest relative error, and the weight above it, in N. Pairs come
/// and go from step to step, which shakes flat layers by about 0.5 % of their weight. So forces are means over time.
fn worst_force(simulation: &mut Simulation) -> Result<(f64, f64), ValidateError> {
    let mut across = [0.0; SHEETS];
    for _ in 0..STEPS {
        advance(simulation, 1)?;
        let forces = contact_forces(simulation);
        for (interface, force) in across.iter_mut().enumerate() {
            let above = &forces[simulation.parts()[interface + 1].vertices.start..];
            *force += above.iter().map(|force| force[2]).sum::<f64>() / STEPS as f64;
        }
    }
    let weight = |interface: usize| {
        let area: f64 = (interface + 1..=SHEETS).map(|sheet| size(sheet) * size(sheet)).sum();
        area * DENSITY * GRAVITY
    };
    let error = |(force, weight): &(f64, f64)| (force / weight - 1.0).abs();
    let all = across.into_iter().enumerate().map(|(interface, force)| (force, weight(interface)));
    Ok(all.max_by(|a, b| error(a).total_cmp(&error(b))).unwrap_or((f64::NAN, 0.0)))
}

/// Returns the mean height of the middle of the uppermost sheet, in m.
fn height(simulation: &Simulation) -> f64 {
    let top = &simulation.positions()[simulation.parts()[SHEETS].vertices.clone()];
    let middle = top.iter().filter(|x| x[0].abs().max(x[1].abs()) < 0.06);
    let (sum, count) = middle.fold((0.0, 0.0), |(sum, count), x| (sum + x[2], count + 1.0));
    sum / count
}

/// Returns Σ (ξ + s g) over all interfaces, in m.
fn exact_height() -> f64 {
    let scale = PAIRS * STIFFNESS_RATIO / CURVATURE_AT_HALF * GAP * (1.0 + DRAG * DT) / (DT * DT);
    let part = |above: usize| {
        let excess = |s: f64| scale * (1.0 - s) * (1.0 / s - 1.0 - 2.0 * s.ln()) - above as f64 * GRAVITY;
        zero_between(1e-3, 1.0, excess)
    };
    (1..=SHEETS).map(|above| THICKNESS + part(above) * GAP).sum()
}
