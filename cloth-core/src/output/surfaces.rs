//! Cloth and solids of a picture as one fine mesh, with colours and light at its vertices.

use energy_dsl::Vector3;

use super::picture::View;
use super::projection::Camera;
use super::raster::{Canvas, Corner};
use super::shade::{Colours, lit, mixed, shade, sides, towards_lamp};
use super::smooth_surface::{PatchCorner, Segment, SmoothSurface};
use super::style::{OVERSAMPLING, garment_colour};
use super::visibility::{Occluders, Receivers, resolution, seen_lamp, seen_sky};
use crate::geometry::{cross, dot, norm, subtract};

const SOLID: Colours = [[0.30, 0.29, 0.28], [0.86, 0.84, 0.80]];
const EDGE: [f32; 3] = [0.08, 0.09, 0.11];
/// Line width of edges, and of the rim of cloth, in pixels before downsampling.
const LINE: f64 = 1.5 * OVERSAMPLING as f64;
const RIM: f64 = 1.3 * OVERSAMPLING as f64;
/// Brightness of the rim relative to the cloth.
const RIM_LIGHT: f32 = 0.14;

/// Size of the triangles that are drawn, in pixels before downsampling.
const FINE: f64 = 8.0 * OVERSAMPLING as f64;
/// The finest division of an edge, and the largest number of triangles that division makes.
const FINEST: f64 = 16.0;
const MOST_TRIANGLES: f64 = 300_000.0;
/// Solids lie this much deeper, relative to their depth, so that smooth cloth on them stays in front.
const BEHIND: f64 = 1.001;
/// Lines lie this much nearer than the surfaces that they are drawn on.
const BEFORE: f64 = 0.9995;
/// Vertices whose normals have a smaller cosine with the direction to the eye can be seen from both sides.
const EDGE_ON: f64 = 0.4;

/// Size of the triangles that cast shadows, in pixels of a depth map.
const CASTING: f64 = 12.0;

/// Cloth and solids; the vertices and segments of cloth come first.
pub(super) struct Surfaces {
    fine: SmoothSurface,
    cloth_vertices: usize,
    cloth_segments: usize,
}

/// The seen parts of the lamp at each point, and of the sky at each corner of a patch: on the front and on the back.
struct Lights {
    lamp: Vec<[f32; 2]>,
    sky: Vec<[f32; 2]>,
}

impl Surfaces {
    /// Smooths the surfaces of a view; `level` returns the number of parts of each edge.
    fn of(view: &View<'_>, level: impl Fn(&[Vector3<f64>], &[[usize; 3]]) -> usize) -> Self {
        let parts = level(view.positions, view.triangles);
        let mut fine = SmoothSurface::of_cloth(view.positions, view.triangles, parts);
        let (cloth_vertices, cloth_segments) = (fine.points.len(), fine.segments.len());
        for solid in view.solids {
            let parts = level(&solid.vertices, &solid.triangles);
            fine.append(SmoothSurface::of_solid(&solid.vertices, &solid.triangles, parts));
        }
        Self { fine, cloth_vertices, cloth_segments }
    }

    /// Returns the surfaces as finely as the camera shows them.
    pub(super) fn shown(view: &View<'_>, camera: &Camera) -> Self {
        Self::of(view, |points, triangles| level_in_picture(camera, points, triangles))
    }

    /// Returns the surfaces as finely as shadows show them.
    fn casting(view: &View<'_>, everything: &[Vector3<f64>]) -> Self {
        let longest = CASTING * resolution(everything);
        Self::of(view, |points, triangles| level_in_space(longest, points, triangles))
    }

    /// Draws the surfaces, which receive shadows from each other and from hair, then the rims of cloth, then its edges
    /// if they are wanted.
    pub(super) fn draw(&self, canvas: &mut Canvas, camera: &Camera, view: &View<'_>) {
        let fine = &self.fine;
        let lamp = towards_lamp();
        let facing =
            fine.points.iter().zip(&fine.normals).map(|(point, normal)| dot(*normal, camera.towards_eye(*point)));
        let wanted: Vec<[bool; 2]> = facing.map(|cosine| [cosine > -EDGE_ON, cosine < EDGE_ON]).collect();
        let casting = Self::casting(view, &fine.points);
        let (points, segments) = casting.with_hair(view);
        let occluders = Occluders { points: &points, triangles: &casting.fine.triangles, segments: &segments };
        let Lights { lamp: sunlit, sky } = self.lights(&occluders, &wanted, lamp);
        let colours = self.colours(view);
        let tone = |vertex: usize, side: usize| {
            [0, 1].map(|light| [0, 1, 2].map(|i| self.between(vertex, |corner| colours[corner][side][light][i])))
        };
        let corners: Vec<[Corner; 2]> = (0..fine.points.len())
            .map(|vertex| {
                let (point, normal) = (fine.points[vertex], fine.normals[vertex]);
                let (place, depth) = camera.project(point);
                let depth = if vertex < self.cloth_vertices { depth } else { BEHIND * depth };
                let eye = camera.towards_eye(point);
                [(0, 1.0), (1, -1.0)].map(|(side, sign)| {
                    let seen = [sunlit[vertex][side], self.between(vertex, |corner| sky[corner][side])].map(f64::from);
                    let brightness = shade(normal.map(|component| sign * component), lamp, eye, seen);
                    Corner { place, depth, colour: mixed(&tone(vertex, side), brightness) }
                })
            })
            .collect();
        for triangle in &fine.triangles {
            let side = self.side(camera, triangle);
            canvas.triangle(triangle.map(|vertex| corners[vertex][side]));
        }
        self.draw_lines(canvas, camera, &corners, view.look.wireframe);
    }

