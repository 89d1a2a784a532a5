use energy_dsl::{Declaration, Element, Vector3};
use energy_elements::ZeroLengthSpring;
use energy_solve::{
    Character, DofMap, Linearisation, Pattern, PlacedTerm, Quantity, State, Stencils, StepStart, Tally, Term,
    TermDescription, index,
};

use super::Anchor;
use crate::motion::Motion;

/// A vertex that a spring pulls to its place.
#[derive(Clone, Copy, Debug)]
pub(super) struct Held {
    /// Index within the island.
    pub vertex: usize,
    /// Stiffness of the spring, in N/m.
    pub stiffness: f64,
    /// The place before the motion, in m.
    pub initial: Vector3<f64>,
}

/// Springs of rest length 0 between vertices and places that may move. Each changes only the diagonal block of its
/// vertex.
#[derive(Debug)]
pub(super) struct SoftPinTerm {
    name: String,
    held: Vec<Held>,
    vertices: Vec<u32>,
    motion: Option<Motion>,
    release: Option<f64>,
    /// The places at the end of the current step, in m; empty after the release.
    places: Vec<Vector3<f64>>,
    /// Slots of the diagonal blocks; `None` if the vertex is pinned otherwise.
    slots: Vec<Option<usize>>,
}

impl SoftPinTerm {
    /// Creates the springs of the pin with an index in the scene. They let go at the time `release`, in s; `None` for
    /// never.
    pub(super) fn new(pin: usize, held: Vec<Held>, motion: Option<Motion>, release: Option<f64>) -> Self {
        let vertices = held.iter().map(|held| index(held.vertex)).collect();
        let name = format!("pin {pin}");
        let mut term = Self { name, held, vertices, motion, release, places: Vec::new(), slots: Vec::new() };
        term.move_to(0.0, 0.0);
        term
    }

    fn is_released(&self, time: f64) -> bool {
        self.release.is_some_and(|release| release <= time)
    }

    /// Moves the places to those at the end of a step, unless the pin is released when it starts.
    fn move_to(&mut self, start: f64, end: f64) {
        self.places.clear();
        if !self.is_released(start) {
            let pose = self.motion.as_ref().map(|motion| motion.pose(end));
            let place = |held: &Held| pose.map_or(held.initial, |pose| pose.transform(held.initial));
            self.places.extend(self.held.iter().map(place));
        }
    }

    /// Iterates over the springs that act, each with its number: on free vertices, before the release.
    fn anchors(&self) -> impl Iterator<Item = (usize, Anchor)> + '_ {
        let all = self.held.iter().zip(&self.places).zip(&self.slots).enumerate();
        all.filter_map(|(number, ((held, &place), slot))| {
            let spring = ZeroLengthSpring::new(held.stiffness, 0.0);
            Some((number, Anchor { vertex: held.vertex, slot: (*slot)?, place, spring }))
        })
    }

    fn tally(&self) -> Tally {
        let evaluated = self.anchors().count() as u64;
        Tally { evaluated, skipped: self.held.len() as u64 - evaluated, flagged: 0, projected: 0 }
    }
}

impl TermDescription for SoftPinTerm {
    fn name(&self) -> &str {
        &self.name
    }

    fn declaration(&self) -> &Declaration {
        <ZeroLengthSpring as Element>::DECLARATION
    }

    fn character(&self) -> Character {
        Anchor::CHARACTER
    }

    fn stencils(&self) -> Stencils<'_> {
        Stencils::new(1, &self.vertices)
    }
}

impl Term for SoftPinTerm {
    fn place(mut self: Box<Self>, dofs: &DofMap, pattern: &Pattern) -> Box<dyn PlacedTerm> {
        let slot = |held: &Held| dofs.row(held.vertex).map(|row| pattern.diagonal(row));
        self.slots = self.held.iter().map(slot).collect();
        self
    }
}

impl PlacedTerm for SoftPinTerm {
    fn begin_step(&mut self, start: StepStart<'_>) {
        self.move_to(start.time, start.time + start.dt);
    }

    fn is_driven(&self) -> bool {
        self.motion.is_some() || self.release.is_some()
    }

    fn varies(&self, from: f64, to: f64) -> bool {
        let moves = self.motion.as_ref().is_some_and(|motion| motion.moves(from, to));
        !self.is_released(from) && (moves || self.is_released(to))
    }

    fn has_energy(&self) -> bool {
        true
    }

    fn energy(&self, x: &[Vector3<f64>]) -> Option<(f64, Tally)> {
        Some((self.anchors().map(|(_, anchor)| anchor.energy(x)).sum(), self.tally()))
    }

    fn add_force(&self, State { x, .. }: State<'_>, force: &mut [Vector3<f64>]) -> Tally {
        self.anchors().for_each(|(_, anchor)| anchor.add_force(x, force));
        self.tally()
    }

