use std::path::Path;
use std::sync::Arc;

use energy_dsl::Vector3;

use super::colouring::{Colouring, RestShape, stored_energies};
use super::grip::Grip;
use crate::geometry::{norm, subtract};
use crate::model::{Model, ModelError};
use crate::run::{FrameError, Record, RecordError, read_frame};
use crate::scene::{Scene, SceneError};
use crate::simulation::{Extension, Simulation, SimulationError};

/// A scene or run that cannot be viewed.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ViewError {
    /// The scene file is invalid.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// The parts of the scene do not fit together.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// The simulation cannot be set up, or a step failed.
    #[error(transparent)]
    Simulation(#[from] SimulationError),
    /// The record of the run cannot be read.
    #[error(transparent)]
    Record(#[from] RecordError),
    /// A frame cannot be read.
    #[error(transparent)]
    Frame(#[from] FrameError),
    /// The requested frame or time is not part of the run.
    #[error("the run has frames 0 to {last}, up to {end:.4} s; {asked} is not among them")]
    NoSuchFrame {
        /// The requested frame or time.
        asked: String,
        /// Index of the last frame.
        last: usize,
        /// Time of the last frame, in s.
        end: f64,
    },
    /// The picture cannot be initial.
    #[error(transparent)]
    Picture(#[from] crate::output::PictureError),
}

/// A moment of a scene or run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Moment {
    /// A frame, counted from 0.
    Frame(usize),
    /// A time, in s: shows the last frame or step up to it.
    Time(f64),
    /// The last frame of a run, or the end of a scene.
    End,
}

/// The content of a view: a scene that is simulated live, or the frames of a finished run.
#[derive(Debug)]
pub struct Stage {
    scene: Scene,
    simulation: Simulation,
    rest: RestShape,
    act: Act,
    playing: bool,
    /// Elapsed time that has not been shown yet, in s.
    due: f64,
}

#[derive(Debug)]
enum Act {
    Live { grip: Grip },
    Recorded { frames: Vec<Vec<Vector3<f64>>>, now: usize },
}

impl Stage {
    /// Opens a scene file, to simulate it live, or the folder of a finished run, to play it. Starts playing.
    ///
    /// # Errors
    /// Returns an error if the scene is invalid, or the folder does not hold a finished run with frames.
    pub fn open(path: &Path) -> Result<Self, ViewError> {
        if path.is_dir() { Self::recorded(path) } else { Self::live(Scene::read(path)?) }
    }

    fn live(scene: Scene) -> Result<Self, ViewError> {
        let grip = Grip::carrying(&Model::new(&scene)?.masses);
        let extension: Extension = {
            let grip = grip.clone();
            Arc::new(move |model: &mut Model| {
                let label = model.labels.len();
                model.islands.iter_mut().for_each(|island| grip.add_to(island, label));
                model.labels.push(Grip::label());
            })
        };
        let simulation = Simulation::extended(&scene, Some(&extension))?;
        let rest = RestShape::of(&simulation);
        Ok(Self { scene, simulation, rest, act: Act::Live { grip }, playing: true, due: 0.0 })
    }

    fn recorded(folder: &Path) -> Result<Self, ViewError> {
        let record = Record::read(folder)?;
        let scene = Scene::parse(&record.scene, &record.path)?;
        let simulation = Simulation::new(&scene)?;
        let vertices = simulation.positions().len();
        let frames = (0..record.frames).map(|number| read_frame(folder, number, vertices));
        let frames = frames.collect::<Result<Vec<_>, _>>()?;
        let rest = RestShape::of(&simulation);
        Ok(Self { scene, simulation, rest, act: Act::Recorded { frames, now: 0 }, playing: true, due: 0.0 })
    }

    /// The scene that is shown.
    #[must_use]
    pub fn scene(&self) -> &Scene {
        &self.scene
    }

    /// The simulation; for a recorded run, at its start.
    #[must_use]
    pub fn simulation(&self) -> &Simulation {
        &self.simulation
    }

    /// Whether the scene is simulated live.
    #[must_use]
    pub fn is_live(&self) -> bool {
        matches!(self.act, Act::Live { .. })
    }

    /// Time of the current content, in s.
    #[must_use]
    pub fn time(&self) -> f64 {
        match &self.act {
            Act::Live { .. } => self.simulation.time(),
            Act::Recorded { now, .. } => self.scene.time_grid().frame_time(*now),
        }
    }

    /// Time between frames, in s.
    #[must_use]
    pub fn frame_time(&self) -> f64 {
        1.0 / self.scene.time_grid().frames_per_second
    }

    /// Time between updates, in s: a step of a scene, a frame of a run.
    fn interval(&self) -> f64 {
        if self.is_live() { self.scene.time_grid().step } else { self.frame_time() }
    }

    /// Current positions of the vertices, in m.
    #[must_use]
    pub fn positions(&self) -> &[Vector3<f64>] {
        match &self.act {
            Act::Live { .. } => self.simulation.positions(),
            Act::Recorded { frames, now } => frames.get(*now).map_or(self.simulation.positions(), Vec::as_slice),
        }
    }

    /// Returns the quantity shown at each vertex; 0 for plain colours.
    #[must_use]
    pub fn values(&self, colouring: Colouring) -> Vec<f64> {
        let x = self.positions();
        match colouring {
            Colouring::Plain => vec![0.0; x.len()],
            Colouring::Strain => self.rest.strains(x),
            Colouring::Energy => stored_energies(&self.simulation, x),
            Colouring::Contact => match &self.act {
                Act::Recorded { .. } => vec![0.0; x.len()],
                Act::Live { .. } => self.simulation.contact_forces().into_iter().map(norm).collect(),
            },
            Colouring::Speed => match &self.act {
                Act::Recorded { frames, now } if *now > 0 => {
                    let moved = frames[*now - 1].iter().zip(x).map(|(before, after)| norm(subtract(*after, *before)));
                    moved.map(|offset| offset / self.frame_time()).collect()
                }
                _ => self.simulation.velocities().iter().map(|&v| norm(v)).collect(),
            },
        }
    }

    /// Whether time advances.
    #[must_use]
    pub fn is_playing(&self) -> bool {
        self.playing
    }

    /// Pauses or resumes.
    pub fn toggle(&mut self) {
        self.playing = !self.playing;
        self.due = 0.0;
    }

    /// Starts again from time 0.
    ///
    /// # Errors
    /// Returns an error if the scene has become invalid, because one of its files changed.
    pub fn restart(&mut self) -> Result<(), ViewError> {
        let playing = self.playing;
        match &mut self.act {
            Act::Live { .. } => *self = Self::live(self.scene.clone())?,
            Act::Recorded { now, .. } => *now = 0,
        }
        (self.playing, self.due) = (playing, 0.0);
        Ok(())
    }

    /// Advances by one step, or one frame of a run, and pauses. Does nothing at the end of a run.
    ///
    /// # Errors
    /// Returns an error if the step fails; the state is then unchanged.
    pub fn step(&mut self) -> Result<(), ViewError> {
        self.playing = false;
        self.forward()
    }

    /// Goes back by one frame of a run. A live scene cannot go back.
    pub fn step_back(&mut self) {
        self.playing = false;
        if let Act::Recorded { now, .. } = &mut self.act {
            *now = now.saturating_sub(1);
        }
    }

    fn forward(&mut self) -> Result<(), ViewError> {
        match &mut self.act {
            Act::Live { .. } => self.simulation.step().map(|_| ()).map_err(|error| {
                // A step that failed once would fail again.
                self.playing = false;
                error.into()
            }),
            Act::Recorded { frames, now } => {
                *now = (*now + 1).min(frames.len().saturating_sub(1));
                Ok(())
            }
        }
    }

    /// Advances time by `seconds`, with as many steps or frames as are due. Once `is_late` returns `true`, drops the
    /// rest, so that the motion is slower than real time. A run restarts after its end.
    ///
    /// # Errors
    /// Returns an error if a step fails, and pauses.
    pub fn advance(&mut self, seconds: f64, mut is_late: impl FnMut() -> bool) -> Result<(), ViewError> {
        if !self.playing {
            return Ok(());
        }
        self.due += seconds;
        let interval = self.interval();
        while self.due >= interval {
            self.due -= interval;
            match &mut self.act {
                Act::Recorded { frames, now } if *now + 1 >= frames.len() => *now = 0,
                _ => self.forward()?,
            }
            if is_late() {
                self.due = 0.0;
            }
        }
        Ok(())
    }

    /// Goes to a moment without showing those before it, and pauses. Calls `on_step` after each step.
    ///
    /// # Errors
    /// Returns an error if a step fails, or the run has no such frame.
    pub fn go_to(&mut self, moment: Moment, mut on_step: impl FnMut()) -> Result<(), ViewError> {
        self.playing = false;
        let rounded = |time: f64, interval: f64| (time / interval + 1e-9).floor().max(0.0);
        let frame_time = self.frame_time();
        if let Act::Recorded { frames, now } = &mut self.act {
            let last = frames.len().saturating_sub(1);
            let (frame, asked) = match moment {
                Moment::Frame(frame) => (frame, format!("frame {frame}")),
                Moment::Time(time) => (rounded(time, frame_time) as usize, format!("{time} s")),
                Moment::End => (last, String::new()),
            };
            if frame > last {
                return Err(ViewError::NoSuchFrame { asked, last, end: last as f64 * frame_time });
            }
            *now = frame;
            return Ok(());
        }
        let steps = match moment {
            Moment::Frame(frame) => frame as u64 * self.scene.time_grid().steps_per_frame,
            Moment::Time(time) => rounded(time, self.scene.time_grid().step) as u64,
            Moment::End => self.scene.steps(),
        };
        while self.simulation.steps_done() < steps {
            self.simulation.step()?;
            on_step();
        }
        Ok(())
    }

    /// Pulls a vertex to a point, in m, by a soft spring. Returns whether that is possible: the scene is live and the
    /// vertex is not pinned.
    pub fn hold(&mut self, vertex: usize, target: Vector3<f64>) -> bool {
        match &self.act {
            Act::Live { grip } if !self.simulation.is_pinned(vertex) => {
                grip.hold(vertex, target);
                self.simulation.wake(vertex);
                true
            }
            _ => false,
        }
    }

    /// The vertex that is held; `None` if none is.
    #[must_use]
    pub fn held(&self) -> Option<usize> {
        match &self.act {
            Act::Live { grip } => grip.vertex(),
            Act::Recorded { .. } => None,
        }
    }

    /// Releases the vertex.
    pub fn let_go(&mut self) {
        if let (Act::Live { grip }, Some(vertex)) = (&self.act, self.held()) {
            grip.release();
            self.simulation.wake(vertex);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SCENE: &str = r#"
        dt = 0.01
        duration = 0.2
        frames_per_second = 50
        integrator = "newton"
        [mesh.sheet]
        cells = [4, 4]
        size = [0.4, 0.4]
        [fabric]
        density = 0.2
        [fabric.material.stvk]
        stretch_stiffness = 40.0
        poisson_ratio = 0.3
        [[pins]]
        vertex = 0
    "#;

    fn stage() -> Stage {
        Stage::live(Scene::parse(SCENE, "s.toml".as_ref()).unwrap()).unwrap()
    }

    #[test]
    fn time_advances_while_playing_and_drops_late_steps() {
        let mut stage = stage();
        stage.advance(0.035, || false).unwrap();
        assert_eq!(stage.simulation.steps_done(), 3);
        stage.advance(0.006, || false).unwrap();
        assert_eq!(stage.simulation.steps_done(), 4, "what was left over counts");
        stage.advance(10.0, || true).unwrap();
        assert_eq!(stage.simulation.steps_done(), 5, "one step when there is no time");
        stage.toggle();
        stage.advance(1.0, || false).unwrap();
        assert_eq!(stage.simulation.steps_done(), 5);
        stage.step().unwrap();
        assert!((stage.time() - 0.06).abs() < 1e-12 && !stage.is_playing());
        stage.step_back();
        assert_eq!(stage.simulation.steps_done(), 6);
        stage.restart().unwrap();
        assert!(stage.time() == 0.0 && !stage.is_playing());
    }

    #[test]
    fn a_held_vertex_follows_the_mouse_and_falls_when_released() {
        let mut stage = stage();
        let target = [0.15, 0.15, 0.1];
        assert!(stage.hold(24, target) && stage.held() == Some(24));
        stage.go_to(Moment::Time(1.0), || ()).unwrap();
        let apart = norm(subtract(stage.positions()[24], target));
        assert!(apart < 0.02, "{apart}");
        stage.let_go();
        assert_eq!(stage.held(), None);
        stage.go_to(Moment::Time(1.2), || ()).unwrap();
        assert!(stage.positions()[24][2] < 0.05, "{:?}", stage.positions()[24]);
        assert!(!stage.hold(0, target), "a pinned vertex stays");
        assert_eq!(stage.held(), None);
    }

    #[test]
    fn without_a_grip_the_stage_moves_like_a_run() {
        let (mut stage, scene) = (stage(), Scene::parse(SCENE, "s.toml".as_ref()).unwrap());
        let mut plain = Simulation::new(&scene).unwrap();
        stage.go_to(Moment::End, || ()).unwrap();
        while !plain.is_finished() {
            plain.step().unwrap();
        }
        assert_eq!(stage.positions(), plain.positions());
        let (strains, speeds) = (stage.values(Colouring::Strain), stage.values(Colouring::Speed));
        assert!(strains.iter().all(|strain| *strain >= 0.0) && strains.iter().any(|strain| *strain > 1e-6));
        assert!(speeds[0] == 0.0 && speeds[24] > 0.1);
        assert!(stage.values(Colouring::Energy).iter().any(|energy| *energy > 0.0));
    }

    #[test]
    fn a_run_is_played_from_its_frames() {
        let folder = tempfile::TempDir::new().unwrap();
        let options = crate::run::RunOptions::default();
        let mut run = crate::run::Run::new(SCENE.to_owned(), "s.toml".as_ref(), folder.path(), options).unwrap();
        run.go(&std::sync::atomic::AtomicBool::new(false), |_| ()).unwrap();
        let mut stage = Stage::open(folder.path()).unwrap();
        assert!(!stage.is_live() && stage.time() == 0.0 && !stage.hold(24, [0.0; 3]));
        stage.advance(0.05, || false).unwrap();
        assert!((stage.time() - 0.04).abs() < 1e-12);
        stage.go_to(Moment::End, || ()).unwrap();
        let apart = subtract(stage.positions()[24], run.simulation().positions()[24]);
        assert!(norm(apart) < 1e-8 && (stage.time() - 0.2).abs() < 1e-12);
        let (shown, exact) = (stage.values(Colouring::Speed)[24], norm(run.simulation().velocities()[24]));
        assert!((shown / exact - 1.0).abs() < 0.1, "{shown} {exact}");
        stage.step().unwrap();
        assert!((stage.time() - 0.2).abs() < 1e-12, "stays at the end");
        stage.step_back();
        assert!((stage.time() - 0.18).abs() < 1e-12);
        stage.toggle();
        stage.advance(0.041, || false).unwrap();
        assert_eq!(stage.time(), 0.0, "begins again");
        let message = stage.go_to(Moment::Frame(11), || ()).unwrap_err().to_string();
        assert!(message.contains("frames 0 to 10, up to 0.2000 s; frame 11 is not"), "{message}");
        stage.go_to(Moment::Time(0.05), || ()).unwrap();
        assert!((stage.time() - 0.04).abs() < 1e-12);

        let frame = folder.path().join("frames/cloth_0003.obj");
        std::fs::write(&frame, "v 0 0 0\nv 1 0\n").unwrap();
        let message = Stage::open(folder.path()).unwrap_err().to_string();
        assert!(message.contains("it has 1 vertices, the scene 25"), "{message}");
        std::fs::remove_file(&frame).unwrap();
        assert!(Stage::open(folder.path()).unwrap_err().to_string().contains("output.obj"));
        assert!(Stage::open(&folder.path().join("frames")).unwrap_err().to_string().contains("finished run?"));
    }
}