    /// Returns the vertices with those of hair behind them, and the segments of hair.
    fn with_hair(&self, view: &View<'_>) -> (Vec<Vector3<f64>>, Vec<[usize; 2]>) {
        let (mut points, mut segments) = (self.fine.points.clone(), Vec::new());
        for strand in view.strands {
            let first = points.len();
            points.extend(&view.positions[strand.clone()]);
            segments.extend((first + 1..points.len()).map(|end| [end - 1, end]));
        }
        (points, segments)
    }

    /// Returns the side of a triangle that the eye sees: 0 for the front, 1 for the back.
    fn side(&self, camera: &Camera, triangle: &[usize; 3]) -> usize {
        let [a, b, c] = triangle.map(|vertex| self.fine.points[vertex]);
        usize::from(dot(cross(subtract(b, a), subtract(c, a)), camera.towards_eye(a)) < 0.0)
    }

    /// Returns the light at all points on the wanted sides. That of the sky varies little: the corners of patches do.
    fn lights(&self, occluders: &Occluders<'_>, wanted: &[[bool; 2]], lamp: Vector3<f64>) -> Lights {
        let SmoothSurface { points, normals, triangles, corners, patches, .. } = &self.fine;
        let receivers = Receivers { points, normals, triangles, wanted };
        let lamp = seen_lamp(occluders, &receivers, lamp);
        let (points, normals): (Vec<_>, Vec<_>) =
            corners.iter().map(|corner| (points[corner.point], normals[corner.point])).unzip();
        let wanted = vec![[true; 2]; corners.len()];
        let receivers = Receivers { points: &points, normals: &normals, triangles: patches, wanted: &wanted };
        Lights { lamp, sky: seen_sky(occluders, &receivers) }
    }

    /// Interpolates a value at the corners of patches.
    fn between(&self, vertex: usize, value: impl Fn(usize) -> f32) -> f32 {
        let (corners, weights) = self.fine.origins[vertex];
        (0..3).map(|number| weights[number] * value(corners[number])).sum()
    }

    /// Returns the colours of both sides of each corner of a patch.
    fn colours(&self, view: &View<'_>) -> Vec<[Colours; 2]> {
        let of_vertex = |vertex: usize| {
            let shown = view.look.colours.and_then(|colours| colours.get(vertex)).map(|colour| [lit(*colour); 2]);
            let garment = view.garment_colours.get(vertex).copied().flatten();
            shown.unwrap_or_else(|| sides(garment.unwrap_or(garment_colour(0))))
        };
        let of_corner = |corner: &PatchCorner| {
            if corner.point >= self.cloth_vertices {
                return [SOLID; 2];
            }
            let [one, other] = corner.parents.map(of_vertex);
            let mean =
                |side: usize, light: usize| [0, 1, 2].map(|i| 0.5 * (one[side][light][i] + other[side][light][i]));
            [0, 1].map(|side| [0, 1].map(|light| mean(side, light)))
        };
        self.fine.corners.iter().map(of_corner).collect()
    }

    /// Draws the rim of cloth, which shows its thickness, and the edges of its triangles.
    fn draw_lines(&self, canvas: &mut Canvas, camera: &Camera, corners: &[[Corner; 2]], wireframe: bool) {
        let drawn = |segment: &&Segment| if wireframe { segment.is_edge } else { segment.is_border };
        for Segment { ends, .. } in self.fine.segments[..self.cloth_segments].iter().filter(drawn) {
            let [from, to] = ends.map(|vertex| {
                let side =
                    usize::from(dot(self.fine.normals[vertex], camera.towards_eye(self.fine.points[vertex])) < 0.0);
                let Corner { place, depth, colour } = corners[vertex][side];
                let colour = if wireframe { EDGE } else { colour.map(|channel| channel + RIM_LIGHT * (1.0 - channel)) };
                Corner { place, depth: BEFORE * depth, colour }
            });
            canvas.line(from, to, if wireframe { LINE } else { RIM });
        }
    }
}

/// Returns the number of parts that make edges of these lengths at most this long, for nine of ten edges.
fn level(lengths: impl Iterator<Item = f64>, longest: f64, triangles: usize) -> usize {
    let mut lengths: Vec<f64> = lengths.filter(|length| length.is_finite()).collect();
    if lengths.is_empty() {
        return 1;
    }
    let place = lengths.len() * 9 / 10;
    let (_, length, _) = lengths.select_nth_unstable_by(place, f64::total_cmp);
    let most = (MOST_TRIANGLES / triangles as f64).sqrt();
    (*length / longest).ceil().min(FINEST).min(most).max(1.0) as usize
}

/// Returns the level of triangles that are small in the picture.
fn level_in_picture(camera: &Camera, points: &[Vector3<f64>], triangles: &[[usize; 3]]) -> usize {
    let length = |[a, b, _]: &[usize; 3]| {
        let [(from, depth), (to, other)] = [*a, *b].map(|vertex| camera.project(points[vertex]));
        (depth > 0.0 && other > 0.0).then(|| (to[0] - from[0]).hypot(to[1] - from[1]))
    };
    level(triangles.iter().filter_map(length), FINE, triangles.len())
}

/// Returns the level of triangles that are small in space.
fn level_in_space(longest: f64, points: &[Vector3<f64>], triangles: &[[usize; 3]]) -> usize {
    let lengths = triangles.iter().map(|&[a, b, _]| norm(subtract(points[b], points[a])));
    level(lengths, longest, triangles.len())
}
