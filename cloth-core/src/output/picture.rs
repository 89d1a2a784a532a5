use std::ops::Range;

use energy_dsl::Vector3;
use tiny_skia::Pixmap;

use super::floor_shadow::FloorShadow;
use super::projection::Camera;
use super::raster::{Canvas, Corner};
use super::solid_mesh::SolidMesh;
use super::style::{OVERSAMPLING, camera_on};
use super::vertex_normals;
use super::visibility::{Occluders, Visibility, lamp_directions};
use crate::geometry::{cross, dot, norm, subtract};
use crate::scene::Style;

/// Dark and bright colours of solids and of hair.
const SOLID: Colours = [[0.16, 0.15, 0.14], [0.86, 0.83, 0.78]];
const HAIR: Colours = [[0.10, 0.05, 0.03], [0.72, 0.46, 0.26]];
const EDGE: [f32; 3] = [0.08, 0.09, 0.11];
/// Line width of edges, and the least of hair, in pixels before downsampling.
const LINE: f64 = 3.0;
const THINNEST: f64 = 1.5;

/// A picture that cannot be encoded.
#[derive(Debug, thiserror::Error)]
#[error("cannot draw the picture: {0}")]
#[non_exhaustive]
pub struct PictureError(String);

/// Direction from the cloth to the lamp.
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
    /// Width of each strand, in m.
    pub widths: &'a [f64],
    /// RGB colour of each vertex of garments with a colour of their own; empty if none has one.
    pub garment_colours: &'a [Option<[f32; 3]>],
    /// Surfaces of the solids.
    pub solids: &'a [SolidMesh],
    /// Height of the floor, in m; `None` for slightly below everything.
    pub floor: Option<f64>,
    /// The camera; `None` to frame everything that is visible.
    pub(crate) camera: Option<Camera>,
    /// Appearance of cloth and hair.
    pub look: Look<'a>,
    /// Size, camera and background.
    pub style: Style,
}

/// The appearance of cloth and hair.
#[derive(Clone, Copy, Debug, Default)]
pub struct Look<'a> {
    /// RGB colour of each vertex, from 0 to 1; `None` for the default colours of cloth and hair.
    pub colours: Option<&'a Vec<[f32; 3]>>,
    /// Whether to draw the edges of triangles.
    pub wireframe: bool,
}

/// Draws cloth, hair and solids as PNG. The two sides of cloth have different colours; cloth, solids and the floor
/// receive soft shadows. z is up.
///
/// # Errors
/// Returns an error if the picture cannot be encoded.
pub fn picture_png(view: &View<'_>) -> Result<Vec<u8>, PictureError> {
    let [width, height] = view.style.size.map(|pixels| pixels * OVERSAMPLING);
    let mut background = Pixmap::new(width, height).ok_or_else(|| PictureError("no memory".into()))?;
    let solids = view.solids.iter().flat_map(|solid| &solid.vertices);
    let everything: Vec<Vector3<f64>> = view.positions.iter().chain(solids).copied().collect();
    let floor = floor_below(&everything, view.floor);
    let camera = view.camera.unwrap_or_else(|| {
        let all: Vec<Vector3<f64>> = everything.iter().flat_map(|p| [*p, shadow_of(p, floor)]).collect();
        camera_on(&view.style, &all)
    });
    draw_background(&mut background, view.style.background);
    let triangles = all_triangles(view);
    draw_shadow(&mut background, &camera, (&everything, floor), &triangles, view);
    let mut canvas = Canvas::new(background);
    draw_surfaces(&mut canvas, &camera, &everything, &triangles, view);
    if view.look.wireframe {
        draw_edges(&mut canvas, &camera, view.positions, view.triangles);
    }
    let own = |vertex: usize| view.look.colours.and_then(|colours| colours.get(vertex)).map(lit);
    for (strand, width) in view.strands.iter().zip(view.widths) {
        let colours = |vertex| own(vertex).unwrap_or(HAIR);
        draw_strand(&mut canvas, &camera, view.positions, strand.clone(), *width, colours);
    }
    let small = averaged(&canvas.pixels, view.style.size).ok_or_else(|| PictureError("no memory".into()))?;
    small.encode_png().map_err(|error| PictureError(error.to_string()))
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

/// Draws cloth and solids, whose points and triangles share one numbering: those of cloth come first.
fn draw_surfaces(
    canvas: &mut Canvas,
    camera: &Camera,
    points: &[Vector3<f64>],
    triangles: &[[usize; 3]],
    view: &View<'_>,
) {
    let normals = vertex_normals(points, triangles);
    let lamp = LAMP.map(|component| component / norm(LAMP));
    let segments: Vec<[usize; 2]> = view
        .strands
        .iter()
        .flat_map(|strand| strand.clone().zip(strand.clone().skip(1)).map(|(a, b)| [a, b]))
        .collect();
    let visibility = Visibility::of(&Occluders { points, triangles, segments: &segments }, &normals, lamp);
    let colours = |vertex: usize, is_front: bool| {
        if vertex >= view.positions.len() {
            return SOLID;
        }
        let shown = view.look.colours.and_then(|colours| colours.get(vertex)).map(lit);
        let own = view.garment_colours.get(vertex).copied().flatten();
        shown.or(own.map(|colour| sides(&colour)[usize::from(!is_front)])).unwrap_or(if is_front {
            FRONT
        } else {
            BACK
        })
    };
    for corners in triangles {
        let [a, b, c] = corners.map(|corner| points[corner]);
        let is_front = dot(cross(subtract(b, a), subtract(c, a)), camera.towards_eye(a)) >= 0.0;
        let (side, sign) = if is_front { (0, 1.0) } else { (1, -1.0) };
        canvas.triangle(corners.map(|corner| {
            let normal = normals[corner].map(|component| sign * component);
            let (place, depth) = camera.project(points[corner]);
            let seen = [visibility.lamp[corner][side], visibility.sky[corner][side]].map(f64::from);
            let brightness = shade(normal, lamp, camera.towards_eye(points[corner]), seen);
            Corner { place, depth, colour: mixed(&colours(corner, is_front), brightness) }
        }));
    }
}

/// Draws a strand; segments across the light are brighter.
fn draw_strand(
    canvas: &mut Canvas,
    camera: &Camera,
    positions: &[Vector3<f64>],
    strand: Range<usize>,
    width: f64,
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
        let pixels = camera.pixels(width, 0.5 * (from.depth + to.depth));
        canvas.line(from, to, pixels.max(THINNEST));
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
            canvas.line(corner(from), corner(to), LINE);
        }
    }
}