    fn add_linearisation(&self, state: State<'_>, sum: &mut Linearisation<'_>) -> Tally {
        self.anchors().for_each(|(_, anchor)| anchor.add_linearisation(state, sum));
        self.tally()
    }

    fn find_non_finite(&self, _: Quantity, State { x, .. }: State<'_>) -> Option<usize> {
        self.anchors().find(|(_, anchor)| !anchor.energy(x).is_finite()).map(|(number, _)| number)
    }
}

#[cfg(test)]
mod tests {
    use crate::Simulation;
    use crate::geometry::{norm, subtract};
    use crate::scene::Scene;

    const SHEET: &str = r#"
dt = 0.01
duration = 1.0
integrator = "newton"
contact = "obstacles"
drag = 8.0
[mesh.sheet]
cells = [3, 3]
size = [0.3, 0.3]
[fabric]
density = 0.2
material.stvk = { stretch_stiffness = 400.0, poisson_ratio = 0.3 }
"#;

    fn finished(more: &str) -> Simulation {
        finished_by("newton", more)
    }

    fn finished_by(integrator: &str, more: &str) -> Simulation {
        let text = format!("{SHEET}{more}").replace("\"newton\"", &format!("\"{integrator}\""));
        let scene = Scene::parse(&text, "sheet.toml".as_ref()).unwrap();
        let mut simulation = Simulation::new(&scene).unwrap_or_else(|error| panic!("{error}"));
        simulation.keep_ledger().unwrap();
        while !simulation.is_finished() {
            simulation.step().unwrap_or_else(|error| panic!("{error}"));
        }
        simulation
    }

    fn mean_height(simulation: &Simulation) -> f64 {
        simulation.positions().iter().map(|x| x[2]).sum::<f64>() / simulation.positions().len() as f64
    }

    #[test]
    fn springs_carry_the_weight_in_proportion_to_their_stiffness() {
        let weight = 0.2 * 0.3 * 0.3 * 9.81;
        let even = finished("[[pins]]\nall = true\nstiffness = 2.0\n");
        assert!((mean_height(&even) + weight / (16.0 * 2.0)).abs() < 1e-4, "{}", mean_height(&even));
        // Weights in proportion to the masses lower the sheet without deforming it.
        let all: Vec<usize> = (0..16).collect();
        let weights: Vec<f64> = even.masses().iter().map(|mass| mass / even.masses()[5]).collect();
        let text = format!("[[pins]]\nvertices = {all:?}\nweights = {weights:?}\nstiffness = 2.0\n");
        let level = finished(&text);
        let sag = -even.masses()[5] * 9.81 / 2.0;
        assert!(level.positions().iter().all(|x| (x[2] - sag).abs() < 1e-4), "{:?}", level.positions());
    }

    #[test]
    fn soft_pins_follow_an_obstacle_let_go_and_their_work_is_accounted_for() {
        let ball = "[[obstacles]]\nname = \"hand\"\nsphere = { centre = [5.0, 0.0, 0.0], radius = 0.1 }\n\
                    motion.keys = [{ translate = [1.0, 0.0, 0.0], time = 0.0 },\
                    { translate = [1.0, 0.0, 0.2], time = 0.5 }]\nmotion.interpolation = \"smoothstep\"\n";
        let pin = "[[pins]]\nall = true\nstiffness = 50.0\nobstacle = \"hand\"\n";
        let held = finished_by("implicit-midpoint", &format!("{ball}{pin}"));
        assert!((mean_height(&held) - 0.2).abs() < 5e-3, "{}", mean_height(&held));
        assert!(held.positions()[0][0] + 0.15 < 1e-3, "it stays where it is on the obstacle");
        let ledger = held.ledger().unwrap();
        let [first, last] = [&ledger.entries()[0], ledger.entries().last().unwrap()];
        let column = ledger.works().iter().position(|name| name == "pin 0").unwrap();
        let lifted = 0.2 * 0.3 * 0.3 * 9.81 * 0.2;
        assert!(last.work[column] > lifted, "{} J of {lifted}", last.work[column]);
        let unaccounted = last.unaccounted(first);
        assert!(unaccounted.abs() < 0.05 * last.work[column], "{unaccounted} J of {}", last.work[column]);
        let dropped = finished(&format!("{ball}{pin}release = 0.5\n"));
        assert!(mean_height(&dropped) < -0.2, "{}", mean_height(&dropped));
        let exact = finished(&format!("{ball}{}", pin.replace("stiffness = 50.0\n", "")));
        let far = exact.positions().iter().map(|x| norm(subtract([x[0], x[1], 0.2], *x))).fold(0.0, f64::max);
        assert!(far < 1e-12, "{far}");
        let scene = format!("{SHEET}{}", pin.replace("hand", "hnad"));
        let scene = Scene::parse(&scene, "sheet.toml".as_ref()).unwrap();
        let message = Simulation::new(&scene).unwrap_err().to_string();
        assert_eq!(message, "pins[0]: there is no obstacle called `hnad`; there are none");
    }
}
