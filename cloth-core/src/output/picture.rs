use std::ops::Range;

use energy_dsl::Vector3;
use tiny_skia::Pixmap;

use super::floor::draw_floor;
use super::floor_shadow::FloorShadow;
use super::projection::Camera;
use super::raster::{Canvas, Corner};
use super::shade::{Colours, LAMP, lit, mixed, towards_lamp};
use super::solid_mesh::SolidMesh;
use super::style::{OVERSAMPLING, camera_on};
use super::surfaces::Surfaces;
use super::visibility::lamp_directions;
use crate::geometry::{dot, norm, subtract};
use crate::scene::Style;

/// Dark and bright colours of hair.
const HAIR: Colours = [[0.10, 0.05, 0.03], [0.72, 0.46, 0.26]];
/// The least width of hair, in pixels before downsampling.
const THINNEST: f64 = 1.5;
/// The fewest and the most parts of the lamp. Each casts a shadow on the floor; with the most, the borders of the
/// shadows cannot be told apart. Fewer are drawn if the shadows would have more triangles than `MOST_SHADOWS`.
const LAMPS: [usize; 2] = [24, 48];
const MOST_SHADOWS: usize = 2_000_000;

/// A picture that cannot be encoded.
#[derive(Debug, thiserror::Error)]
#[error("cannot draw the picture: {0}")]
#[non_exhaustive]
pub struct PictureError(String);

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
    /// RGB colour of each vertex of garments with a colour of their own; may be empty.
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

