use energy_dsl::Vector3;
use tiny_skia::{
    Color, FillRule, FilterQuality, GradientStop, LinearGradient, Paint, PathBuilder, Pixmap, PixmapPaint, Point, Rect,
    Shader, SpreadMode, Transform,
};

use super::projection::Camera;
use super::vertex_normals;
use crate::mesh::{cross, dot, norm, subtract};

/// A picture that cannot be encoded.
#[derive(Debug, thiserror::Error)]
#[error("cannot draw the picture: {0}")]
pub struct PictureError(String);

const WIDTH: u32 = 1200;
const HEIGHT: u32 = 1000;
/// Drawn this many times larger and averaged: triangles without smoothed edges leave no seams between them.
const OVERSAMPLING: u32 = 3;
/// From the cloth to the eye and to the lamp.
const VIEW: Vector3<f64> = [0.62, -1.0, 0.28];
const LAMP: Vector3<f64> = [-0.25, -0.45, 1.0];
/// Darkest and brightest colour of the front and of the back.
const FRONT: [[f32; 3]; 2] = [[0.03, 0.10, 0.19], [0.40, 0.66, 0.86]];
const BACK: [[f32; 3]; 2] = [[0.20, 0.08, 0.05], [0.94, 0.66, 0.46]];

/// A shaded picture of a cloth as PNG: both sides lit, each in its own colour, with its shadow on the floor below. z is up.
///
/// # Errors
/// When the picture cannot be encoded.
pub fn picture_png(positions: &[Vector3<f64>], triangles: &[[usize; 3]]) -> Result<Vec<u8>, PictureError> {
    let [width, height] = [WIDTH * OVERSAMPLING, HEIGHT * OVERSAMPLING];
    let mut canvas = Pixmap::new(width, height).ok_or_else(|| PictureError("no memory".into()))?;
    let shadow = shadow_points(positions);
    let everything: Vec<Vector3<f64>> = positions.iter().chain(&shadow).copied().collect();
    let camera = Camera::framing(&everything, VIEW, [f64::from(width), f64::from(height)], 0.86);
    draw_background(&mut canvas);
    draw_shadow(&mut canvas, &camera, &shadow, triangles);
    for face in faces(positions, triangles, &camera) {
        face.draw(&mut canvas);
    }
    let small = averaged(&canvas).ok_or_else(|| PictureError("no memory".into()))?;
    small.encode_png().map_err(|error| PictureError(error.to_string()))
}

/// A triangle as seen: corners in pixels, brightness at each, the colours it lies between.
struct Face {
    depth: f64,
    corners: [[f64; 2]; 3],
    brightness: [f64; 3],
    colours: &'static [[f32; 3]; 2],
}

/// The triangles, the farthest first.
fn faces(positions: &[Vector3<f64>], triangles: &[[usize; 3]], camera: &Camera) -> Vec<Face> {
    let normals = vertex_normals(positions, triangles);
    let lamp = LAMP.map(|component| component / norm(LAMP));
    let face = |corners: &[usize; 3]| {
        let [a, b, c] = corners.map(|corner| positions[corner]);
        let is_front = dot(cross(subtract(b, a), subtract(c, a)), camera.towards_eye(a)) >= 0.0;
        let side = if is_front { 1.0 } else { -1.0 };
        let brightness = corners.map(|corner| {
            let normal = normals[corner].map(|component| side * component);
            shade(normal, lamp, camera.towards_eye(positions[corner]))
        });
        let seen = corners.map(|corner| camera.project(positions[corner]));
        Face {
            depth: seen.iter().map(|(_, depth)| depth).sum(),
            corners: seen.map(|(image, _)| image),
            brightness,
            colours: if is_front { &FRONT } else { &BACK },
        }
    };
    let mut faces: Vec<Face> = triangles.iter().map(face).collect();
    faces.sort_by(|a, b| b.depth.total_cmp(&a.depth));
    faces
}

/// Lamp, a weaker light from the eye, sky, and a sheen where the cloth turns away.
fn shade(normal: Vector3<f64>, lamp: Vector3<f64>, eye: Vector3<f64>) -> f64 {
    let facing = dot(normal, eye).clamp(0.0, 1.0);
    let sheen = 0.16 * (1.0 - facing).powi(3);
    let sky = 0.12 * (0.5 + 0.5 * normal[2]);
    (0.06 + 0.72 * dot(normal, lamp).max(0.0) + 0.22 * facing * facing + sky + sheen).min(1.0)
}

