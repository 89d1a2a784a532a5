//! A simulation that a program controls: state, pins, wind, obstacles and own forces change between steps.

use std::collections::BTreeMap;
use std::fmt;
use std::sync::{Arc, Mutex, PoisonError};

use energy_dsl::Vector3;
use energy_solve::{EvaluationError, State, Term, Touching};
use serde::{Deserialize, Serialize};

use super::island::Island;
use super::release::Extension;
use super::saved::{RestoreError, SavedState};
use super::{Simulation, SimulationError};
use crate::geometry::Pose;
use crate::model::Model;
use crate::motion::{SteeredPoses, Steering};
use crate::scene::Scene;
use crate::wind::SteeredVelocity;

/// A label of terms, and their forces on all vertices.
pub type LabelledForces = (String, Vec<Vector3<f64>>);

/// A force or an energy that a program adds to a scene.
pub trait OwnForce: Send + Sync {
    /// The elements of the scene that the force acts on.
    fn elements(&self) -> &OwnElements;
    /// Whether all elements must be in one term, because a function evaluates them together.
    fn is_whole(&self) -> bool {
        false
    }
    /// Creates the term of some of the elements, by their numbers. `vertices` are theirs, numbered within an island.
    fn term(&self, elements: &[usize], vertices: Vec<u32>) -> Box<dyn Term>;
}

/// The elements of an [`OwnForce`].
#[derive(Clone, Debug)]
pub struct OwnElements {
    /// Name of the force in the ledger and in messages.
    pub name: String,
    /// Vertices of one element.
    pub points: usize,
    /// The vertices of one element after the other, numbered through the scene.
    pub vertices: Vec<usize>,
}

/// Inputs of a simulation that a program controls.
#[derive(Clone, Default)]
pub struct Controls {
    /// Names of the obstacles that it moves, in place of their keys.
    pub obstacles: Vec<String>,
    /// Whether it sets the velocity of the wind.
    pub wind: bool,
    /// Its own forces and energies.
    pub forces: Vec<Arc<dyn OwnForce>>,
}

/// A control that does not fit the scene or the state.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
#[non_exhaustive]
pub enum ControlError {
    /// No obstacle that a program may move has this name.
    #[error(
        "there is no obstacle called `{name}` that a program may move; {}",
        if .known.is_empty() { "there are none".to_owned() } else { format!("there are {}", .known.join(", ")) }
    )]
    NoSuchObstacle { name: String, known: Vec<String> },
    /// The obstacle deforms.
    #[error("{name} follows the frames of its meshes; a program cannot move it")]
    Deforms { name: String },
    /// The scene has no wind.
    #[error("the scene has no wind; add `wind = {{ velocity = [0.0, 0.0, 0.0] }}`")]
    NoWind,
    /// The velocity of the wind is not controlled.
    #[error("the wind is that of the scene; say at the start that a program sets it")]
    WindOfScene,
    /// An element joins vertices that move on their own.
    #[error(
        "{name}: element {element} joins vertices {first} and {second}, which move on their own. Sew their garments, \
         or set `contact = \"on\"`"
    )]
    Apart { name: String, element: usize, first: usize, second: usize },
    /// A function evaluates elements that move on their own.
    #[error(
        "{name}: its elements act on garments that move on their own, but one function evaluates them together. Add \
         one for each garment, or set `contact = \"on\"`"
    )]
    Divided { name: String },
    /// The number of vectors is wrong.
    #[error("expected {expected} {what}, got {found}")]
    WrongCount { what: &'static str, expected: usize, found: usize },
    /// A number is not finite.
    #[error("{what}: entry {index} is not finite")]
    NotFinite { what: &'static str, index: usize },
    /// The vertex does not exist.
    #[error("there is no vertex {vertex}, only 0 to {}", .vertices.saturating_sub(1))]
    NoSuchVertex { vertex: usize, vertices: usize },
    /// The vertex is not pinned.
    #[error("vertex {vertex} is not pinned: only pinned vertices have targets")]
    NotPinned { vertex: usize },
    /// The positions cannot be those of cloth that collides.
    #[error("{count} edges would cross triangles at these positions, the first through triangle {first}")]
    Crossing { count: usize, first: usize },
    /// A vertex would be inside an obstacle.
    #[error("vertex {vertex} would be inside {obstacle} at these positions")]
    Inside { vertex: usize, obstacle: String },
    /// The state cannot be carried over to a changed scene.
    #[error("the changed scene has {what}; only parameters may change during a simulation")]
    OtherScene { what: &'static str },
}

/// Everything that the further motion of a controlled simulation depends on, except for the parameters of own forces.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Snapshot {
    state: SavedState,
    targets: Vec<(usize, Vector3<f64>)>,
    poses: Vec<SavedPoses>,
    wind: Option<Vector3<f64>>,
}

impl Snapshot {
    /// The state of the simulation.
    #[must_use]
    pub fn state(&self) -> &SavedState {
        &self.state
    }
}

/// The poses of a steered obstacle: times, rotations and translations.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct SavedPoses {
    times: [f64; 2],
    rotations: [[Vector3<f64>; 3]; 2],
    translations: [Vector3<f64>; 2],
}

