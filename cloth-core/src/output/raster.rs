//! A rasteriser with a depth buffer.

use tiny_skia::Pixmap;

/// A picture with a depth buffer.
pub(super) struct Canvas {
    pub pixels: Pixmap,
    /// 1/depth in 1/m; 0 for the background.
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
    pub fn new(pixels: Pixmap) -> Self {
        let nearness = vec![0.0; pixels.width() as usize * pixels.height() as usize];
        Self { pixels, nearness }
    }

    /// Fills a triangle; interpolates colour and 1/depth linearly.
    pub fn triangle(&mut self, corners: [Corner; 3]) {
        let [a, b, c] = corners.map(|corner| corner.place);
        let area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        if !area.is_normal() || corners.iter().any(|corner| corner.depth <= 0.0) {
            return;
        }
        let range = |axis: usize, size: u32| {
            let places = [a[axis], b[axis], c[axis]];
            let low = places.into_iter().fold(f64::INFINITY, f64::min);
            let high = places.into_iter().fold(f64::NEG_INFINITY, f64::max);
            ((low - 0.5).ceil().max(0.0) as usize, ((high + 0.5).ceil().max(0.0) as usize).min(size as usize))
        };
        let (columns, rows) = (range(0, self.pixels.width()), range(1, self.pixels.height()));
        let width = self.pixels.width() as usize;
        // The barycentric weight opposite the edge p → q, and its change per column.
        let weight = |p: [f64; 2], q: [f64; 2], at: [f64; 2]| {
            ((q[0] - p[0]) * (at[1] - p[1]) - (q[1] - p[1]) * (at[0] - p[0])) / area
        };
        let steps = [(b, c), (c, a), (a, b)].map(|(p, q)| (p[1] - q[1]) / area);
        let near = corners.map(|corner| 1.0 / corner.depth);
        let data = self.pixels.data_mut();
        for row in rows.0..rows.1 {
            let first = [columns.0 as f64 + 0.5, row as f64 + 0.5];
            let starts = [weight(b, c, first), weight(c, a, first), weight(a, b, first)];
            for column in columns.0..columns.1 {
                let offset = (column - columns.0) as f64;
                let parts: [f64; 3] = std::array::from_fn(|i| starts[i] + offset * steps[i]);
                // A tiny overlap: rounding leaves no gap between neighbours.
                if parts.iter().any(|part| *part < -1e-9) {
                    continue;
                }
                let nearness: f64 = parts.iter().zip(near).map(|(part, near)| part * near).sum();
                let place = row * width + column;
                if nearness as f32 <= self.nearness[place] {
                    continue;
                }
                self.nearness[place] = nearness as f32;
                for channel in 0..3 {
                    let shade: f64 = (0..3).map(|i| parts[i] * f64::from(corners[i].colour[channel])).sum();
                    data[4 * place + channel] = (255.0 * shade).round().clamp(0.0, 255.0) as u8;
                }
                data[4 * place + 3] = 255;
            }
        }
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