/// Returns a colour in shade and in light.
fn lit(colour: &[f32; 3]) -> Colours {
    [colour.map(|channel| 0.35 * channel), *colour]
}

/// Returns the colours of the two sides of cloth of a colour; the back is paler.
fn sides(colour: &[f32; 3]) -> [Colours; 2] {
    let pale = colour.map(|channel| 0.65 * channel + 0.25);
    [colour, &pale].map(|colour| [colour.map(|channel| 0.2 * channel), *colour])
}

fn mixed([dark, bright]: &Colours, brightness: f64) -> [f32; 3] {
    std::array::from_fn(|channel| dark[channel] + brightness as f32 * (bright[channel] - dark[channel]))
}

/// Returns the brightness from the lamp, a weaker light at the eye, the sky, and a sheen at grazing angles. The last
/// argument holds the visible parts of the lamp and of the surroundings.
fn shade(normal: Vector3<f64>, lamp: Vector3<f64>, eye: Vector3<f64>, [sunlit, open]: [f64; 2]) -> f64 {
    let facing = dot(normal, eye).clamp(0.0, 1.0);
    let sheen = 0.16 * (1.0 - facing).powi(3);
    let sky = 0.14 * (0.5 + 0.5 * normal[2]);
    let around = 0.06 + 0.22 * facing * facing + sky + sheen;
    (0.74 * sunlit * dot(normal, lamp).max(0.0) + (0.25 + 0.75 * open) * around).min(1.0)
}

/// Fills the picture with a colour, or with a grey that darkens downwards.
fn draw_background(canvas: &mut Pixmap, colour: Option<[f32; 3]>) {
    let (width, height) = (canvas.width() as usize, canvas.height());
    for (row, pixels) in canvas.data_mut().chunks_exact_mut(4 * width).enumerate() {
        let level = 0.98 - 0.14 * (row as f32 + 0.5) / height as f32;
        let colour = colour.unwrap_or([level, level, level + 0.01]).map(|channel| (255.0 * channel).round() as u8);
        for pixel in pixels.chunks_exact_mut(4) {
            pixel.copy_from_slice(&[colour[0], colour[1], colour[2], 255]);
        }
    }
}

/// Returns the height of the floor: that given, or slightly below everything.
fn floor_below(positions: &[Vector3<f64>], floor: Option<f64>) -> f64 {
    let range = |pick: fn(f64, f64) -> f64, start| positions.iter().map(|p| p[2]).fold(start, pick);
    let (low, high) = (range(f64::min, f64::INFINITY), range(f64::max, f64::NEG_INFINITY));
    floor.unwrap_or(low - 0.08 * (high - low))
}

/// Returns the shadow of a point on the floor.
pub(super) fn shadow_of(p: &Vector3<f64>, floor: f64) -> Vector3<f64> {
    shadow_along(p, floor, LAMP)
}

/// Returns the shadow of a point on the floor in the light from a direction.
fn shadow_along(p: &Vector3<f64>, floor: f64, lamp: Vector3<f64>) -> Vector3<f64> {
    let offset = (p[2] - floor) / lamp[2];
    [p[0] - offset * lamp[0], p[1] - offset * lamp[1], floor]
}

/// Draws the shadow of each part of the lamp on the floor.
fn draw_shadow(
    canvas: &mut Pixmap,
    camera: &Camera,
    (points, floor): (&[Vector3<f64>], f64),
    triangles: &[[usize; 3]],
    view: &View<'_>,
) {
    let segments: Vec<([usize; 2], f64)> = view
        .strands
        .iter()
        .zip(view.widths)
        .flat_map(|(strand, width)| strand.clone().skip(1).map(|end| ([end - 1, end], *width)))
        .collect();
    let mut all = FloorShadow::new(canvas);
    for lamp in lamp_directions(LAMP.map(|component| component / norm(LAMP))) {
        let shadow: Vec<Vector3<f64>> = points.iter().map(|p| shadow_along(p, floor, lamp)).collect();
        all.add(camera, &shadow, triangles, &segments);
    }
    all.draw(canvas);
}

/// Downsamples to the final size by averaging.
fn averaged(canvas: &Pixmap, [width, height]: [u32; 2]) -> Option<Pixmap> {
    let mut small = Pixmap::new(width, height)?;
    let (source, row) = (canvas.data(), 4 * canvas.width() as usize);
    for (index, byte) in small.data_mut().iter_mut().enumerate() {
        let (pixel, channel) = (index / 4, index % 4);
        let (x, y) = (pixel % width as usize, pixel / width as usize);
        let n = OVERSAMPLING as usize;
        let sum: u32 =
            (0..n * n).map(|part| u32::from(source[(n * y + part / n) * row + 4 * (n * x + part % n) + channel])).sum();
        *byte = ((sum + (n * n / 2) as u32) / (n * n) as u32) as u8;
    }
    Some(small)
}
