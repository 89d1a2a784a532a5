use energy_dsl::Vector3;

use super::colouring::{Colouring, upper_end};
use super::orbit::Orbit;
use super::picking::pick;
use super::stage::{Stage, ViewError};
use crate::contact::AnySolid;
use crate::geometry::norm;
use crate::output::SolidMesh;

/// A user input.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Input {
    /// The mouse moved to this position, in pixels from the upper left corner.
    Move([f64; 2]),
    /// A button was pressed. The left button takes hold of the vertex under the mouse, if possible, and otherwise
    /// rotates.
    Press(Button),
    /// The button was released.
    Release(Button),
    /// The wheel was turned by this many notches; positive away from the user.
    Scroll(f64),
    /// A key was pressed.
    Command(Command),
}

/// A mouse button.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Button {
    /// The left button.
    Left,
    /// The left button with the shift key, which never takes hold of a vertex.
    ShiftLeft,
    /// Any other button.
    Other,
}

/// The command of a key.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Command {
    /// Pause or resume.
    Toggle,
    /// Advance by one step or frame.
    Step,
    /// Go back by one frame.
    StepBack,
    /// Start again from time 0.
    Restart,
    /// Next colouring.
    Colours,
    /// Show or hide edges.
    Wireframe,
    /// Frame everything.
    Frame,
    /// Show or hide the list of keys.
    Help,
}

/// Description of keys and buttons, one per line.
pub const HELP: &str = "space: pause, resume\nright: one step or frame\nleft: one frame back, of a run\nr: restart\n\
c: colours plain, strain, energy, speed\nw: edges\nf: frame everything\nh: this help\n\
drag: hold a vertex; elsewhere, or with shift: rotate\ndrag with the right button: move\nwheel: zoom\nesc: close";

/// The state of the viewer, independent of the window: content, camera, and mouse.
#[derive(Debug)]
pub struct Viewer {
    stage: Stage,
    camera: Orbit,
    colouring: Colouring,
    wireframe: bool,
    help: bool,
    mouse: [f64; 2],
    drag: Drag,
    /// Upper end of the colour scale: the maximum since the last restart or change of colouring.
    most: f64,
    /// Message of the last failure.
    failure: Option<String>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Drag {
    Nothing,
    Turn,
    Shift,
    /// A vertex at this depth.
    Hold {
        vertex: usize,
        depth: f64,
    },
}

impl Viewer {
    /// Creates a viewer that frames the whole stage.
    #[must_use]
    pub fn new(stage: Stage, colouring: Colouring, wireframe: bool) -> Self {
        let camera = Orbit::framing(&extent(&stage));
        let (mouse, drag) = ([0.0; 2], Drag::Nothing);
        Self { stage, camera, colouring, wireframe, help: false, mouse, drag, most: 0.0, failure: None }
    }

    /// The scene or run that is shown.
    #[must_use]
    pub fn stage(&self) -> &Stage {
        &self.stage
    }

    /// The current camera.
    #[must_use]
    pub fn camera(&self) -> &Orbit {
        &self.camera
    }

    /// The current colouring.
    #[must_use]
    pub fn colouring(&self) -> Colouring {
        self.colouring
    }

    /// Whether edges are drawn.
    #[must_use]
    pub fn wireframe(&self) -> bool {
        self.wireframe
    }

    /// Returns the position of the held vertex and the target of the grip, in a window of this size.
    #[must_use]
    pub fn pull(&self, size: [f64; 2]) -> Option<[Vector3<f64>; 2]> {
        match self.drag {
            Drag::Hold { vertex, depth } => {
                Some([self.stage.positions()[vertex], self.camera.at_depth(self.mouse, depth, size)])
            }
            _ => None,
        }
    }

    /// Returns the quantity shown at each vertex, and the upper end of the colour scale.
    pub fn values(&mut self) -> (Vec<f64>, f64) {
        let values = self.stage.values(self.colouring);
        self.most = self.most.max(upper_end(&values));
        (values, self.most)
    }

    /// Advances time by `seconds`, until `is_late` returns `true`. A failure pauses, and is displayed.
    pub fn advance(&mut self, seconds: f64, is_late: impl FnMut() -> bool) {
        let advanced = self.stage.advance(seconds, is_late);
        self.note(advanced);
    }

