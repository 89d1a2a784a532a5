//! The window: translates events for the [`Viewer`], and draws its triangles.

use std::collections::BTreeSet;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use cloth_core::output::{SolidMesh, vertex_normals};
use cloth_core::view::{Button, Colouring, Command, Input, Orbit, Stage, ViewError, Viewer, colour};
use energy_dsl::Vector3;
use kiss3d::glamx::glam::camera::rh::proj::opengl;
use kiss3d::glamx::{Mat4, Pose3, Vec2, Vec3};
use kiss3d::prelude::{
    Action, Camera3d, Canvas, Color, Font, GpuMesh3d, Key, Light, Modifiers, MouseButton, Rc, RefCell, SceneNode3d,
    Texture, TextureManager, Window, WindowEvent,
};

/// A window that cannot be opened.
#[derive(Debug, thiserror::Error)]
pub(crate) enum WindowError {
    /// The scene or run cannot be opened.
    #[error(transparent)]
    View(#[from] ViewError),
    /// No display is available.
    #[error(
        "there is no display to open a window on: set DISPLAY or WAYLAND_DISPLAY, \
         or write a picture with `cloth view … --screenshot FILE.png`"
    )]
    NoDisplay,
    /// The rendering engine cannot open a window.
    #[error("cannot open a window: {reason}; write a picture with `cloth view … --screenshot FILE.png`")]
    NoWindow {
        /// Message of the engine.
        reason: String,
    },
}

/// Time for steps between two pictures.
const PATIENCE: Duration = Duration::from_millis(25);
const BACKGROUND: Color = Color::new(0.93, 0.93, 0.94, 1.0);
const INK: Color = Color::new(0.08, 0.09, 0.11, 1.0);
const FRONT: Color = Color::new(0.33, 0.57, 0.78, 1.0);
const BACK: Color = Color::new(0.86, 0.55, 0.36, 1.0);
const SOLID: Color = Color::new(0.74, 0.71, 0.66, 1.0);
const HAIR: Color = Color::new(0.45, 0.26, 0.13, 1.0);

/// Opens a scene or a finished run in a window, and returns once the window is closed.
///
/// # Errors
/// Returns an error if the scene or run cannot be opened, or no display is available.
pub(crate) fn open_window(path: &Path, colouring: Colouring, wireframe: bool) -> Result<(), WindowError> {
    let viewer = Viewer::new(Stage::open(path)?, colouring, wireframe);
    let is_there = |name: &str| std::env::var_os(name).is_some_and(|value| !value.is_empty());
    if cfg!(target_os = "linux") && !is_there("DISPLAY") && !is_there("WAYLAND_DISPLAY") {
        return Err(WindowError::NoDisplay);
    }
    let window = window(&format!("cloth: {}", path.display()))?;
    kiss3d::pollster::block_on(show(viewer, window));
    Ok(())
}

/// Opens a window. The engine panics if it cannot reach a display or has no graphics device; this is turned into an
/// error.
fn window(title: &str) -> Result<Window, WindowError> {
    let hook = std::panic::take_hook();
    std::panic::set_hook(Box::new(|_| ()));
    let opened = std::panic::catch_unwind(|| kiss3d::pollster::block_on(Window::new_with_size(title, 1200, 900)));
    std::panic::set_hook(hook);
    opened.map_err(|panic| {
        let text = panic.downcast_ref::<String>().map(String::as_str).or_else(|| panic.downcast_ref::<&str>().copied());
        WindowError::NoWindow { reason: text.unwrap_or("the engine gives no reason").to_owned() }
    })
}

async fn show(mut viewer: Viewer, mut window: Window) {
    window.set_background_color(BACKGROUND);
    window.set_ambient(0.35);
    window.rebind_close_key(Some(Key::Escape));
    let mut models = Models::new(&viewer);
    let font = Font::default();
    let mut drawn = Instant::now();
    loop {
        let size = [f64::from(window.width()), f64::from(window.height())];
        for mut event in window.events().iter() {
            if let Some(input) = input(event.value) {
                event.inhibited = true;
                viewer.handle(input, size);
            }
        }
        let (seconds, started) = (drawn.elapsed().as_secs_f64(), Instant::now());
        drawn = started;
        viewer.advance(seconds.min(0.1), || started.elapsed() > PATIENCE);
        models.draw(&mut viewer, &mut window);
        if let Some([from, to]) = viewer.pull(size) {
            window.draw_line(single(from), single(to), INK, 2.0, false);
        }
        window.draw_text(&viewer.text(), Vec2::new(16.0, 12.0), 28.0, &font, INK);
        let mut camera = Eye { orbit: *viewer.camera(), size };
        if !window.render_3d(&mut models.scene, &mut camera).await {
            return;
        }
    }
}

