//! Random impacts at up to 100 m/s, a metre per step, with a thickness of 1 mm: none passes.

use std::f64::consts::TAU;

use energy_dsl::Vector3;

use super::contact::placed;
use super::strip::random_numbers;
use super::{Finding, ValidateError};
use crate::geometry::{Pose, norm, subtract};
use crate::simulation::Simulation;

/// Thickness of the cloth, in m.
const THICKNESS: f64 = 1e-3;
/// Time step, in s.
const DT: f64 = 0.01;
/// Half the width of the sheet that is hit, in m. A step of implicit Euler may lead around a smaller one.
const HALF: f64 = 5.0;

/// How the sheets meet.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    /// A patch in any orientation hits a pinned sheet somewhere.
    Anywhere,
    /// A corner of the patch is exactly above an edge of the pinned sheet.
    VertexOnEdge,
    /// An edge of the patch is level and parallel to an edge of the pinned sheet, exactly above it.
    ParallelEdges,
    /// The patch lies flat above the pinned sheet.
    Flat,
    /// The edges of two free, upright sheets meet, one exactly above the other.
    EdgesOfFreeSheets,
}

const KINDS: [Kind; 5] = [Kind::Anywhere, Kind::VertexOnEdge, Kind::ParallelEdges, Kind::Flat, Kind::EdgesOfFreeSheets];

/// An impact of a patch on a sheet.
struct Impact {
    kind: Kind,
    /// Cells along a side of the patch, and its width, in m.
    cells: usize,
    size: f64,
    /// The turn of the patch about its centre.
    turn: Pose,
    /// The lowest point of the patch, in m.
    aside: [f64; 2],
    /// The distance of the surfaces at the start, in m.
    gap: f64,
    velocity: Vector3<f64>,
    friction: f64,
}

impl Impact {
    /// Draws an impact from random numbers in [−½, ½).
    fn random(kind: Kind, mut draw: impl FnMut() -> f64) -> Self {
        let upright = Pose::rotation([1.0, 0.0, 0.0], 90.0, [0.0; 3]);
        let about_vertical = |angle: f64| Pose::rotation([0.0, 0.0, 1.0], angle, [0.0; 3]);
        let about_level = |angle: f64| Pose::rotation([1.0, 0.0, 0.0], angle, [0.0; 3]);
        let turn = match kind {
            Kind::Anywhere => Pose::rotation([draw(), draw(), draw() + 0.51], 360.0 * draw(), [0.0; 3]),
            Kind::VertexOnEdge => about_vertical(45.0).then(&about_level(20.0 + 100.0 * (0.5 + draw()))),
            Kind::ParallelEdges => about_level(5.0 + 170.0 * (0.5 + draw())),
            Kind::Flat => about_vertical(360.0 * draw()),
            Kind::EdgesOfFreeSheets => upright,
        };
        let aside = match kind {
            Kind::Anywhere | Kind::Flat => [draw(), draw()],
            // The pinned sheet has an edge along the first axis through its middle.
            Kind::VertexOnEdge | Kind::ParallelEdges | Kind::EdgesOfFreeSheets => [0.2 * draw(), 0.0],
        };
        let (speed, fall) = (10.0_f64.powf(1.5 + draw()), 0.1 + 0.9 * (0.5 + draw()));
        // Free edges that moved sideways would miss each other.
        let heading = if kind == Kind::EdgesOfFreeSheets { 0.0 } else { TAU * draw() };
        let level = (1.0 - fall * fall).sqrt();
        let velocity = [level * heading.cos(), level * heading.sin(), -fall].map(|part| speed * part);
        Self {
            kind,
            cells: if draw() < 0.0 { 1 } else { 2 },
            size: 0.03 + 0.2 * (0.5 + draw()),
            turn,
            aside,
            gap: 10.0_f64.powf(-4.0 + 4.0 * draw()),
            velocity,
            friction: (0.5 * draw()).max(0.0),
        }
    }

