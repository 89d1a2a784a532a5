//! Triangles as pixels, and a picture with a depth buffer.

use tiny_skia::Pixmap;

/// A picture with a depth buffer.
pub(super) struct Canvas {
    pub pixels: Pixmap,
    /// 1/depth in 1/m; 0 for transparent pixels.
    nearness: Vec<f32>,
}

/// A projected corner: position in pixels, depth in m, colour.
#[derive(Clone, Copy)]
pub(super) struct Corner {
    pub place: [f64; 2],
    pub depth: f64,
    pub colour: [f32; 3],
}

impl Canvas {
    /// Starts with these transparent pixels.
    pub fn new(pixels: Pixmap) -> Self {
        let nearness = vec![0.0; pixels.width() as usize * pixels.height() as usize];
        Self { pixels, nearness }
    }

    /// Fills a triangle; interpolates colour and 1/depth linearly.
    pub fn triangle(&mut self, corners: [Corner; 3]) {
        if corners.iter().any(|corner| corner.depth <= 0.0) {
            return;
        }
        let near = corners.map(|corner| 1.0 / corner.depth);
        let colours = corners.map(|corner| corner.colour.map(|channel| 255.0 * channel));
        let size = [self.pixels.width(), self.pixels.height()].map(|side| side as usize);
        let (data, nearest) = (self.pixels.data_mut(), &mut self.nearness);
        for_each_pixel(corners.map(|corner| corner.place), size, |place, parts| {
            let nearness = (parts[0] * near[0] + parts[1] * near[1] + parts[2] * near[2]) as f32;
            if nearness <= nearest[place] {
                return;
            }
            nearest[place] = nearness;
            let parts = parts.map(|part| part as f32);
            let pixel = &mut data[4 * place..4 * place + 4];
            for channel in 0..3 {
                let shade: f32 = (0..3).map(|corner| parts[corner] * colours[corner][channel]).sum();
                pixel[channel] = (shade + 0.5) as u8;
            }
            pixel[3] = 255;
        });
    }

    /// Draws a line with this width, in pixels.
    pub fn line(&mut self, from: Corner, to: Corner, width: f64) {
        let offset = [to.place[0] - from.place[0], to.place[1] - from.place[1]];
        let length = offset[0].hypot(offset[1]);
        if length == 0.0 {
            return;
        }
        let side = [-0.5 * width * offset[1] / length, 0.5 * width * offset[0] / length];
        let moved = |corner: Corner, sign: f64| {
            let place = [corner.place[0] + sign * side[0], corner.place[1] + sign * side[1]];
            Corner { place, ..corner }
        };
        self.triangle([moved(from, 1.0), moved(from, -1.0), moved(to, 1.0)]);
        self.triangle([moved(from, -1.0), moved(to, -1.0), moved(to, 1.0)]);
    }
}

/// Barycentric weights from which on a point lies in a triangle: the tiny overlap leaves no gap between neighbours,
/// in spite of rounding.
const INSIDE: f64 = -1e-9;

/// Calls a function with each pixel whose centre lies in a triangle, and the barycentric weights of the corners.
/// Pixels are numbered row by row.
pub(super) fn for_each_pixel([a, b, c]: [[f64; 2]; 3], size: [usize; 2], mut visit: impl FnMut(usize, [f64; 3])) {
    let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    if !area.is_normal() {
        return;
    }
    let range = |axis: usize| {
        let (low, high) = (a[axis].min(b[axis]).min(c[axis]), a[axis].max(b[axis]).max(c[axis]));
        ((low - 0.5).max(0.0) as usize, ((high + 0.5).max(0.0) as usize).min(size[axis]))
    };
    let (columns, rows) = (range(0), range(1));
    if columns.0 >= columns.1 {
        return;
    }
    let part = 1.0 / area;
    // The changes of the weights per column.
    let [second, third] = [(c[1] - a[1]) * part, (a[1] - b[1]) * part];
    let steps = [-second - third, second, third];
    let inverses = steps.map(|step| 1.0 / step);
    for row in rows.0..rows.1 {
        let [x, y] = [columns.0 as f64 + 0.5 - a[0], row as f64 + 0.5 - a[1]];
        let second = (x * (c[1] - a[1]) - y * (c[0] - a[0])) * part;
        let third = (y * (b[0] - a[0]) - x * (b[1] - a[1])) * part;
        let starts = [1.0 - second - third, second, third];
        let (from, to) = inside(starts, steps, inverses, columns.1 - columns.0);
        for column in from..to {
            let weights = [0, 1, 2].map(|corner| starts[corner] + column as f64 * steps[corner]);
            visit(row * size[0] + columns.0 + column, weights);
        }
    }
}

/// Returns the range of the columns, below a number of them, where all weights say that the point lies inside.
fn inside(starts: [f64; 3], steps: [f64; 3], inverses: [f64; 3], count: usize) -> (usize, usize) {
    let (mut from, mut to) = (0.0, (count - 1) as f64);
    for corner in 0..3 {
        let bound = (INSIDE - starts[corner]) * inverses[corner];
        if steps[corner] > 0.0 {
            from = if bound > from { bound } else { from };
        } else if steps[corner] < 0.0 {
            to = if bound < to { bound } else { to };
        } else if starts[corner] < INSIDE {
            return (0, 0);
        }
    }
    let first = from as usize;
    (first + usize::from((first as f64) < from), if to < 0.0 { 0 } else { to as usize + 1 })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn triangles_cover_the_pixels_inside_once_with_the_weights_of_their_corners() {
        // Two triangles of a quadrilateral, whose common edge passes between pixels, reach beyond the picture.
        let corners = [[-3.3, 2.1], [17.9, -4.2], [23.4, 15.7], [4.1, 19.2]];
        let size = [20, 16];
        let mut covered = vec![0; size[0] * size[1]];
        for triangle in [[0, 1, 2], [0, 2, 3]].map(|numbers| numbers.map(|number: usize| corners[number])) {
            for_each_pixel(triangle, size, |pixel, weights| {
                covered[pixel] += 1;
                let centre = [(pixel % size[0]) as f64 + 0.5, (pixel / size[0]) as f64 + 0.5];
                for axis in 0..2 {
                    let mean: f64 = (0..3).map(|corner| weights[corner] * triangle[corner][axis]).sum();
                    assert!((mean - centre[axis]).abs() < 1e-9, "{pixel}: {weights:?}");
                }
            });
        }
        for (pixel, count) in covered.into_iter().enumerate() {
            let [x, y] = [(pixel % size[0]) as f64 + 0.5, (pixel / size[0]) as f64 + 0.5];
            let is_inside = (0..4).all(|from| {
                let ([a, b], [c, d]) = (corners[from], corners[(from + 1) % 4]);
                (c - a) * (y - b) - (d - b) * (x - a) > 0.0
            });
            assert_eq!(count, i32::from(is_inside), "{x}, {y}");
        }
        // Flat and invalid ones cover nothing.
        for flat in [[[0.0; 2], [5.0; 2], [9.0; 2]], [[f64::NAN; 2], [5.0, 1.0], [9.0, 8.0]]] {
            for_each_pixel(flat, size, |pixel, _| panic!("{pixel}"));
        }
    }
}