impl From<SteeredPoses> for SavedPoses {
    fn from(SteeredPoses { start, from, end, to }: SteeredPoses) -> Self {
        let both = [from, to];
        Self {
            times: [start, end],
            rotations: both.map(|pose| pose.rows()),
            translations: both.map(|pose| pose.translation()),
        }
    }
}

impl SavedPoses {
    /// Returns the poses; the identity for rotations that were damaged.
    fn poses(&self) -> SteeredPoses {
        let pose = |at: usize| Pose::new(self.rotations[at], self.translations[at]).unwrap_or(Pose::IDENTITY);
        let [start, end] = self.times;
        SteeredPoses { start, from: pose(0), end, to: pose(1) }
    }
}

/// State of the inputs that a program controls in a running simulation.
#[derive(Clone, Default)]
pub(super) struct Controlled {
    /// The controls that the simulation was created with.
    pub(super) controls: Controls,
    /// Checksums of the masses before changes of the scene.
    pub(super) earlier_masses: Vec<u32>,
    /// Name and motion of each steered obstacle.
    obstacles: Vec<(String, Steering)>,
    wind: Option<SteeredVelocity>,
    /// Targets of pinned vertices, in m.
    targets: BTreeMap<usize, Vector3<f64>>,
}

impl fmt::Debug for Controlled {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { obstacles, wind, targets, .. } = self;
        let mut fields = f.debug_struct("Controlled");
        fields.field("obstacles", obstacles).field("wind", wind).field("targets", targets).finish_non_exhaustive()
    }
}

impl Simulation {
    /// Creates a simulation of a scene that a program controls.
    ///
    /// ```
    /// use cloth_core::Simulation;
    /// use cloth_core::simulation::Controls;
    /// # use cloth_scene::Scene;
    /// # let text = r#"
    /// # dt = 0.01
    /// # duration = 0.1
    /// # mesh.sheet = { cells = [4, 4], size = [1.0, 1.0] }
    /// # fabric = { density = 0.15, material.stvk = { stretch_stiffness = 50.0, poisson_ratio = 0.3 } }
    /// # pins = [{ vertex = 0 }]
    /// # "#;
    /// # let scene = Scene::parse(text, "scene.toml".as_ref())?;
    /// let mut simulation = Simulation::controlled(&scene, &Controls::default())?;
    /// let [x, y, z] = simulation.positions()[0];
    /// let start = simulation.snapshot();
    /// simulation.set_pin_targets(&[0], &[[x, y, z + 0.01]])?;
    /// simulation.step()?;
    /// assert!((simulation.positions()[0][2] - (z + 0.01)).abs() < 1e-12);
    /// simulation.return_to(&start)?;
    /// assert_eq!(simulation.positions()[0], [x, y, z]);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    ///
    /// # Errors
    /// Returns an error if [`Simulation::new`] would, or if a control does not fit the scene.
    pub fn controlled(scene: &Scene, controls: &Controls) -> Result<Self, SimulationError> {
        let mut scene = scene.clone();
        let mut controlled = Controlled { controls: controls.clone(), ..Controlled::default() };
        let named = |(number, one): (usize, &crate::scene::ObstacleDescription)| one.name(number);
        let known: Vec<String> = scene.obstacles.iter().enumerate().map(named).collect();
        for name in &controls.obstacles {
            let number = known.iter().position(|one| one == name);
            let missing = || ControlError::NoSuchObstacle { name: name.clone(), known: known.clone() };
            let obstacle = &mut scene.obstacles[number.ok_or_else(missing)?];
            if obstacle.deforms() {
                return Err(ControlError::Deforms { name: name.clone() }.into());
            }
            controlled.obstacles.push((name.clone(), obstacle.steered()));
        }
        if controls.wind {
            let wind = scene.wind.as_mut().ok_or(ControlError::NoWind)?;
            let velocity = SteeredVelocity::new(wind.velocity);
            wind.steering = Some(velocity.clone());
            controlled.wind = Some(velocity);
        }
        let failed: Arc<Mutex<Option<ControlError>>> = Arc::default();
        let (forces, refused) = (controls.forces.clone(), Arc::clone(&failed));
        let extension: Extension = Arc::new(move |model: &mut Model| {
            for force in &forces {
                if let Err(error) = add_force(model, &**force) {
                    *refused.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
                }
            }
        });
        let mut simulation = Self::extended(&scene, Some(&extension))?;
        if let Some(error) = failed.lock().unwrap_or_else(PoisonError::into_inner).take() {
            return Err(error.into());
        }
        simulation.controlled = controlled;
        Ok(simulation)
    }