    fn simulation(&self) -> Result<Simulation, ValidateError> {
        let Self { kind, cells, size, velocity, friction, .. } = self;
        let garment = |name: &str, cells: usize, size: f64, velocity: Vector3<f64>| {
            format!(
                "[[garment]]\nname = \"{name}\"\nvelocity = {velocity:?}\n\
                 mesh.sheet = {{ cells = [{cells}, {cells}], size = [{size:?}, {size:?}] }}\n\
                 fabric = {{ density = 0.2, friction = {friction:?}, thickness = {THICKNESS:?}, material.stvk = \
                 {{ stretch_stiffness = 40.0, poisson_ratio = 0.3, bending.flat.stiffness = 1e-5 }} }}\n"
            )
        };
        let is_free = *kind == Kind::EdgesOfFreeSheets;
        let hit = garment("hit", 2, 2.0 * HALF, [0.0; 3]);
        let pins = if is_free { "" } else { "[[pins]]\nof = \"hit\"\nall = true\n" };
        let patch = garment("patch", *cells, *size, *velocity);
        let text = format!(
            "dt = {DT:?}\nduration = 1.0\nintegrator = \"newton\"\ncontact = \"on\"\nadaptive = true\n\
             tolerances.velocity = 1e-2\ngravity = [0.0, 0.0, 0.0]\n{hit}{patch}{pins}"
        );
        let (turn, aside) = (self.turn, self.aside);
        let corners = [[-0.5, -0.5], [-0.5, 0.5], [0.5, -0.5], [0.5, 0.5]].map(|[x, y]| [size * x, size * y, 0.0]);
        let turned = corners.map(|corner| turn.transform(corner));
        let lowest = turned.into_iter().min_by(|a, b| a[2].total_cmp(&b[2])).unwrap_or_default();
        // Edges of parallel kinds keep their middle above the place, corners their tip.
        let tip = if *kind == Kind::VertexOnEdge { lowest } else { [0.0, lowest[1], lowest[2]] };
        let shift = [aside[0] - tip[0], aside[1] - tip[1], THICKNESS + self.gap - tip[2]];
        placed(&text, move |vertex, x| match vertex {
            // The hit sheet is the first, with nine vertices. Upright, it reaches up to the plane z = 0.
            0..9 if is_free => [x[0], 0.0, x[1] - HALF],
            0..9 => x,
            _ => turn.translated(shift).transform(x),
        })
    }

    /// Returns whether a patch below the pinned sheet, or within its thickness, was ever found.
    fn is_through(&self, simulation: &Simulation) -> bool {
        let patch = &simulation.positions()[simulation.parts()[1].vertices.clone()];
        let is_within = |x: &&Vector3<f64>| x[0].abs().max(x[1].abs()) < HALF;
        self.kind != Kind::EdgesOfFreeSheets && patch.iter().filter(is_within).any(|x| x[2] < THICKNESS)
    }
}

/// Counts over all impacts.
#[derive(Default)]
struct Counts {
    crossings: usize,
    passed: usize,
    failed: usize,
    missed: usize,
}

impl Counts {
    /// Runs an impact until the patch has met the sheet, and two steps more.
    fn run(&mut self, impact: &Impact) -> Result<(), ValidateError> {
        let mut simulation = impact.simulation()?;
        let steps = (impact.gap / (-impact.velocity[2] * DT)).ceil() as usize + 2;
        for _ in 0..steps {
            if simulation.step().is_err() {
                self.failed += 1;
                break;
            }
            self.crossings += simulation.crossings().len();
        }
        self.passed += usize::from(impact.is_through(&simulation));
        // A patch that flies on as before has met nothing.
        let change = |v: &Vector3<f64>| norm(subtract(*v, impact.velocity)) / norm(impact.velocity);
        self.missed += usize::from(simulation.velocities()[9..].iter().all(|v| change(v) < 1e-3));
        Ok(())
    }
}

pub(super) fn ask(quick: bool, report: &mut dyn FnMut(Finding)) -> Result<(), ValidateError> {
    let count: u32 = if quick { 150 } else { 10_000 };
    let mut counts = Counts::default();
    for number in 0..count {
        let mut draw = random_numbers(number);
        // The first numbers of neighbouring seeds hardly differ.
        (0..3).for_each(|_| _ = draw());
        counts.run(&Impact::random(KINDS[number as usize % KINDS.len()], draw))?;
    }
    let Counts { crossings, passed, failed, missed } = counts;
    for (what, found) in [("crossings", crossings), ("passages", passed), ("failed steps", failed), ("misses", missed)]
    {
        report(Finding::absolute("contact", format!("{count} random impacts: {what}"), found as f64, 0.0, 0.0));
    }
    Ok(())
}