impl Face {
    fn draw(&self, canvas: &mut Pixmap) {
        let Some(path) = polygon(&self.corners) else { return };
        let paint = Paint { shader: self.shader(), anti_alias: false, ..Paint::default() };
        canvas.fill_path(&path, &paint, FillRule::Winding, Transform::identity(), None);
    }

    /// Brightness is linear over a triangle, which is what a linear gradient along its slope paints.
    fn shader(&self) -> Shader<'static> {
        let [p, q, r] = self.corners;
        let [i, j, k] = self.brightness;
        let (u, v) = ([q[0] - p[0], q[1] - p[1]], [r[0] - p[0], r[1] - p[1]]);
        let area = u[0] * v[1] - u[1] * v[0];
        let slope = [((j - i) * v[1] - (k - i) * u[1]) / area, ((k - i) * u[0] - (j - i) * v[0]) / area];
        let steepness = slope[0] * slope[0] + slope[1] * slope[1];
        let (low, high) = (i.min(j).min(k), i.max(j).max(k));
        let at = |brightness: f64| {
            let way = (brightness - i) / steepness;
            point([p[0] + way * slope[0], p[1] + way * slope[1]])
        };
        let stops = || vec![GradientStop::new(0.0, self.colour(low)), GradientStop::new(1.0, self.colour(high))];
        let gradient = (high - low > 1e-4 && steepness.is_finite() && steepness > 0.0)
            .then(|| LinearGradient::new(at(low), at(high), stops(), SpreadMode::Pad, Transform::identity()))
            .flatten();
        gradient.unwrap_or_else(|| Shader::SolidColor(self.colour((i + j + k) / 3.0)))
    }

    fn colour(&self, brightness: f64) -> Color {
        let [dark, bright] = self.colours;
        let mix = |channel: usize| {
            let amount = brightness as f32;
            (dark[channel] + amount * (bright[channel] - dark[channel])).clamp(0.0, 1.0)
        };
        Color::from_rgba(mix(0), mix(1), mix(2), 1.0).unwrap_or(Color::BLACK)
    }
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

/// The points' shadows on a floor a little below the lowest.
fn shadow_points(positions: &[Vector3<f64>]) -> Vec<Vector3<f64>> {
    let range = |pick: fn(f64, f64) -> f64, start| positions.iter().map(|p| p[2]).fold(start, pick);
    let (low, high) = (range(f64::min, f64::INFINITY), range(f64::max, f64::NEG_INFINITY));
    let floor = low - 0.08 * (high - low);
    let cast = |p: &Vector3<f64>| {
        let way = (p[2] - floor) / LAMP[2];
        [p[0] - way * LAMP[0], p[1] - way * LAMP[1], floor]
    };
    positions.iter().map(cast).collect()
}

/// Drawn small and enlarged, which makes it soft.
fn draw_shadow(canvas: &mut Pixmap, camera: &Camera, shadow: &[Vector3<f64>], triangles: &[[usize; 3]]) {
    const COARSENESS: u32 = 30;
    let Some(mut small) = Pixmap::new(canvas.width() / COARSENESS, canvas.height() / COARSENESS) else { return };
    let mut outline = PathBuilder::new();
    for corners in triangles {
        let mut seen = corners.map(|corner| camera.project(shadow[corner]).0);
        let [p, q, r] = seen;
        // All the same way round, so that overlapping folds add up instead of cancelling.
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
    let soft = PixmapPaint { quality: FilterQuality::Bicubic, ..PixmapPaint::default() };
    let enlarge = Transform::from_scale(COARSENESS as f32, COARSENESS as f32);
    canvas.draw_pixmap(0, 0, small.as_ref(), &soft, enlarge, None);
}

fn polygon(corners: &[[f64; 2]]) -> Option<tiny_skia::Path> {
    let mut path = PathBuilder::new();
    append_polygon(&mut path, corners);
    path.finish()
}

fn append_polygon(path: &mut PathBuilder, corners: &[[f64; 2]]) {
    for (index, corner) in corners.iter().enumerate() {
        let Point { x, y } = point(*corner);
        if index == 0 { path.move_to(x, y) } else { path.line_to(x, y) }
    }
    path.close();
}

fn point([x, y]: [f64; 2]) -> Point {
    Point::from_xy(x as f32, y as f32)
}

/// The picture at its final size, each pixel the mean of those drawn for it.
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
