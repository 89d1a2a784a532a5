//! Soft shadows and ambient occlusion: how much of the lamp and of the surroundings each vertex sees.
//!
//! Depth maps are drawn from many directions, and each vertex is looked up in all of them (Williams 1978). Those around
//! the lamp give soft shadows, those of the whole sphere the ambient occlusion.

use std::f64::consts::{PI, TAU};

use energy_dsl::Vector3;

use super::raster::for_each_pixel;
use crate::geometry::{Bounds, add_scaled, cross, dot, norm, subtract};

/// Directions towards the lamp, spread over this angle, in radians.
const LAMP_DIRECTIONS: usize = 12;
const LAMP_ANGLE: f64 = 0.1;
/// Directions of the surroundings.
const SKY_DIRECTIONS: usize = 42;
/// Pixels along each side of a depth map: the shadow of the lamp is sharper than that of the sky.
const LAMP_MAP: usize = 320;
const SKY_MAP: usize = 200;
/// How far from the surface light is looked for, and how deep a shadow begins, in pixels of a depth map.
const LIFT: f64 = 2.0;
const BIAS: f64 = 1.0;
/// Over what depth a shadow reaches its full darkness, in pixels of a depth map.
const RAMP: f64 = 1.5;
/// How often the visible parts are averaged with those of neighbours.
const SMOOTHINGS: usize = 3;

/// Surfaces and hair that cast shadows.
pub(super) struct Occluders<'a> {
    pub points: &'a [Vector3<f64>],
    pub triangles: &'a [[usize; 3]],
    /// Segments of hair.
    pub segments: &'a [[usize; 2]],
}

/// A surface that receives shadows.
pub(super) struct Receivers<'a> {
    pub points: &'a [Vector3<f64>],
    /// Unit normals.
    pub normals: &'a [Vector3<f64>],
    pub triangles: &'a [[usize; 3]],
    /// The wanted sides of each vertex, front and back. Others see everything.
    pub wanted: &'a [[bool; 2]],
}

/// Size of the details of shadows of these points, in m.
pub(super) fn resolution(points: &[Vector3<f64>]) -> f64 {
    DepthMap::over(points, LAMP_MAP).pixel
}

/// Returns the seen part of the lamp, from 0 to 1: for each vertex, on its front and on its back.
pub(super) fn seen_lamp(occluders: &Occluders<'_>, receivers: &Receivers<'_>, lamp: Vector3<f64>) -> Vec<[f32; 2]> {
    seen_parts(occluders, receivers, &lamp_directions(lamp, LAMP_DIRECTIONS), LAMP_MAP)
}

/// Returns the seen part of the surroundings.
pub(super) fn seen_sky(occluders: &Occluders<'_>, receivers: &Receivers<'_>) -> Vec<[f32; 2]> {
    seen_parts(occluders, receivers, &sphere(), SKY_MAP)
}

/// Returns the part of the directions that each vertex sees, weighted by the cosine with its normal.
fn seen_parts(
    occluders: &Occluders<'_>,
    receivers: &Receivers<'_>,
    directions: &[Vector3<f64>],
    size: usize,
) -> Vec<[f32; 2]> {
    let mut sums = vec![[[0.0_f64; 2]; 2]; receivers.points.len()];
    let mut map = DepthMap::over(occluders.points, size);
    for &direction in directions {
        map.draw(occluders, direction);
        for (vertex, sums) in sums.iter_mut().enumerate() {
            let normal = receivers.normals[vertex];
            let cosine = dot(normal, direction);
            // The front sees this direction or the back does.
            let (side, sign) = if cosine >= 0.0 { (0, 1.0) } else { (1, -1.0) };
            if !receivers.wanted[vertex][side] {
                continue;
            }
            let lifted = add_scaled(receivers.points[vertex], sign * LIFT * map.pixel, normal);
            sums[side][0] += cosine.abs() * map.seen(map.place(lifted));
            sums[side][1] += cosine.abs();
        }
    }
    let part = |[seen, all]: [f64; 2]| if all > 0.0 { (seen / all) as f32 } else { 1.0 };
    let mut parts: Vec<[f32; 2]> = sums.into_iter().map(|sides| sides.map(part)).collect();
    (0..SMOOTHINGS).for_each(|_| smooth(&mut parts, receivers.triangles));
    parts
}