    /// Sets the positions of all vertices, in m, between two steps. Plastic strains stay. Contact forgets how far pairs
    /// have slid, and integrators their history.
    ///
    /// # Errors
    /// Returns an error if the number is wrong, a number is not finite, or cloth that collides crosses itself or an
    /// obstacle. The state is then unchanged.
    pub fn set_positions(&mut self, x: &[Vector3<f64>]) -> Result<(), SimulationError> {
        check("positions", x, self.x.len())?;
        let before = self.save();
        self.jump(SavedState { x: x.to_vec(), ..before.clone() })?;
        if let Some(error) = self.impossible() {
            self.restore(before)?;
            return Err(error.into());
        }
        Ok(())
    }

    /// Sets the velocities of all vertices, in m/s, between two steps. Those of pinned vertices follow from their pins.
    ///
    /// # Errors
    /// Returns an error if the number is wrong, or a number is not finite.
    pub fn set_velocities(&mut self, v: &[Vector3<f64>]) -> Result<(), SimulationError> {
        check("velocities", v, self.v.len())?;
        let mut state = self.save();
        let free = v.iter().zip(&self.pinned).zip(&mut state.v);
        free.for_each(|((v, is_pinned), now)| *now = if *is_pinned { *now } else { *v });
        self.jump(state)
    }

    /// Goes on from a state that no step led to.
    fn jump(&mut self, mut state: SavedState) -> Result<(), SimulationError> {
        state.islands.iter_mut().for_each(super::SavedIsland::forget_motion);
        self.restore(state)?;
        let bodies = self.islands.iter().map(Island::body);
        self.ledger.iter_mut().try_for_each(|ledger| ledger.reopen(bodies.clone()))?;
        Ok(())
    }

    /// Returns why certified contact cannot start from the current positions.
    fn impossible(&self) -> Option<ControlError> {
        if !self.islands.iter().any(|island| island.body().system.has_contact()) {
            return None;
        }
        let crossings = if self.contact == crate::scene::ContactChoice::On { self.crossings() } else { Vec::new() };
        if let Some(first) = crossings.first() {
            let first = self.triangles.iter().position(|triangle| *triangle == first.triangle).unwrap_or_default();
            return Some(ControlError::Crossing { count: crossings.len(), first });
        }
        let time = self.time();
        self.obstacles.iter().find_map(|obstacle| {
            let solid = obstacle.at(time);
            let inside = |vertex: &usize| !self.pinned[*vertex] && solid.signed_distance(self.x[*vertex]) < 0.0;
            let vertex = (0..self.x.len()).find(inside)?;
            Some(ControlError::Inside { vertex, obstacle: obstacle.name.clone() })
        })
    }