    /// Handles an input, in a window of this size in pixels.
    pub fn handle(&mut self, input: Input, size: [f64; 2]) {
        match input {
            Input::Move(mouse) => {
                let moved = [mouse[0] - self.mouse[0], mouse[1] - self.mouse[1]];
                self.mouse = mouse;
                match self.drag {
                    Drag::Nothing => {}
                    Drag::Turn => self.camera.turn(moved, size[1]),
                    Drag::Shift => self.camera.shift(moved, size[1]),
                    Drag::Hold { vertex, depth } => {
                        self.stage.hold(vertex, self.camera.at_depth(mouse, depth, size));
                    }
                }
            }
            Input::Press(Button::Left) => self.drag = self.grab(size).unwrap_or(Drag::Turn),
            Input::Press(Button::ShiftLeft) => self.drag = Drag::Turn,
            Input::Press(Button::Other) => self.drag = Drag::Shift,
            Input::Release(_) => {
                self.drag = Drag::Nothing;
                self.stage.let_go();
            }
            Input::Scroll(notches) => self.camera.approach(notches),
            Input::Command(command) => self.execute(command),
        }
    }

    /// Returns the vertex under the mouse, if it can be held.
    fn grab(&mut self, size: [f64; 2]) -> Option<Drag> {
        let simulation = self.stage.simulation();
        let (triangles, strands) = (simulation.triangles(), simulation.strands());
        let picked = pick(&self.camera, self.mouse, size, self.stage.positions(), triangles, strands)?;
        let here = self.camera.at_depth(self.mouse, picked.depth, size);
        self.stage.hold(picked.vertex, here).then_some(Drag::Hold { vertex: picked.vertex, depth: picked.depth })
    }

    fn execute(&mut self, command: Command) {
        match command {
            Command::Toggle => self.stage.toggle(),
            Command::Step => {
                let stepped = self.stage.step();
                self.note(stepped);
            }
            Command::StepBack => self.stage.step_back(),
            Command::Restart => {
                (self.most, self.drag, self.failure) = (0.0, Drag::Nothing, None);
                let restarted = self.stage.restart();
                self.note(restarted);
            }
            Command::Colours => (self.colouring, self.most) = (self.colouring.next(), 0.0),
            Command::Wireframe => self.wireframe = !self.wireframe,
            Command::Frame => self.camera = Orbit::framing(&extent(&self.stage)),
            Command::Help => self.help = !self.help,
        }
    }

    fn note(&mut self, result: Result<(), ViewError>) {
        self.failure = result.err().map(|error| energy_cli::message(&error.into())).or(self.failure.take());
    }

