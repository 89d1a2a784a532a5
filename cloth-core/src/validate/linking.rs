//! Hooked strips and a reef knot that are pulled tight: nothing passes, so links and knots stay what they are.

use energy_dsl::Vector3;

use super::contact::{placed, simulation};
use super::knots::{Loop, determinant, linking_number};
use super::{Finding, ValidateError};
use crate::geometry::{norm, subtract};
use crate::simulation::Simulation;

/// Curves are closed by arcs at this distance, in m, which nothing reaches.
const FAR: f64 = 2.0;

pub(super) fn ask(quick: bool, report: &mut dyn FnMut(Finding)) -> Result<(), ValidateError> {
    for speed in if quick { &[10.0][..] } else { &[1.0, 10.0, 50.0] } {
        hooked_strips(*speed, report)?;
    }
    reef_knot(report)
}

/// Takes steps and returns the number of crossings in all of them.
fn watched(simulation: &mut Simulation, steps: u64) -> Result<usize, ValidateError> {
    let mut crossings = 0;
    for _ in 0..steps {
        simulation.step()?;
        crossings += simulation.crossings().len();
    }
    Ok(crossings)
}

/// Segments along a strip.
const SEGMENTS: usize = 30;

/// Two strips that cross at right angles, 8 mm apart. The ends of each are pulled past the other strip.
fn strips(speed: f64) -> Result<Simulation, ValidateError> {
    let strip = |name: &str, keys: &str| {
        format!(
            "[[garment]]\nname = \"{name}\"\n{keys}\n\
             fabric = {{ density = 0.2, thickness = 1e-3, friction = 0.3, material.stvk = {{ stretch_stiffness = 40.0, \
             poisson_ratio = 0.3, bending.flat.stiffness = 1e-5 }} }}\n"
        )
    };
    let mesh = |plane: &str| {
        format!("mesh.strip = {{ length = 0.3, width = 0.02, segments = {SEGMENTS}, plane = \"{plane}\" }}\n")
    };
    let level = "placement = { translate = [0.004, 0.0, 0.0], rotate = { axis = [0.0, 0.0, 1.0], angle = 90.0 } }";
    let upright = "placement = { translate = [-0.004, 0.0, 0.0], rotate = { axis = [0.0, 1.0, 0.0], angle = -90.0 } }";
    let pull = |name: &str, axis: usize, side: f64, along: f64| {
        let (mut low, mut high, mut by) = ([-1.0; 3], [1.0; 3], [along, 0.0, 0.0]);
        if side > 0.0 {
            low[axis] = 0.1499
        } else {
            high[axis] = -0.1499
        }
        by[axis] = -0.09 * side;
        let time = norm(by) / speed;
        format!(
            "[[pins]]\nof = \"{name}\"\nbox = {{ min = {low:?}, max = {high:?} }}\n\
             motion.keys = [{{ time = 0.0 }}, {{ time = {time:?}, translate = {by:?} }}]\n"
        )
    };
    let first = pull("level", 1, 1.0, -0.16) + &pull("level", 1, -1.0, -0.16);
    let second = pull("upright", 2, 1.0, 0.16) + &pull("upright", 2, -1.0, 0.16);
    simulation(&format!(
        "dt = 0.01\nduration = 1.0\nintegrator = \"newton\"\ncontact = \"on\"\nadaptive = true\n\
         tolerances.velocity = 1e-3\ngravity = [0.0, 0.0, 0.0]\ndrag = 1.0\n{}{}{first}{second}",
        strip("level", &(mesh("vertical") + level)),
        strip("upright", &(mesh("horizontal") + upright)),
    ))
}

/// The middle line of a strip of three rows, closed far along the first axis.
fn closed(simulation: &Simulation, part: usize, far: f64) -> Loop {
    let rows = &simulation.positions()[simulation.parts()[part].vertices.clone()];
    let mut line = rows[SEGMENTS + 1..2 * (SEGMENTS + 1)].to_vec();
    let ends = [line[SEGMENTS], line[0]].map(|end| [far, end[1], end[2]]);
    line.extend(ends);
    line
}

fn hooked_strips(speed: f64, report: &mut dyn FnMut(Finding)) -> Result<(), ValidateError> {
    let mut simulation = strips(speed)?;
    let linked = |simulation: &Simulation| linking_number(&closed(simulation, 0, -FAR), &closed(simulation, 1, FAR));
    let before = linked(&simulation);
    // Until the ends have come to their places, and a little longer.
    let crossings = watched(&mut simulation, (0.2 / speed / 0.01).ceil() as u64 + 10)?;
    let case = |what: &str| format!("hooked strips pulled at {speed} m/s: {what}");
    report(Finding::absolute("contact", case("|linking number|"), before * linked(&simulation), 1.0, 0.0));
    report(Finding::absolute("contact", case("crossings"), crossings as f64, 0.0, 0.0));
    Ok(())
}