    /// Sets where pinned vertices are at the end of the next step, in m, and from then on. They take precedence over
    /// the motion of a pin, until [`Simulation::release_pin_targets`].
    ///
    /// # Errors
    /// Returns an error if a vertex is not pinned, or the numbers do not fit.
    pub fn set_pin_targets(&mut self, vertices: &[usize], targets: &[Vector3<f64>]) -> Result<(), ControlError> {
        check("targets", targets, vertices.len())?;
        for &vertex in vertices {
            match self.pinned.get(vertex) {
                None => return Err(ControlError::NoSuchVertex { vertex, vertices: self.pinned.len() }),
                Some(false) => return Err(ControlError::NotPinned { vertex }),
                Some(true) => {}
            }
        }
        self.controlled.targets.extend(vertices.iter().copied().zip(targets.iter().copied()));
        self.hand_out_targets();
        Ok(())
    }

    /// Forgets all targets: pins stay where they are, or follow the motions of the scene.
    pub fn release_pin_targets(&mut self) {
        self.controlled.targets.clear();
        self.hand_out_targets();
    }

    /// The targets of pinned vertices, in m.
    pub fn pin_targets(&self) -> impl Iterator<Item = (usize, Vector3<f64>)> {
        self.controlled.targets.iter().map(|(vertex, target)| (*vertex, *target))
    }

    /// Passes the targets to the islands of their vertices, and wakes those.
    pub(super) fn hand_out_targets(&mut self) {
        let targets = &self.controlled.targets;
        self.islands.iter_mut().for_each(|island| island.set_targets(targets));
    }

    /// Sets the velocity of the wind in the next steps, in m/s. Gusts of the scene are added.
    ///
    /// # Errors
    /// Returns an error if the program does not control the wind, or a number is not finite.
    pub fn set_wind(&mut self, velocity: Vector3<f64>) -> Result<(), ControlError> {
        check("wind", &[velocity], 1)?;
        self.controlled.wind.as_ref().ok_or(ControlError::WindOfScene)?.set(velocity);
        self.islands.iter_mut().for_each(Island::wake);
        Ok(())
    }

    /// The velocity of the wind without gusts, in m/s; `None` if the program does not control it.
    #[must_use]
    pub fn wind(&self) -> Option<Vector3<f64>> {
        self.controlled.wind.as_ref().map(SteeredVelocity::get)
    }

    /// Moves an obstacle to a pose during the next step; there it stays. The pose maps the shape of the scene file.
    ///
    /// # Errors
    /// Returns an error if the program does not control an obstacle of this name.
    pub fn steer(&mut self, obstacle: &str, pose: Pose) -> Result<(), ControlError> {
        let (start, end) = (self.time(), (self.steps_done() + 1) as f64 * self.dt);
        self.steering(obstacle)?.steer(start, end, pose);
        self.islands.iter_mut().for_each(Island::wake);
        Ok(())
    }

    /// Returns the pose of an obstacle at the end of the next step, if nothing else is set.
    ///
    /// # Errors
    /// Returns an error if the program does not control an obstacle of this name.
    pub fn pose(&self, obstacle: &str) -> Result<Pose, ControlError> {
        Ok(self.steering(obstacle)?.poses().to)
    }

    /// The names of the obstacles that the program moves.
    pub fn steered(&self) -> impl Iterator<Item = &str> {
        self.controlled.obstacles.iter().map(|(name, _)| name.as_str())
    }

    fn steering(&self, name: &str) -> Result<&Steering, ControlError> {
        let known = || self.steered().map(str::to_owned).collect();
        let found = self.controlled.obstacles.iter().find(|(known, _)| known == name);
        let missing = || ControlError::NoSuchObstacle { name: name.to_owned(), known: known() };
        found.map(|(_, steering)| steering).ok_or_else(missing)
    }

    /// Returns everything that the further motion depends on, except for the parameters of own forces.
    #[must_use]
    pub fn snapshot(&self) -> Snapshot {
        Snapshot {
            state: self.save(),
            targets: self.pin_targets().collect(),
            poses: self.controlled.obstacles.iter().map(|(_, steering)| steering.poses().into()).collect(),
            wind: self.wind(),
        }
    }

