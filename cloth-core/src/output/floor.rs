//! The floor of a picture: a tone with thin lines, which fades into the background with the distance.

use tiny_skia::Pixmap;

use super::projection::Camera;
use super::style::OVERSAMPLING;

/// Brightness of the floor relative to the background, and of its lines relative to the floor.
const TONE: f32 = 0.955;
const LINE: f32 = 0.93;
/// Width of a line relative to the distance of lines.
const WIDTH: f64 = 0.012;
/// Lines in the width of the picture, about.
const LINES: f64 = 9.0;
/// The floor fades between these multiples of its distance at the lower edge of the picture.
const FADE: [f64; 2] = [1.1, 2.6];

/// Draws the floor at a height. From below, the floor is invisible.
pub(super) fn draw_floor(canvas: &mut Pixmap, camera: &Camera, floor: f64) {
    let (width, height) = (canvas.width() as usize, canvas.height() as usize);
    let n = f64::from(OVERSAMPLING);
    let row_at = |row: f64| camera.floor_row(n * row, floor, n * width as f64);
    let Some(nearest) = row_at(height as f64) else { return };
    let spacing = round_length(width as f64 * n * nearest.pixel / LINES);
    for (row, pixels) in canvas.data_mut().chunks_exact_mut(4 * width).enumerate() {
        let (Some(this), Some(next)) = (row_at(row as f64 + 0.5), row_at(row as f64 + 1.5)) else { continue };
        let far = ((this.pixel / nearest.pixel - FADE[0]) / (FADE[1] - FADE[0])).clamp(0.0, 1.0);
        let strength = (1.0 - far * far * (3.0 - 2.0 * far)) as f32;
        if strength == 0.0 {
            continue;
        }
        for (column, pixel) in pixels.chunks_exact_mut(4).enumerate() {
            let across = n * (column as f64 + 0.5);
            let lines = [0, 1].map(|axis| {
                let [at, below] = [this, next].map(|row| row.start[axis] + across * row.step[axis]);
                covered(at, (below - at).abs() + n * this.step[axis].abs(), spacing)
            });
            let light = TONE * (1.0 - (1.0 - LINE) * lines[0].max(lines[1]) as f32);
            let light = 1.0 - strength * (1.0 - light);
            pixel[..3].iter_mut().for_each(|byte| *byte = (f32::from(*byte) * light + 0.5) as u8);
        }
    }
}

/// Returns the part of a pixel with this extent, in m, that lines cover.
fn covered(at: f64, extent: f64, spacing: f64) -> f64 {
    let part = (at / spacing).abs();
    let distance = spacing * (part - (part + 0.5) as u64 as f64).abs();
    let (half, line) = (0.5 * extent, 0.5 * WIDTH * spacing);
    ((distance + half).min(line) - (distance - half).max(-line)).max(0.0) / extent
}

/// Returns 1, 2 or 5 times a power of ten, at most the given length.
fn round_length(length: f64) -> f64 {
    let power = 10.0_f64.powf(length.log10().floor());
    power
        * if length >= 5.0 * power {
            5.0
        } else if length >= 2.0 * power {
            2.0
        } else {
            1.0
        }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_show_the_points_of_the_floor_that_the_camera_projects_there() {
        let camera = Camera::looking([1.0, -2.0, 1.5], [0.2, 0.1, 0.3], 40.0, [800.0, 600.0]);
        for point in [[0.0, 0.0, -0.2], [0.5, 0.3, -0.2], [-1.0, 2.0, -0.2]] {
            let ([x, y], _) = camera.project(point);
            let row = camera.floor_row(y, -0.2, 800.0).unwrap();
            for axis in 0..2 {
                let found = row.start[axis] + x * row.step[axis];
                assert!((found - point[axis]).abs() < 1e-12, "{found} instead of {}", point[axis]);
            }
        }
        // Above the horizon, and from below.
        assert!(camera.floor_row(-1e4, -0.2, 800.0).is_none());
        assert!(camera.floor_row(500.0, 1.6, 800.0).is_none());
    }

    #[test]
    fn lines_cover_their_part_of_pixels_however_small_they_are() {
        let spacing = 0.2;
        for (pixels, start) in [(4000, -1.03), (97, 0.31)] {
            let extent = 5.0 * spacing / f64::from(pixels);
            let sum: f64 = (0..pixels).map(|at| covered(start + (f64::from(at) + 0.5) * extent, extent, spacing)).sum();
            assert!((sum / f64::from(pixels) / WIDTH - 1.0).abs() < 1e-9, "{sum}");
        }
        assert_eq!([0.09, 0.1, 0.34, 7.9].map(round_length), [0.05, 0.1, 0.2, 5.0]);
    }
}