/// Moves each value half-way to the mean of its neighbours, which removes the steps between the directions.
fn smooth(parts: &mut [[f32; 2]], triangles: &[[usize; 3]]) {
    let mut sums = vec![[0.0_f32; 3]; parts.len()];
    for corners in triangles {
        for corner in 0..3 {
            let [sum, one, other] = [0, 1, 2].map(|step| corners[(corner + step) % 3]);
            let [one, other] = [parts[one], parts[other]];
            let sum = &mut sums[sum];
            *sum = [sum[0] + one[0] + other[0], sum[1] + one[1] + other[1], sum[2] + 2.0];
        }
    }
    for (part, [front, back, count]) in parts.iter_mut().zip(sums) {
        if count > 0.0 {
            *part = [0.5 * (part[0] + front / count), 0.5 * (part[1] + back / count)];
        }
    }
}

/// Unit vectors evenly spread over the sphere, on a Fibonacci spiral.
fn sphere() -> Vec<Vector3<f64>> {
    let direction = |number: usize| {
        let height = 1.0 - (2 * number + 1) as f64 / SKY_DIRECTIONS as f64;
        let (sine, cosine) = (number as f64 * PI * (3.0 - 5.0_f64.sqrt())).sin_cos();
        let out = (1.0 - height * height).sqrt();
        [out * cosine, out * sine, height]
    };
    (0..SKY_DIRECTIONS).map(direction).collect()
}

/// Unit vectors towards the parts of the lamp, evenly spread over a disc around a direction.
pub(super) fn lamp_directions(direction: Vector3<f64>, count: usize) -> Vec<Vector3<f64>> {
    let [right, up] = across(direction);
    let one = |number: usize| {
        let out = LAMP_ANGLE * ((number as f64 + 0.5) / count as f64).sqrt();
        let (sine, cosine) = (number as f64 * TAU * 0.381_966).sin_cos();
        let tilted = add_scaled(add_scaled(direction, out * cosine, right), out * sine, up);
        tilted.map(|component| component / norm(tilted))
    };
    (0..count).map(one).collect()
}

/// Returns two unit vectors perpendicular to a unit vector and to each other.
fn across(direction: Vector3<f64>) -> [Vector3<f64>; 2] {
    let upright = if direction[2].abs() < 0.9 { [0.0, 0.0, 1.0] } else { [1.0, 0.0, 0.0] };
    let right = cross(upright, direction);
    let right = right.map(|component| component / norm(right));
    [right, cross(direction, right)]
}

/// The parts nearest to a distant light, seen along a direction.
struct DepthMap {
    /// Pixels along each side.
    size: usize,
    centre: Vector3<f64>,
    radius: f64,
    /// Size of a pixel, in m.
    pixel: f64,
    /// To the right, up, and to the light.
    axes: [Vector3<f64>; 3],
    /// The largest coordinate towards the light, in m.
    nearest: Vec<f32>,
}

impl DepthMap {
    fn over(points: &[Vector3<f64>], size: usize) -> Self {
        let bounds = Bounds::of(points);
        let centre = [0, 1, 2].map(|axis| bounds.middle(axis));
        let radius = points.iter().map(|p| norm(subtract(*p, centre))).fold(f64::MIN_POSITIVE, f64::max);
        let pixel = 2.0 * radius / (size - 4) as f64;
        Self { centre, radius, pixel, axes: [[0.0; 3]; 3], size, nearest: vec![f32::NEG_INFINITY; size * size] }
    }

    fn draw(&mut self, occluders: &Occluders<'_>, direction: Vector3<f64>) {
        let [right, up] = across(direction);
        self.axes = [right, up, direction];
        self.nearest.fill(f32::NEG_INFINITY);
        let places: Vec<[f64; 3]> = occluders.points.iter().map(|point| self.place(*point)).collect();
        occluders.triangles.iter().for_each(|corners| self.triangle(corners.map(|corner| places[corner])));
        occluders.segments.iter().for_each(|ends| self.segment(ends.map(|end| places[end])));
    }

    /// Returns the pixel and the coordinate towards the light.
    fn place(&self, point: Vector3<f64>) -> [f64; 3] {
        let offset = subtract(point, self.centre);
        let [x, y, near] = self.axes.map(|axis| dot(axis, offset));
        [(x + self.radius) / self.pixel + 2.0, (y + self.radius) / self.pixel + 2.0, near]
    }

    fn mark(&mut self, column: usize, row: usize, near: f64) {
        if column < self.size && row < self.size {
            let nearest = &mut self.nearest[self.size * row + column];
            *nearest = nearest.max(near as f32);
        }
    }

