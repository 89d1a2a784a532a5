use std::ops::Range;

use energy_dsl::Vector3;
use tiny_skia::{
    Color, FillRule, FilterQuality, GradientStop, LinearGradient, Paint, PathBuilder, Pixmap, PixmapPaint, Point, Rect,
    Shader, SpreadMode, Transform,
};

use super::projection::Camera;
use super::raster::{Canvas, Corner};
use super::solid_mesh::SolidMesh;
use super::vertex_normals;
use crate::geometry::{cross, dot, norm, subtract};

/// Dark and bright colours of solids and of hair.
const SOLID: Colours = [[0.16, 0.15, 0.14], [0.86, 0.83, 0.78]];
const HAIR: Colours = [[0.10, 0.05, 0.03], [0.72, 0.46, 0.26]];
const EDGE: [f32; 3] = [0.08, 0.09, 0.11];
/// Line width of hair and edges, in pixels before downsampling.
const STRAND: f64 = 3.0;

/// A picture that cannot be encoded.
#[derive(Debug, thiserror::Error)]
#[error("cannot draw the picture: {0}")]
pub struct PictureError(String);

const WIDTH: u32 = 1200;
const HEIGHT: u32 = 1000;
/// Supersampling factor: anti-aliases without seams between triangles.
const OVERSAMPLING: u32 = 2;
/// Directions from the cloth to the eye and to the lamp.
const VIEW: Vector3<f64> = [0.62, -1.0, 0.28];
const LAMP: Vector3<f64> = [-0.25, -0.45, 1.0];
/// Dark and bright colours of the front and of the back.
const FRONT: Colours = [[0.03, 0.10, 0.19], [0.40, 0.66, 0.86]];
const BACK: Colours = [[0.20, 0.08, 0.05], [0.94, 0.66, 0.46]];

/// The contents of a picture.
#[derive(Clone, Copy, Debug)]
pub struct View<'a> {
    /// Positions of the vertices, in m.
    pub positions: &'a [Vector3<f64>],
    /// Triangles of the cloth.
    pub triangles: &'a [[usize; 3]],
    /// Vertex range of each strand of hair.
    pub strands: &'a [Range<usize>],
    /// Surfaces of the solids.
    pub solids: &'a [SolidMesh],
    /// Height of the floor, in m; `None` for slightly below everything.
    pub floor: Option<f64>,
    /// The camera; `None` to frame everything that is visible.
    pub(crate) camera: Option<Camera>,
    /// Appearance of cloth and hair.
    pub look: Look<'a>,
}

/// The appearance of cloth and hair.
#[derive(Clone, Copy, Debug, Default)]
pub struct Look<'a> {
    /// RGB colour of each vertex, from 0 to 1; `None` for the default colours of cloth and hair.
    pub colours: Option<&'a Vec<[f32; 3]>>,
    /// Whether to draw the edges of triangles.
    pub wireframe: bool,
}

/// Draws cloth, hair and solids as PNG. The two sides of cloth have different colours; the floor receives shadows. z is
/// up.
///
/// # Errors
/// Returns an error if the picture cannot be encoded.
pub fn picture_png(view: &View<'_>) -> Result<Vec<u8>, PictureError> {
    let [width, height] = [WIDTH * OVERSAMPLING, HEIGHT * OVERSAMPLING];
    let mut background = Pixmap::new(width, height).ok_or_else(|| PictureError("no memory".into()))?;
    let solids = view.solids.iter().flat_map(|solid| &solid.vertices);
    let everything: Vec<Vector3<f64>> = view.positions.iter().chain(solids).copied().collect();
    let shadow = shadow_points(&everything, view.floor);
    let all = || everything.iter().chain(&shadow).copied().collect::<Vec<_>>();
    let camera = view.camera.unwrap_or_else(|| camera_on(&all()));
    draw_background(&mut background);
    draw_shadow(&mut background, &camera, &shadow, &all_triangles(view));
    let mut canvas = Canvas::new(background);
    for solid in view.solids {
        draw_surface(&mut canvas, &camera, &solid.vertices, &solid.triangles, |front, _| {
            [SOLID; 2][usize::from(front)]
        });
    }
    let own = |vertex: usize| view.look.colours.and_then(|colours| colours.get(vertex)).map(lit);
    draw_surface(&mut canvas, &camera, view.positions, view.triangles, |front, vertex| {
        own(vertex).unwrap_or(if front { FRONT } else { BACK })
    });
    if view.look.wireframe {
        draw_edges(&mut canvas, &camera, view.positions, view.triangles);
    }
    for strand in view.strands {
        draw_strand(&mut canvas, &camera, view.positions, strand.clone(), |vertex| own(vertex).unwrap_or(HAIR));
    }
    let small = averaged(&canvas.pixels).ok_or_else(|| PictureError("no memory".into()))?;
    small.encode_png().map_err(|error| PictureError(error.to_string()))
}

