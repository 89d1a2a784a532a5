//! The shadow on the floor, in the light of each part of the lamp: its edges blur with the distance from the floor.

use energy_dsl::Vector3;
use tiny_skia::Pixmap;

use super::projection::Camera;

/// Colour of the shadow, and its opacity where no part of the lamp is seen.
const INK: [f32; 3] = [0.1, 0.11, 0.14];
const OPACITY: f32 = 0.34;
/// Pixels of the picture per pixel of the shadow, along each side.
const COARSENESS: u32 = 5;

/// The parts of the lamp that each pixel of the floor does not see, at low resolution.
pub(super) struct FloorShadow {
    width: usize,
    height: usize,
    /// Number of parts of the lamp that are hidden.
    hidden: Vec<u16>,
    /// The last part of the lamp, from 1, that a triangle hides.
    last: Vec<u16>,
    parts: u16,
}

impl FloorShadow {
    /// Starts without any part of the lamp, for a picture of this size.
    pub(super) fn new(canvas: &Pixmap) -> Self {
        let (width, height) = ((canvas.width() / COARSENESS) as usize, (canvas.height() / COARSENESS) as usize);
        let pixels = width * height;
        Self { width, height, hidden: vec![0; pixels], last: vec![0; pixels], parts: 0 }
    }

    /// Adds a part of the lamp. `shadow` holds the shadows of all points on the floor.
    pub(super) fn add(
        &mut self,
        camera: &Camera,
        shadow: &[Vector3<f64>],
        triangles: &[[usize; 3]],
        segments: &[([usize; 2], f64)],
    ) {
        self.parts += 1;
        let seen: Vec<([f64; 2], f64)> = shadow
            .iter()
            .map(|point| {
                let (place, depth) = camera.project(*point);
                (place.map(|pixel| pixel / f64::from(COARSENESS)), depth)
            })
            .collect();
        for corners in triangles {
            if corners.iter().all(|&corner| seen[corner].1 > 0.0) {
                self.hide(corners.map(|corner| seen[corner].0));
            }
        }
        for &([from, to], width) in segments {
            let ((from, depth), (to, other)) = (seen[from], seen[to]);
            if depth > 0.0 && other > 0.0 {
                let half = (0.5 * camera.pixels(width, depth) / f64::from(COARSENESS)).max(0.35);
                let length = (to[0] - from[0]).hypot(to[1] - from[1]).max(f64::MIN_POSITIVE);
                let side = [-half * (to[1] - from[1]) / length, half * (to[0] - from[0]) / length];
                let moved = |[x, y]: [f64; 2], sign: f64| [x + sign * side[0], y + sign * side[1]];
                self.hide([moved(from, 1.0), moved(from, -1.0), moved(to, 1.0)]);
                self.hide([moved(from, -1.0), moved(to, -1.0), moved(to, 1.0)]);
            }
        }
    }

    /// Hides the current part of the lamp from a triangle.
    fn hide(&mut self, [a, b, c]: [[f64; 2]; 3]) {
        let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        let range = |axis: usize, size: usize| {
            let (low, high) = (a[axis].min(b[axis]).min(c[axis]), a[axis].max(b[axis]).max(c[axis]));
            ((low - 0.5).ceil().max(0.0) as usize, ((high + 0.5).ceil().max(0.0) as usize).min(size))
        };
        if !area.is_normal() {
            return;
        }
        let (columns, rows) = (range(0, self.width), range(1, self.height));
        let weight = |p: [f64; 2], q: [f64; 2], at: [f64; 2]| {
            ((q[0] - p[0]) * (at[1] - p[1]) - (q[1] - p[1]) * (at[0] - p[0])) / area
        };
        for row in rows.0..rows.1 {
            for column in columns.0..columns.1 {
                let pixel = self.width * row + column;
                let at = [column as f64 + 0.5, row as f64 + 0.5];
                let is_new = self.last[pixel] != self.parts;
                if is_new && [(b, c), (c, a), (a, b)].into_iter().all(|(p, q)| weight(p, q, at) >= -1e-9) {
                    self.last[pixel] = self.parts;
                    self.hidden[pixel] += 1;
                }
            }
        }
    }

    /// Darkens a picture. Bilinear interpolation softens the pixels of the shadow.
    pub(super) fn draw(&self, canvas: &mut Pixmap) {
        let width = canvas.width() as usize;
        let at = |pixel: usize| (pixel as f32 + 0.5) / COARSENESS as f32 - 0.5;
        for (row, pixels) in canvas.data_mut().chunks_exact_mut(4 * width).enumerate() {
            let Some((y, below)) = self.cell(at(row), self.height) else { continue };
            let [upper, lower] = [y, y + 1].map(|row| &self.hidden[self.width * row..][..self.width]);
            if upper.iter().chain(lower).all(|hidden| *hidden == 0) {
                continue;
            }
            for (column, pixel) in pixels.chunks_exact_mut(4).enumerate() {
                let Some((x, right)) = self.cell(at(column), self.width) else { continue };
                let [above, under] = [upper, lower].map(|line| {
                    let [near, far] = [line[x], line[x + 1]].map(f32::from);
                    near + right * (far - near)
                });
                let alpha = OPACITY * (above + below * (under - above)) / f32::from(self.parts.max(1));
                for (byte, ink) in pixel.iter_mut().zip(INK) {
                    *byte = (f32::from(*byte) * (1.0 - alpha) + 255.0 * alpha * ink + 0.5) as u8;
                }
            }
        }
    }

    /// Returns the pixel of the shadow before a coordinate, and the part of the way to the next one; `None` if there is
    /// no next one.
    fn cell(&self, coordinate: f32, count: usize) -> Option<(usize, f32)> {
        let coordinate = coordinate.max(0.0);
        let before = coordinate as usize;
        (before + 1 < count).then_some((before, coordinate - before as f32))
    }
}

#[cfg(test)]
mod tests {
    use super::super::style::camera_on;
    use super::*;
    use crate::scene::Style;

    #[test]
    fn parts_of_the_lamp_add_up_and_overlapping_triangles_do_not() {
        let mut canvas = Pixmap::new(500, 500).unwrap();
        canvas.fill(tiny_skia::Color::WHITE);
        let floor = [[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]];
        let style = Style { size: [250, 250], ..Style::default() };
        let camera = camera_on(&style, &floor);
        let mut shadow = FloorShadow::new(&canvas);
        shadow.add(&camera, &floor, &[[0, 1, 2], [0, 1, 2], [0, 2, 3]], &[]);
        shadow.add(&camera, &floor, &[[0, 1, 2]], &[]);
        shadow.draw(&mut canvas);
        let brightness = |point: Vector3<f64>| {
            let ([x, y], _) = camera.project(point);
            canvas.pixel(x as u32, y as u32).unwrap().green()
        };
        // Both parts are hidden from the first triangle, one from the second, none from the surroundings.
        let [twice, once, never] = [[0.4, -0.4, 0.0], [-0.4, 0.4, 0.0], [-1.6, -1.0, 0.0]].map(brightness);
        let expected = |hidden: f32| (255.0 * (1.0 - OPACITY * hidden * (1.0 - INK[1])) + 0.5) as u8;
        assert_eq!([twice, once, never], [expected(1.0), expected(0.5), 255]);
    }
}