    /// Goes on from a snapshot of a simulation of the same scene with the same controls, with the same bits.
    ///
    /// # Errors
    /// Returns an error if the snapshot is one of another scene. The obstacles may have moved then.
    pub fn return_to(&mut self, snapshot: &Snapshot) -> Result<(), RestoreError> {
        for ((_, steering), poses) in self.controlled.obstacles.iter().zip(&snapshot.poses) {
            steering.set_poses(poses.poses());
        }
        if let (Some(wind), Some(velocity)) = (&self.controlled.wind, snapshot.wind) {
            wind.set(velocity);
        }
        self.restore(snapshot.state.clone())?;
        self.controlled.targets = snapshot.targets.iter().copied().collect();
        self.hand_out_targets();
        Ok(())
    }

    /// Returns the forces of each label on all vertices at the current state, in N, without contact: label and forces.
    ///
    /// # Errors
    /// Returns an error if a term cannot be evaluated.
    pub fn term_forces(&mut self) -> Result<Vec<LabelledForces>, EvaluationError> {
        let names = self.labels.iter().map(|label| label.name.clone());
        let mut forces: Vec<_> = names.map(|name| (name, vec![[0.0; 3]; self.x.len()])).collect();
        for island in &self.islands {
            let body = island.body();
            let state = State { x: &body.x, v: &body.v };
            for ((term, _), &label) in body.system.terms().zip(island.labels()) {
                let mut own = vec![[0.0; 3]; body.x.len()];
                term.add_force(state, &mut own);
                for (&vertex, force) in island.vertices().iter().zip(&own) {
                    (0..3).for_each(|axis| forces[label].1[vertex][axis] += force[axis]);
                }
            }
        }
        Ok(forces)
    }

    /// Returns the pairs of features in certified contact at the end of the last step. Vertices are numbered through
    /// the scene; those of obstacles are `None`.
    #[must_use]
    pub fn contacts(&self) -> Vec<([Option<usize>; 4], Touching)> {
        let of_island = |island: &Island| -> Vec<_> {
            let named = |vertex: u32| island.vertices().get(vertex as usize).copied();
            let body = island.body();
            body.system.touching(&body.x).into_iter().map(|pair| (pair.vertices.map(named), pair)).collect()
        };
        self.islands.iter().flat_map(of_island).collect()
    }
}

/// Adds the elements of an own force to the islands of their vertices.
fn add_force(model: &mut Model, force: &dyn OwnForce) -> Result<(), ControlError> {
    let mut homes = vec![(0, 0_u32); model.x.len()];
    for (number, island) in model.islands.iter().enumerate() {
        let places = island.vertices.iter().enumerate();
        places.for_each(|(place, &vertex)| homes[vertex] = (number, energy_solve::index(place)));
    }
    let mut parts: BTreeMap<usize, (Vec<usize>, Vec<u32>)> = BTreeMap::new();
    for (element, stencil) in force.elements().vertices.chunks_exact(force.elements().points).enumerate() {
        if let Some(&vertex) = stencil.iter().find(|&&vertex| vertex >= homes.len()) {
            return Err(ControlError::NoSuchVertex { vertex, vertices: homes.len() });
        }
        let home = homes[stencil[0]].0;
        if let Some(&second) = stencil.iter().find(|&&vertex| homes[vertex].0 != home) {
            return Err(ControlError::Apart {
                name: force.elements().name.clone(),
                element,
                first: stencil[0],
                second,
            });
        }
        let (elements, vertices) = parts.entry(home).or_default();
        elements.push(element);
        vertices.extend(stencil.iter().map(|&vertex| homes[vertex].1));
    }
    if force.is_whole() && parts.len() > 1 {
        return Err(ControlError::Divided { name: force.elements().name.clone() });
    }
    for (island, (elements, vertices)) in parts {
        model.add_term(island, force.term(&elements, vertices));
    }
    Ok(())
}

fn check(what: &'static str, vectors: &[Vector3<f64>], expected: usize) -> Result<(), ControlError> {
    if vectors.len() != expected {
        return Err(ControlError::WrongCount { what, expected, found: vectors.len() });
    }
    match vectors.iter().position(|vector| vector.iter().any(|component| !component.is_finite())) {
        Some(index) => Err(ControlError::NotFinite { what, index }),
        None => Ok(()),
    }
}