/// Size of a picture before downsampling, in pixels.
const SIZE: [f64; 2] = [(WIDTH * OVERSAMPLING) as f64, (HEIGHT * OVERSAMPLING) as f64];

/// Returns a camera that frames the points, with some space around them.
pub(super) fn camera_on(points: &[Vector3<f64>]) -> Camera {
    Camera::framing(points, VIEW, SIZE, 0.86)
}

/// Whether a point lies well within the picture.
pub(super) fn is_visible(camera: &Camera, point: Vector3<f64>) -> bool {
    let (place, depth) = camera.project(point);
    depth > 0.0 && (0..2).all(|axis| (0.02..=0.98).contains(&(place[axis] / SIZE[axis])))
}

/// Returns the triangles of cloth and solids in one vertex numbering.
fn all_triangles(view: &View<'_>) -> Vec<[usize; 3]> {
    let mut all = view.triangles.to_vec();
    let mut first = view.positions.len();
    for solid in view.solids {
        all.extend(solid.triangles.iter().map(|corners| corners.map(|corner| first + corner)));
        first += solid.vertices.len();
    }
    all
}

type Colours = [[f32; 3]; 2];

fn draw_surface(
    canvas: &mut Canvas,
    camera: &Camera,
    positions: &[Vector3<f64>],
    triangles: &[[usize; 3]],
    colours: impl Fn(bool, usize) -> Colours,
) {
    let normals = vertex_normals(positions, triangles);
    let lamp = LAMP.map(|component| component / norm(LAMP));
    for corners in triangles {
        let [a, b, c] = corners.map(|corner| positions[corner]);
        let is_front = dot(cross(subtract(b, a), subtract(c, a)), camera.towards_eye(a)) >= 0.0;
        let side = if is_front { 1.0 } else { -1.0 };
        canvas.triangle(corners.map(|corner| {
            let normal = normals[corner].map(|component| side * component);
            let (place, depth) = camera.project(positions[corner]);
            let brightness = shade(normal, lamp, camera.towards_eye(positions[corner]));
            Corner { place, depth, colour: mixed(&colours(is_front, corner), brightness) }
        }));
    }
}

/// Draws a strand; segments across the light are brighter.
fn draw_strand(
    canvas: &mut Canvas,
    camera: &Camera,
    positions: &[Vector3<f64>],
    strand: Range<usize>,
    colours: impl Fn(usize) -> Colours,
) {
    let lamp = LAMP.map(|component| component / norm(LAMP));
    for end in strand.skip(1) {
        let offset = subtract(positions[end], positions[end - 1]);
        let along = dot(offset, lamp) / norm(offset).max(f64::MIN_POSITIVE);
        let brightness = 0.15 + 0.85 * (1.0 - along * along).max(0.0).sqrt();
        let [from, to] = [end - 1, end].map(|vertex| {
            let (place, depth) = camera.project(positions[vertex]);
            Corner { place, depth, colour: mixed(&colours(vertex), brightness) }
        });
        canvas.line(from, to, STRAND);
    }
}

/// Draws the edges of triangles, slightly nearer than they are, so that they lie on top.
fn draw_edges(canvas: &mut Canvas, camera: &Camera, positions: &[Vector3<f64>], triangles: &[[usize; 3]]) {
    let corner = |vertex: usize| {
        let (place, depth) = camera.project(positions[vertex]);
        Corner { place, depth: 0.999 * depth, colour: EDGE }
    };
    for &[a, b, c] in triangles {
        for (from, to) in [(a, b), (b, c), (c, a)] {
            canvas.line(corner(from), corner(to), STRAND);
        }
    }
}

/// Returns a colour in shade and in light.
fn lit(colour: &[f32; 3]) -> Colours {
    [colour.map(|channel| 0.35 * channel), *colour]
}

fn mixed([dark, bright]: &Colours, brightness: f64) -> [f32; 3] {
    std::array::from_fn(|channel| dark[channel] + brightness as f32 * (bright[channel] - dark[channel]))
}

/// Returns the brightness from the lamp, a weaker light at the eye, the sky, and a sheen at grazing angles.
fn shade(normal: Vector3<f64>, lamp: Vector3<f64>, eye: Vector3<f64>) -> f64 {
    let facing = dot(normal, eye).clamp(0.0, 1.0);
    let sheen = 0.16 * (1.0 - facing).powi(3);
    let sky = 0.12 * (0.5 + 0.5 * normal[2]);
    (0.06 + 0.72 * dot(normal, lamp).max(0.0) + 0.22 * facing * facing + sky + sheen).min(1.0)
}