    fn triangle(&mut self, corners: [[f64; 3]; 3]) {
        let nearest = &mut self.nearest;
        for_each_pixel(corners.map(|[x, y, _]| [x, y]), [self.size; 2], |pixel, parts| {
            let near = parts[0] * corners[0][2] + parts[1] * corners[1][2] + parts[2] * corners[2][2];
            nearest[pixel] = nearest[pixel].max(near as f32);
        });
    }

    fn segment(&mut self, [from, to]: [[f64; 3]; 2]) {
        let steps = (to[0] - from[0]).abs().max((to[1] - from[1]).abs()).ceil().max(1.0);
        for step in 0..=steps as usize {
            let part = step as f64 / steps;
            let [x, y, near] = [0, 1, 2].map(|axis| from[axis] + part * (to[axis] - from[axis]));
            self.mark(x.max(0.0) as usize, y.max(0.0) as usize, near);
        }
    }

    /// Returns the part of the light that the pixels around a place let through.
    fn seen(&self, [x, y, near]: [f64; 3]) -> f64 {
        let [x, y] = [x, y].map(|coordinate| (coordinate - 0.5).clamp(0.0, (self.size - 2) as f64));
        let (column, row) = (x as usize, y as usize);
        let [right, down] = [x - column as f64, y - row as f64];
        let limit = near + BIAS * self.pixel;
        let scale = 1.0 / (RAMP * self.pixel);
        let open = |at: usize| (1.0 - (f64::from(self.nearest[at]) - limit) * scale).clamp(0.0, 1.0);
        let across = |at: usize| open(at) * (1.0 - right) + open(at + 1) * right;
        let first = self.size * row + column;
        across(first) * (1.0 - down) + across(first + self.size) * down
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::vertex_normals;

    /// A grid of 2 m × 2 m at a height, with 21 × 21 vertices.
    fn grid(height: f64, points: &mut Vec<Vector3<f64>>, triangles: &mut Vec<[usize; 3]>, half: f64) {
        let first = points.len();
        let at = |step: usize| half * (0.1 * step as f64 - 1.0);
        points.extend((0..441).map(|n| [at(n % 21), at(n / 21), height]));
        for cell in (0..420).filter(|cell| cell % 21 != 20) {
            let a = first + cell;
            triangles.extend([[a, a + 1, a + 22], [a, a + 22, a + 21]]);
        }
    }

    #[test]
    fn what_is_covered_lies_in_shadow_and_sees_less_of_its_surroundings() {
        let (mut points, mut triangles) = (Vec::new(), Vec::new());
        grid(0.0, &mut points, &mut triangles, 1.0);
        grid(0.2, &mut points, &mut triangles, 0.4);
        let normals = vertex_normals(&points, &triangles);
        let occluders = Occluders { points: &points, triangles: &triangles, segments: &[] };
        let wanted = vec![[true; 2]; 882];
        let receivers = Receivers { points: &points, normals: &normals, triangles: &triangles, wanted: &wanted };
        let above = [0.0, 0.0, 1.0];
        let (lamp, sky) = (seen_lamp(&occluders, &receivers, above), seen_sky(&occluders, &receivers));
        let (middle, corner, cover) = (220, 0, 441 + 220);
        assert!(lamp[middle][0] < 0.01 && lamp[corner][0] > 0.99 && lamp[cover][0] > 0.99);
        assert!(sky[middle][0] < 0.4 && sky[corner][0] > 0.9 && sky[cover][0] > 0.9, "{:?}", sky[middle]);
        // The underside of the cover faces the sheet; that of the sheet is free.
        assert!(sky[cover][1] < 0.5 && sky[middle][1] > 0.9);
        // The shadow begins gradually.
        let row: Vec<f32> = (0..=10).map(|step| lamp[middle + step][0]).collect();
        assert!(row.is_sorted() && row.windows(2).all(|pair| pair[1] - pair[0] < 0.5), "{row:?}");
        // Hair casts shadows, too.
        let hair = [[-1.0, 0.0, 0.3], [1.0, 0.0, 0.3]];
        let with_hair: Vec<_> = points[..441].iter().copied().chain(hair).collect();
        let occluders = Occluders { points: &with_hair, triangles: &triangles[..800], segments: &[[441, 442]] };
        let receivers = Receivers { points: &points[..441], triangles: &triangles[..800], ..receivers };
        let lamp = seen_lamp(&occluders, &receivers, above);
        assert!(lamp[middle][0] < 0.97 && lamp[middle + 6 * 21][0] > 0.99, "{:?}", lamp[middle]);
    }
}