/// Translates an event; `None` if it does not concern the viewer.
fn input(event: WindowEvent) -> Option<Input> {
    Some(match event {
        WindowEvent::CursorPos(x, y, _) => Input::Move([x, y]),
        WindowEvent::Scroll(_, notches, _) => Input::Scroll(notches.clamp(-5.0, 5.0)),
        WindowEvent::MouseButton(button, action, modifiers) => {
            let button = match button {
                MouseButton::Button1 if modifiers.contains(Modifiers::Shift) => Button::ShiftLeft,
                MouseButton::Button1 => Button::Left,
                _ => Button::Other,
            };
            if action == Action::Press { Input::Press(button) } else { Input::Release(button) }
        }
        WindowEvent::Key(key, Action::Press, _) => Input::Command(match key {
            Key::Space => Command::Toggle,
            Key::Right => Command::Step,
            Key::Left => Command::StepBack,
            Key::R => Command::Restart,
            Key::C => Command::Colours,
            Key::W => Command::Wireframe,
            Key::F => Command::Frame,
            Key::H => Command::Help,
            _ => return None,
        }),
        _ => return None,
    })
}

fn single(point: Vector3<f64>) -> Vec3 {
    Vec3::new(point[0] as f32, point[1] as f32, point[2] as f32)
}

/// The models to draw: the two sides of the cloth, each with its colour and normals, and the solids.
struct Models {
    scene: SceneNode3d,
    sides: [SceneNode3d; 2],
    solids: Vec<SceneNode3d>,
    /// Edges of the triangles, without duplicates.
    edges: Vec<[usize; 2]>,
    /// Centre of everything at the start, and side of the visible part of a plane, in m.
    middle: Vector3<f64>,
    size: f64,
    /// A white texture, and the colour scale from 0 to 1.
    white: Arc<Texture>,
    scale: Arc<Texture>,
}

impl Models {
    fn new(viewer: &Viewer) -> Self {
        let mut scene = SceneNode3d::empty();
        scene.add_light(Light::directional(Vec3::new(0.25, 0.45, -1.0)).with_intensity(2.0));
        scene.add_light(Light::directional(Vec3::new(-0.3, 0.8, 0.1)).with_intensity(0.8));
        let white = TextureManager::get_global_manager(|textures| textures.get_default());
        let scale = TextureManager::get_global_manager(|textures| {
            textures.set_generate_mipmaps(false);
            textures.add_image_from_memory(&scale_png(), "scale")
        });
        let positions: Vec<Vec3> = viewer.stage().positions().iter().map(|&x| single(x)).collect();
        let faces =
            |turned: bool| viewer.stage().simulation().triangles().iter().map(move |&corners| face(corners, turned));
        let sides = [false, true].map(|turned| {
            let mesh = GpuMesh3d::new(positions.clone(), faces(turned).collect(), None, None, true);
            let mut side = scene.add_mesh(Rc::new(RefCell::new(mesh)), Vec3::ONE);
            side.enable_backface_culling(true).set_roughness(0.9)
        });
        let (middle, size) = (viewer.camera().target, 0.9 * viewer.camera().distance);
        let surfaces: Vec<SolidMesh> = surfaces(viewer, middle, size);
        let solids = surfaces.iter().map(|surface| {
            let points = surface.vertices.iter().map(|&x| single(x)).collect();
            let faces = surface.triangles.iter().map(|&corners| face(corners, false)).collect();
            let mut solid =
                scene.add_mesh(Rc::new(RefCell::new(GpuMesh3d::new(points, faces, None, None, true))), Vec3::ONE);
            solid.set_color(SOLID).enable_backface_culling(false).set_roughness(0.9)
        });
        let solids = solids.collect();
        let sides_of = |&[a, b, c]: &[usize; 3]| [[a, b], [b, c], [c, a]].map(|[p, q]| [p.min(q), p.max(q)]);
        let edges: BTreeSet<[usize; 2]> = viewer.stage().simulation().triangles().iter().flat_map(sides_of).collect();
        Self { scene, sides, solids, edges: edges.into_iter().collect(), middle, size, white, scale }
    }