fn draw_background(canvas: &mut Pixmap) {
    let (width, height) = (canvas.width() as f32, canvas.height() as f32);
    let grey = |level: f32| Color::from_rgba(level, level, level + 0.01, 1.0).unwrap_or(Color::WHITE);
    let stops = vec![GradientStop::new(0.0, grey(0.98)), GradientStop::new(1.0, grey(0.84))];
    let gradient = LinearGradient::new(
        Point::from_xy(0.0, 0.0),
        Point::from_xy(0.0, height),
        stops,
        SpreadMode::Pad,
        Transform::identity(),
    );
    let paint = Paint { shader: gradient.unwrap_or(Shader::SolidColor(grey(0.9))), ..Paint::default() };
    if let Some(all) = Rect::from_xywh(0.0, 0.0, width, height) {
        canvas.fill_rect(all, &paint, Transform::identity(), None);
    }
}

/// Returns the shadows of the points on the floor.
fn shadow_points(positions: &[Vector3<f64>], floor: Option<f64>) -> Vec<Vector3<f64>> {
    let range = |pick: fn(f64, f64) -> f64, start| positions.iter().map(|p| p[2]).fold(start, pick);
    let (low, high) = (range(f64::min, f64::INFINITY), range(f64::max, f64::NEG_INFINITY));
    let floor = floor.unwrap_or(low - 0.08 * (high - low));
    positions.iter().map(|p| shadow_of(p, floor)).collect()
}

/// Returns the shadow of a point on the floor.
pub(super) fn shadow_of(p: &Vector3<f64>, floor: f64) -> Vector3<f64> {
    let offset = (p[2] - floor) / LAMP[2];
    [p[0] - offset * LAMP[0], p[1] - offset * LAMP[1], floor]
}

/// Draws the shadow at low resolution; upscaling softens it.
fn draw_shadow(canvas: &mut Pixmap, camera: &Camera, shadow: &[Vector3<f64>], triangles: &[[usize; 3]]) {
    const COARSENESS: u32 = 20;
    let Some(mut small) = Pixmap::new(canvas.width() / COARSENESS, canvas.height() / COARSENESS) else { return };
    let mut outline = PathBuilder::new();
    for corners in triangles {
        let mut seen = corners.map(|corner| camera.project(shadow[corner]).0);
        let [p, q, r] = seen;
        // Same orientation for all triangles, so that overlapping folds add up instead of cancelling.
        if (q[0] - p[0]) * (r[1] - p[1]) < (q[1] - p[1]) * (r[0] - p[0]) {
            seen.swap(1, 2);
        }
        append_polygon(&mut outline, &seen);
    }
    let Some(path) = outline.finish() else { return };
    let ink = Color::from_rgba(0.1, 0.11, 0.14, 0.34).unwrap_or(Color::BLACK);
    let paint = Paint { shader: Shader::SolidColor(ink), ..Paint::default() };
    let shrink = 1.0 / COARSENESS as f32;
    small.fill_path(&path, &paint, FillRule::Winding, Transform::from_scale(shrink, shrink), None);
    let soft = PixmapPaint { quality: FilterQuality::Bilinear, ..PixmapPaint::default() };
    let enlarge = Transform::from_scale(COARSENESS as f32, COARSENESS as f32);
    canvas.draw_pixmap(0, 0, small.as_ref(), &soft, enlarge, None);
}

fn append_polygon(path: &mut PathBuilder, corners: &[[f64; 2]]) {
    for (index, corner) in corners.iter().enumerate() {
        let [x, y] = corner.map(|coordinate| coordinate as f32);
        if index == 0 { path.move_to(x, y) } else { path.line_to(x, y) }
    }
    path.close();
}

/// Downsamples to the final size by averaging.
fn averaged(canvas: &Pixmap) -> Option<Pixmap> {
    let mut small = Pixmap::new(WIDTH, HEIGHT)?;
    let (source, row) = (canvas.data(), 4 * canvas.width() as usize);
    for (index, byte) in small.data_mut().iter_mut().enumerate() {
        let (pixel, channel) = (index / 4, index % 4);
        let (x, y) = (pixel % WIDTH as usize, pixel / WIDTH as usize);
        let n = OVERSAMPLING as usize;
        let sum: u32 =
            (0..n * n).map(|part| u32::from(source[(n * y + part / n) * row + 4 * (n * x + part % n) + channel])).sum();
        *byte = ((sum + (n * n / 2) as u32) / (n * n) as u32) as u8;
    }
    Some(small)
}