/// The size of the knot before it is pulled tight: half the distance of the legs of a rope, in m.
const KNOT: f64 = 0.02;
/// Segments of a rope.
const ROPE: usize = 60;
/// Half of each rope, in units of [`KNOT`]; the other half is its mirror image at y = 0. Both ends of a rope lead to
/// the same side. The first rope is a bight. The second comes up through it, goes around both legs, and leaves as it
/// came.
const BIGHT: [Vector3<f64>; 7] = [
    [-6.0, 1.0, 0.0],
    [-3.0, 1.0, 0.0],
    [-1.0, 1.0, 0.0],
    [0.0, 1.0, 0.0],
    [0.7, 0.95, 0.0],
    [1.1, 0.6, 0.0],
    [1.2, 0.0, 0.0],
];
const AROUND: [Vector3<f64>; 9] = [
    [6.0, 0.5, 0.0],
    [3.5, 0.5, 0.0],
    [2.2, 0.5, -0.3],
    [1.1, 0.5, -0.6],
    [0.4, 0.6, 0.0],
    [0.0, 1.0, 0.6],
    [-0.5, 1.55, 0.0],
    [-1.0, 1.0, -0.6],
    [-1.2, 0.0, -0.6],
];

/// Returns a smooth rope through half of its points, with its length, in m.
fn rope(half: &[Vector3<f64>]) -> (Loop, f64) {
    let mirrored = half.iter().rev().skip(1).map(|[x, y, z]| [*x, -y, *z]);
    let points: Loop = half.iter().copied().chain(mirrored).map(|x| x.map(|c| KNOT * c)).collect();
    let fine = smooth(&points);
    let mut lengths = vec![0.0];
    for pair in fine.windows(2) {
        lengths.push(lengths[lengths.len() - 1] + norm(subtract(pair[1], pair[0])));
    }
    let length = lengths[lengths.len() - 1];
    let at = |joint: usize| {
        let along = length * joint as f64 / ROPE as f64;
        let next = lengths.partition_point(|before| *before < along).clamp(1, fine.len() - 1);
        let part = (along - lengths[next - 1]) / (lengths[next] - lengths[next - 1]);
        [0, 1, 2].map(|axis| fine[next - 1][axis] + part * (fine[next][axis] - fine[next - 1][axis]))
    };
    ((0..=ROPE).map(at).collect(), length)
}

/// Returns points of the Catmull–Rom spline through some points.
fn smooth(points: &[Vector3<f64>]) -> Loop {
    let last = points.len() - 1;
    let point = |place: usize| {
        let (span, t) = (place / 20, (place % 20) as f64 / 20.0);
        let [a, b, c, d] = [span.saturating_sub(1), span, span + 1, span + 2].map(|at| points[at.min(last)]);
        let weights = [
            0.5 * t * (-1.0 + t * (2.0 - t)),
            0.5 * (2.0 + t * t * (3.0 * t - 5.0)),
            0.5 * t * (1.0 + t * (4.0 - 3.0 * t)),
            0.5 * t * t * (t - 1.0),
        ];
        [0, 1, 2].map(|axis| weights[0] * a[axis] + weights[1] * b[axis] + weights[2] * c[axis] + weights[3] * d[axis])
    };
    (0..=20 * last).map(point).collect()
}

/// Two ropes in a loose reef knot. Pins pull their ends apart at 2 m/s.
fn tied() -> Result<Simulation, ValidateError> {
    let (bight, around) = (rope(&BIGHT), rope(&AROUND));
    let hair = |name: &str, length: f64, pull: f64| {
        format!(
            "[[hair]]\nname = \"{name}\"\ncount = 1\nsegments = {ROPE}\nlength = {length:?}\ndensity = 1e-3\n\
             stretch_stiffness = 200.0\nbend_stiffness = 5e-6\nrooted = false\n\
             [[pins]]\nof = \"{name}\"\nvertices = [0, {ROPE}]\n\
             motion.keys = [{{ time = 0.0 }}, {{ time = 0.04, translate = [{pull:?}, 0.0, 0.0] }}]\n"
        )
    };
    let text = format!(
        "dt = 0.01\nduration = 1.0\nintegrator = \"newton\"\ncontact = \"on\"\nadaptive = true\n\
         tolerances.velocity = 1e-3\ngravity = [0.0, 0.0, 0.0]\ndrag = 2.0\n{}{}",
        hair("bight", bight.1, -0.08),
        hair("around", around.1, 0.08)
    );
    let start = [bight.0, around.0].concat();
    placed(&text, move |vertex, _| start[vertex])
}

/// Returns the closed curve in which far arcs join the upper ends of both ropes, and the lower ends: a reef knot.
fn knot(simulation: &Simulation) -> Loop {
    let (bight, around) = simulation.positions().split_at(ROPE + 1);
    let arc = |side: f64, y: f64| [side * FAR, y * FAR, 0.0];
    let back = around.iter().rev().copied();
    let open = bight.iter().copied().chain([arc(-1.0, -1.0), arc(1.0, -1.0)]).chain(back);
    open.chain([arc(1.0, 1.0), arc(-1.0, 1.0)]).collect()
}

/// The linking number of both ropes is 0, tied or not. So the determinant of a closed curve of both is asked for.
fn reef_knot(report: &mut dyn FnMut(Finding)) -> Result<(), ValidateError> {
    let mut simulation = tied()?;
    let loose = determinant(&knot(&simulation));
    watched(&mut simulation, 12)?;
    let tight = determinant(&knot(&simulation));
    report(Finding::absolute("contact", "loose reef knot: determinant".into(), loose, 9.0, 1e-9));
    report(Finding::absolute("contact", "reef knot pulled tight: determinant".into(), tight, 9.0, 1e-6));
    Ok(())
}