    fn draw(&mut self, viewer: &mut Viewer, window: &mut Window) {
        let (values, most) = viewer.values();
        let (stage, plain) = (viewer.stage(), viewer.colouring() == Colouring::Plain);
        let (positions, simulation) = (stage.positions(), stage.simulation());
        let part = |value: f64| if most > 0.0 { (value / most).clamp(0.0, 1.0) as f32 } else { 0.0 };
        let normals = vertex_normals(positions, simulation.triangles());
        for (number, side) in self.sides.iter_mut().enumerate() {
            let sign = if number == 0 { 1.0 } else { -1.0 };
            fill(side, positions, normals.iter().map(|normal| normal.map(|component| sign * component)));
            side.modify_uvs(&mut |uvs| {
                uvs.clear();
                uvs.extend(values.iter().map(|&value| Vec2::new(part(value), 0.5)));
            });
            let (texture, colour) = match (plain, number) {
                (true, 0) => (&self.white, FRONT),
                (true, _) => (&self.white, BACK),
                (false, _) => (&self.scale, Color::new(1.0, 1.0, 1.0, 1.0)),
            };
            side.set_texture(texture.clone()).set_color(colour);
        }
        if viewer.wireframe() {
            // Slightly nearer to the eye, so that edges lie on top.
            let eye = single(viewer.camera().eye());
            let corner = |vertex: usize| single(positions[vertex]).lerp(eye, 1e-3);
            for &[from, to] in &self.edges {
                window.draw_line(corner(from), corner(to), INK, 1.0, false);
            }
        }
        for (solid, surface) in self.solids.iter_mut().zip(surfaces(viewer, self.middle, self.size)) {
            fill(solid, &surface.vertices, vertex_normals(&surface.vertices, &surface.triangles).into_iter());
        }
        for end in simulation.strands().iter().flat_map(|strand| strand.clone().skip(1)) {
            let [red, green, blue] = colour(values[end], most);
            let shade = if plain { HAIR } else { Color::new(red, green, blue, 1.0) };
            window.draw_line(single(positions[end - 1]), single(positions[end]), shade, 1.5, false);
        }
    }
}

/// Returns the surfaces of the solids at the current time.
fn surfaces(viewer: &Viewer, middle: Vector3<f64>, size: f64) -> Vec<SolidMesh> {
    let obstacles = viewer.stage().simulation().obstacles().iter();
    obstacles.map(|obstacle| SolidMesh::of(&obstacle.at(viewer.stage().time()), middle, size)).collect()
}

/// Sets the positions and normals of a mesh.
fn fill(node: &mut SceneNode3d, positions: &[Vector3<f64>], normals: impl Iterator<Item = Vector3<f64>> + Clone) {
    node.modify_vertices(&mut |all| {
        all.clear();
        all.extend(positions.iter().map(|&x| single(x)));
    });
    node.modify_normals(&mut |all| {
        all.clear();
        all.extend(normals.clone().map(single));
    });
}

fn face([a, b, c]: [usize; 3], turned: bool) -> [u32; 3] {
    let [a, b, c] = [a as u32, b as u32, c as u32];
    if turned { [a, c, b] } else { [a, b, c] }
}

/// Returns the colour scale from 0 to 1, left to right, as PNG.
fn scale_png() -> Vec<u8> {
    let colours = (0..256).flat_map(|step| {
        let [red, green, blue] = colour(f64::from(step), 255.0).map(|channel| (255.0 * channel).round() as u8);
        [red, green, blue, 255]
    });
    let size = tiny_skia::IntSize::from_wh(256, 1);
    let pixels = size.and_then(|size| tiny_skia::Pixmap::from_vec(colours.collect(), size));
    pixels.and_then(|pixels| pixels.encode_png().ok()).expect("256 pixels can be encoded")
}

/// The camera, as the engine's trait requires it.
struct Eye {
    orbit: Orbit,
    size: [f64; 2],
}

impl Eye {
    fn projection(&self) -> Mat4 {
        let (near, far) = self.clip_planes();
        let aspect = (self.size[0] / self.size[1]) as f32;
        opengl::perspective(Orbit::FIELD_OF_VIEW as f32, aspect, near, far)
    }
}

impl Camera3d for Eye {
    fn handle_event(&mut self, _canvas: &Canvas, _event: &WindowEvent) {}

    fn eye(&self) -> Vec3 {
        single(self.orbit.eye())
    }

    fn view_transform(&self) -> Pose3 {
        Pose3::look_at_rh(self.eye(), single(self.orbit.target), Vec3::Z)
    }

    fn transformation(&self) -> Mat4 {
        self.projection() * self.view_transform().to_mat4()
    }

    fn inverse_transformation(&self) -> Mat4 {
        self.transformation().inverse()
    }

    fn clip_planes(&self) -> (f32, f32) {
        let distance = self.orbit.distance as f32;
        (0.02 * distance, 50.0 * distance)
    }

    fn update(&mut self, _canvas: &Canvas) {}

    fn view_transform_pair(&self, _pass: usize) -> (Pose3, Mat4) {
        (self.view_transform(), self.projection())
    }
}