/// Draws cloth, hair and solids as PNG, on a floor. Surfaces are smooth: patches follow the vertices and their normals.
/// Garments have colours of their own, paler on the back, and a rim along their borders. Cloth, solids and the floor
/// receive soft shadows. z is up.
///
/// # Errors
/// Returns an error if the picture cannot be encoded.
pub fn picture_png(view: &View<'_>) -> Result<Vec<u8>, PictureError> {
    let no_memory = || PictureError("no memory".into());
    let [width, height] = view.style.size;
    let mut picture = Pixmap::new(width, height).ok_or_else(no_memory)?;
    let [width, height] = view.style.size.map(|pixels| pixels * OVERSAMPLING);
    let mut canvas = Canvas::new(Pixmap::new(width, height).ok_or_else(no_memory)?);
    let solids = view.solids.iter().flat_map(|solid| &solid.vertices);
    let everything: Vec<Vector3<f64>> = view.positions.iter().chain(solids).copied().collect();
    let floor = floor_below(&everything, view.floor);
    let camera = view.camera.unwrap_or_else(|| {
        let all: Vec<Vector3<f64>> = everything.iter().flat_map(|p| [*p, shadow_of(p, floor)]).collect();
        camera_on(&view.style, &all)
    });
    draw_background(&mut picture, view.style.background);
    draw_floor(&mut picture, &camera, floor);
    draw_shadow(&mut picture, &camera, (&everything, floor), &all_triangles(view), view);
    Surfaces::shown(view, &camera).draw(&mut canvas, &camera, view);
    let own = |vertex: usize| {
        let shown = view.look.colours.and_then(|colours| colours.get(vertex));
        shown.copied().or(view.garment_colours.get(vertex).copied().flatten()).map(lit)
    };
    for (strand, width) in view.strands.iter().zip(view.widths) {
        let colours = |vertex| own(vertex).unwrap_or(HAIR);
        draw_strand(&mut canvas, &camera, view.positions, strand.clone(), *width, colours);
    }
    cover(&mut picture, &canvas.pixels);
    picture.encode_png().map_err(|error| PictureError(error.to_string()))
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

/// Draws a strand; segments across the light are brighter.
fn draw_strand(
    canvas: &mut Canvas,
    camera: &Camera,
    positions: &[Vector3<f64>],
    strand: Range<usize>,
    width: f64,
    colours: impl Fn(usize) -> Colours,
) {
    let lamp = towards_lamp();
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
    let mut all = FloorShadow::new(view.style.size.map(|pixels| pixels * OVERSAMPLING));
    let lamps = (MOST_SHADOWS / triangles.len().max(1)).clamp(LAMPS[0], LAMPS[1]);
    for lamp in lamp_directions(towards_lamp(), lamps) {
        let shadow: Vec<Vector3<f64>> = points.iter().map(|p| shadow_along(p, floor, lamp)).collect();
        all.add(camera, &shadow, triangles, &segments);
    }
    all.draw(canvas, OVERSAMPLING);
}

/// Covers a picture by a larger one, whose pixels are averaged where they are opaque.
fn cover(picture: &mut Pixmap, canvas: &Pixmap) {
    let n = OVERSAMPLING as usize;
    let (width, row) = (picture.width() as usize, 4 * canvas.width() as usize);
    let rows = picture.data_mut().chunks_exact_mut(4 * width).zip(canvas.data().chunks_exact(n * row));
    for (pixels, covering) in rows {
        for (column, pixel) in pixels.chunks_exact_mut(4).enumerate() {
            let mut sums = [0_u32; 4];
            for line in covering.chunks_exact(row) {
                for part in line[4 * n * column..4 * n * (column + 1)].chunks_exact(4) {
                    (0..4).for_each(|channel| sums[channel] += u32::from(part[channel]));
                }
            }
            let all = (n * n) as u32;
            let free = all - sums[3] / 255;
            for (byte, sum) in pixel.iter_mut().zip(sums) {
                *byte = ((sum + free * u32::from(*byte) + all / 2) / all) as u8;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::shade::sides;
    use super::*;

    /// Draws a level square with a side of 1 m at a height, seen from the right, and returns the picture with its
    /// camera.
    fn square_above_the_floor(height: f64) -> (Pixmap, Camera) {
        let at = |step: usize| step as f64 / 10.0 - 0.5;
        let positions: Vec<Vector3<f64>> = (0..121).map(|n| [at(n % 11), at(n / 11), height]).collect();
        let cells = (0..110).filter(|n| n % 11 != 10);
        let triangles: Vec<[usize; 3]> = cells.flat_map(|a| [[a, a + 1, a + 12], [a, a + 12, a + 11]]).collect();
        let camera = Camera::looking([3.0, 0.3, 4.0], [0.5, 0.3, 0.3], 30.0, [2400.0, 1800.0]);
        let view = View {
            positions: &positions,
            triangles: &triangles,
            strands: &[],
            widths: &[],
            garment_colours: &[],
            solids: &[],
            floor: Some(0.0),
            camera: Some(camera),
            look: Look::default(),
            style: Style { size: [1200, 900], background: Some([1.0; 3]), ..Style::default() },
        };
        (Pixmap::decode_png(&picture_png(&view).unwrap()).unwrap(), camera)
    }

    fn green(picture: &Pixmap, camera: &Camera, point: Vector3<f64>) -> i32 {
        let ([x, y], _) = camera.project(point);
        i32::from(picture.pixel(x as u32 / OVERSAMPLING, y as u32 / OVERSAMPLING).unwrap().green())
    }

    #[test]
    fn the_border_of_a_shadow_has_no_steps() {
        let (picture, camera) = square_above_the_floor(1.0);
        // Across the border of the shadow in x, which is blurred over 0.2 m. The picture has 2 mm per pixel, and
        // the floor a line every 0.2 m.
        let middle = shadow_of(&[0.0, 0.25, 1.0], 0.0);
        let along = (0..300).map(|step| middle[0] + 0.3 + 0.4 * f64::from(step) / 300.0);
        let beside_lines = along.filter(|x| (x / 0.2 - (x / 0.2).round()).abs() > 0.04);
        let tones: Vec<i32> = beside_lines.map(|x| green(&picture, &camera, [x, middle[1], 0.0])).collect();
        let (dark, bright) = (tones[0], tones[tones.len() - 1]);
        assert!(bright > dark + 50, "{tones:?}");
        let between: std::collections::BTreeSet<i32> = tones.iter().copied().collect();
        assert!(between.len() > 40, "{between:?}");
        let largest = tones.windows(2).map(|pair| (pair[1] - pair[0]).abs()).max().unwrap();
        assert!(largest <= 5, "a step of {largest}: {tones:?}");
    }

    #[test]
    fn cloth_has_a_rim_and_a_paler_back_and_stands_on_a_floor() {
        let (picture, camera) = square_above_the_floor(0.5);
        let inside = green(&picture, &camera, [0.2, -0.2, 0.5]);
        let rim = green(&picture, &camera, [0.2, -0.5, 0.5]);
        assert!(rim > inside + 5, "{rim} beside {inside}");
        let floor = green(&picture, &camera, [0.93, -0.83, 0.0]);
        assert!(floor < 250 && floor > 200, "{floor}");
        let [front, back] = sides([0.4, 0.6, 0.8]);
        assert!((0..2).all(|light| back[light][1] > front[light][1] + 0.1));
    }
}