    /// The text in the corner of the window.
    #[must_use]
    pub fn text(&self) -> String {
        let time = format!("t = {:.3} s", self.stage.time());
        let state = if self.stage.is_playing() { "" } else { ", paused" };
        let hint = if self.help { HELP } else { "h for help" };
        let failure = self.failure.as_ref().map(|text| format!("error: {text}\n")).unwrap_or_default();
        format!("{time}{state}\n{}\n{failure}{hint}", self.colouring.legend(self.most))
    }
}

/// Returns the points to frame at first: the cloth, the region below it where it may fall, and bounded solids.
fn extent(stage: &Stage) -> Vec<Vector3<f64>> {
    let solids = stage.simulation().obstacles().iter().map(|obstacle| obstacle.at(stage.time()));
    let bounded = solids.filter(|solid| !matches!(solid, AnySolid::HalfSpace(_)));
    let surfaces = bounded.flat_map(|solid| SolidMesh::of(&solid, [0.0; 3], 1.0).vertices);
    let mut points: Vec<Vector3<f64>> = stage.positions().to_vec();
    let gravity = stage.scene().gravity;
    if stage.is_live() && norm(gravity) > 0.0 {
        // Half the size of the cloth downwards.
        let fall = Orbit::framing(&points).radius() / norm(gravity);
        points.extend(
            stage.positions().iter().map(|p| -> Vector3<f64> { std::array::from_fn(|i| p[i] + fall * gravity[i]) }),
        );
    }
    points.extend(surfaces);
    points
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::subtract;
    use std::path::Path;

    const SIZE: [f64; 2] = [900.0, 700.0];
    const SCENE: &str = r#"
        dt = 0.01
        duration = 1.0
        integrator = "newton"
        [mesh.sheet]
        cells = [6, 6]
        size = [0.6, 0.6]
        [fabric]
        density = 0.2
        [fabric.material.stvk]
        stretch_stiffness = 40.0
        poisson_ratio = 0.3
        [[pins]]
        vertex = 0
        [[obstacles]]
        sphere = { radius = 0.1, centre = [0.0, 0.0, -0.3] }
        [[obstacles]]
        plane = { point = [0.0, 0.0, -9.0] }
    "#;

    fn viewer() -> Viewer {
        let folder = tempfile::TempDir::new().unwrap();
        let path = folder.path().join("scene.toml");
        std::fs::write(&path, SCENE).unwrap();
        Viewer::new(Stage::open(Path::new(&path)).unwrap(), Colouring::Plain, false)
    }

    #[test]
    fn a_vertex_is_dragged_while_the_button_is_down() {
        let mut viewer = viewer();
        let corner = 48;
        let start = viewer.stage.positions()[corner];
        // Towards the middle, on the outermost triangle.
        let seen = viewer.camera.project(start.map(|c| 0.98 * c), SIZE).unwrap().pixel;
        let camera = viewer.camera;
        viewer.handle(Input::Move(seen), SIZE);
        viewer.handle(Input::Press(Button::Left), SIZE);
        assert_eq!(viewer.stage.held(), Some(corner));
        viewer.handle(Input::Move([seen[0] + 60.0, seen[1] - 80.0]), SIZE);
        let [_, target] = viewer.pull(SIZE).unwrap();
        (0..100).for_each(|_| viewer.advance(0.01, || false));
        let apart = norm(subtract(viewer.stage.positions()[corner], target));
        assert!(apart < 0.03 && norm(subtract(start, target)) > 0.05, "{apart}");
        assert_eq!(viewer.camera, camera, "the view stays");
        viewer.handle(Input::Release(Button::Left), SIZE);
        assert!(viewer.stage.held().is_none() && viewer.pull(SIZE).is_none());
        (0..20).for_each(|_| viewer.advance(0.01, || false));
        assert!(norm(subtract(viewer.stage.positions()[corner], target)) > 0.1, "it falls");
    }

    #[test]
    fn dragging_elsewhere_moves_the_camera() {
        let mut viewer = viewer();
        let before = viewer.camera;
        viewer.handle(Input::Move([2.0, 2.0]), SIZE);
        viewer.handle(Input::Press(Button::Left), SIZE);
        viewer.handle(Input::Move([42.0, 2.0]), SIZE);
        assert!(viewer.camera.azimuth < before.azimuth && viewer.camera.target == before.target);
        viewer.handle(Input::Release(Button::Left), SIZE);
        let turned = viewer.camera;
        viewer.handle(Input::Move([2.0, 2.0]), SIZE);
        assert_eq!(viewer.camera, turned);
        viewer.handle(Input::Press(Button::Other), SIZE);
        viewer.handle(Input::Move([42.0, 2.0]), SIZE);
        assert!(viewer.camera.azimuth == turned.azimuth && viewer.camera.target != turned.target);
        viewer.handle(Input::Release(Button::Other), SIZE);
        viewer.handle(Input::Scroll(1.0), SIZE);
        assert!(viewer.camera.distance < turned.distance);
        viewer.handle(Input::Command(Command::Frame), SIZE);
        assert_eq!(viewer.camera, before);
        // With shift, a drag on the cloth rotates as well.
        let seen = viewer.camera.project([0.1, 0.1, 0.0], SIZE).unwrap().pixel;
        viewer.handle(Input::Move(seen), SIZE);
        viewer.handle(Input::Press(Button::ShiftLeft), SIZE);
        assert_eq!((viewer.stage.held(), viewer.drag), (None, Drag::Turn));
    }

    #[test]
    fn keys_work_as_the_help_says() {
        let mut viewer = viewer();
        let mut press = |command| {
            viewer.handle(Input::Command(command), SIZE);
            viewer.text()
        };
        assert!(press(Command::Toggle).starts_with("t = 0.000 s, paused\nplain\nh for help"));
        assert!(press(Command::Step).starts_with("t = 0.010 s, paused"));
        assert!(press(Command::Colours).contains("strain from 0 to"));
        assert!(press(Command::Help).ends_with(HELP));
        assert!(press(Command::Restart).starts_with("t = 0.000 s, paused"));
        press(Command::Wireframe);
        assert!(viewer.wireframe());
        (0..10).for_each(|_| viewer.handle(Input::Command(Command::Step), SIZE));
        let (strains, most) = viewer.values();
        assert!(strains.len() == 49 && most > 0.0);
    }
}
