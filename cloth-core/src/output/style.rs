//! The looks of pictures that a scene's choice of style stands for.

use energy_dsl::Vector3;

use super::projection::Camera;
use crate::scene::{Style, Viewpoint};

/// Direction from the cloth to the eye.
const VIEW: Vector3<f64> = [0.62, -1.0, 0.28];

/// RGB colours of garments without one of their own (cyclic), from 0 to 1, as screens show them.
const GARMENTS: [[f32; 3]; 5] =
    [[0.40, 0.66, 0.86], [0.86, 0.47, 0.36], [0.47, 0.70, 0.49], [0.90, 0.72, 0.38], [0.65, 0.52, 0.78]];

/// Returns the colour of the garment of this number, from 0.
pub(super) fn garment_colour(number: usize) -> [f32; 3] {
    GARMENTS[number % GARMENTS.len()]
}

/// Supersampling factor: anti-aliases without seams between triangles.
pub(super) const OVERSAMPLING: u32 = 2;

/// Size of a picture before downsampling, in pixels.
fn canvas(style: &Style) -> [f64; 2] {
    style.size.map(|pixels| f64::from(pixels * OVERSAMPLING))
}

/// Returns the chosen camera, or one that frames the points, with some space around them.
pub(super) fn camera_on(style: &Style, points: &[Vector3<f64>]) -> Camera {
    match style.viewpoint {
        Some(Viewpoint { eye, target, angle }) => Camera::looking(eye, target, angle, canvas(style)),
        None => Camera::framing(points, VIEW, canvas(style), 0.86),
    }
}

/// Whether a point lies well within the picture. A chosen camera decides what it shows.
pub(super) fn is_visible(style: &Style, camera: &Camera, point: Vector3<f64>) -> bool {
    let (place, depth) = camera.project(point);
    let size = canvas(style);
    style.viewpoint.is_some() || depth > 0.0 && (0..2).all(|axis| (0.02..=0.98).contains(&(place[axis] / size[axis])))
}

/// Returns the linear colour of one as screens show it (sRGB).
pub(super) fn linear(colour: [f32; 3]) -> [f32; 3] {
    colour.map(|c| if c <= 0.040_45 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) })
}
