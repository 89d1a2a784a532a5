//! The shadow on the floor, in the light of each part of the lamp: its edges blur with the distance from the floor.

use energy_dsl::Vector3;
use tiny_skia::Pixmap;

use super::projection::Camera;
use super::raster::for_each_pixel;

/// Colour of the shadow, and its opacity where no part of the lamp is seen.
const INK: [f32; 3] = [0.1, 0.11, 0.14];
const OPACITY: f32 = 0.34;
/// Pixels of the picture per pixel of the shadow, along each side.
const COARSENESS: u32 = 4;

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
    /// Starts without any part of the lamp, for a view of this size in pixels.
    pub(super) fn new(size: [u32; 2]) -> Self {
        let [width, height] = size.map(|side| side.div_ceil(COARSENESS) as usize + 1);
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
    fn hide(&mut self, corners: [[f64; 2]; 3]) {
        let (hidden, last, part) = (&mut self.hidden, &mut self.last, self.parts);
        for_each_pixel(corners, [self.width, self.height], |pixel, _| {
            if last[pixel] != part {
                last[pixel] = part;
                hidden[pixel] += 1;
            }
        });
    }

    /// Darkens a picture, of `scale` pixels of the view per pixel along each side.
    pub(super) fn draw(&self, canvas: &mut Pixmap, scale: u32) {
        let width = canvas.width() as usize;
        let hidden = self.averaged();
        let at = |pixel: usize| (pixel as f32 + 0.5) * scale as f32 / COARSENESS as f32 - 0.5;
        let opacity = OPACITY / f32::from(self.parts.max(1));
        for (row, pixels) in canvas.data_mut().chunks_exact_mut(4 * width).enumerate() {
            let Some((y, below)) = cell(at(row), self.height) else { continue };
            let [upper, lower] = [y, y + 1].map(|row| &hidden[self.width * row..][..self.width]);
            if upper.iter().chain(lower).all(|hidden| *hidden == 0.0) {
                continue;
            }
            for (column, pixel) in pixels.chunks_exact_mut(4).enumerate() {
                let Some((x, right)) = cell(at(column), self.width) else { continue };
                let [above, under] = [upper, lower].map(|line| line[x] + right * (line[x + 1] - line[x]));
                let alpha = opacity * (above + below * (under - above));
                for (byte, ink) in pixel.iter_mut().zip(INK) {
                    *byte = (f32::from(*byte) * (1.0 - alpha) + 255.0 * alpha * ink + 0.5) as u8;
                }
            }
        }
    }

    /// Averages neighbouring pixels, which removes their steps where the shadow is sharp.
    fn averaged(&self) -> Vec<f32> {
        let mut hidden: Vec<f32> = self.hidden.iter().map(|hidden| f32::from(*hidden)).collect();
        for stride in [1, self.width] {
            let before = hidden.clone();
            let inner = stride..before.len().saturating_sub(stride);
            for pixel in inner {
                hidden[pixel] = 0.25 * (before[pixel - stride] + before[pixel + stride]) + 0.5 * before[pixel];
            }
        }
        hidden
    }
}

/// Returns the pixel of the shadow before a coordinate, and the fraction of the way to the next one; `None` from the
/// last pixel on.
fn cell(coordinate: f32, count: usize) -> Option<(usize, f32)> {
    let coordinate = coordinate.max(0.0);
    let before = coordinate as usize;
    (before + 1 < count).then_some((before, coordinate - before as f32))
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
        let mut shadow = FloorShadow::new([500, 500]);
        shadow.add(&camera, &floor, &[[0, 1, 2], [0, 1, 2], [0, 2, 3]], &[]);
        shadow.add(&camera, &floor, &[[0, 1, 2]], &[]);
        shadow.draw(&mut canvas, 1);
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
