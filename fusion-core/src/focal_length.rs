//! A check of the focal length against the model at rest, which the first image shows.

use nalgebra::Vector3;

use crate::body::{Mesh, SkinnedBody};
use crate::correspondence::{Gates, MatchCounts, correspondences};
use crate::depth::{Camera, DepthImage, NormalMap, PixelRays};
use crate::energy::Moved;
use crate::silhouette::BodyView;

/// A focal length that explains the first image much better than the camera's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FocalSuggestion {
    /// Factor of fx and fy.
    pub factor: f64,
    /// Median distance of the model at rest from the image along normals, in m; unmatched vertices count as the gate.
    pub residual: f64,
    /// The same with the suggested focal lengths.
    pub explained: f64,
}

/// Distance of a match, and of a vertex without one, in m.
const GATE: f64 = 0.08;
/// Vertices of the model that are compared; more do not change a median.
const MOST_VERTICES: usize = 3000;
/// Smallest change that is suggested: smaller ones do not stand out from noise.
const LEAST_CHANGE: f64 = 0.03;
/// Quotient of the medians from which on the focal length counts as wrong.
const LEAST_GAIN: f64 = 2.0;
/// Steps of the search on each side, each a change by 2 %.
const STEPS: i32 = 12;

/// Looks for a factor of the focal lengths with which the model at rest agrees with the first image. Returns a
/// suggestion if the median distance falls to half or less; `None` if the camera is right, the model differs for
/// another reason, or the camera cannot be used.
///
/// A wrong focal length moves the silhouette and the depths of slanted surfaces, which no noise does: the median at the
/// best factor is the sensor's noise.
#[must_use]
pub fn check_focal_length(body: &SkinnedBody, camera: &Camera, image: &DepthImage) -> Option<FocalSuggestion> {
    let distance = |camera: &Camera| median_distance(&body.mesh, &PixelRays::new(*camera).ok()?, image);
    let residual = distance(camera)?;
    let candidate = |step: i32| {
        let factor = 1.02_f64.powi(step);
        let scaled = Camera { fx: factor * camera.fx, fy: factor * camera.fy, ..*camera };
        distance(&scaled).map(|distance| (factor, distance))
    };
    let (factor, explained) =
        (-STEPS..=STEPS).filter_map(candidate).min_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((1.0, residual));
    let stands_out = (factor - 1.0).abs() >= LEAST_CHANGE && residual >= LEAST_GAIN * explained;
    stands_out.then_some(FocalSuggestion { factor, residual, explained })
}

/// Returns the median distance of a mesh's visible vertices from an image, along normals; unmatched ones count as
/// [`GATE`]. `None` if no vertex is visible.
pub(crate) fn median_distance(mesh: &Mesh, rays: &PixelRays, image: &DepthImage) -> Option<f64> {
    let gates = Gates { distance: GATE, ..Gates::default() };
    let mut normals = NormalMap::new(image, rays, gates.normal_reach);
    let hidden = BodyView::new(mesh, rays.camera()).hidden(&mesh.vertices, 0.03);
    let stride = mesh.vertices.len().div_ceil(MOST_VERTICES).max(1);
    let moved = Moved {
        vertices: mesh.vertices.iter().step_by(stride).copied().collect(),
        normals: mesh.normals.iter().step_by(stride).copied().collect(),
    };
    let hidden: Vec<bool> = hidden.into_iter().step_by(stride).collect();
    let (pairs, counts) = correspondences(&moved, &Vector3::zeros(), &mut normals, &gates, &hidden);
    let distance = |pair: &crate::energy::Pair| {
        let vertex = pair.vertex as usize;
        moved.normals[vertex].dot(&(moved.vertices[vertex] - pair.point)).abs()
    };
    let MatchCounts { no_depth, far, turned, outside, .. } = counts;
    let mut distances: Vec<f64> = pairs.iter().map(distance).collect();
    distances.resize(distances.len() + no_depth + far + turned + outside, GATE);
    distances.sort_by(f64::total_cmp);
    distances.get(distances.len() / 2).copied()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::{figure, figure_motion};
    use crate::depth::SensorNoise;
    use crate::protocol::Recording;

    fn scaled(factor: f64) -> Camera {
        Camera { fx: factor * Camera::VGA.fx, fy: factor * Camera::VGA.fy, ..Camera::VGA }
    }

    #[test]
    fn a_focal_length_wrong_by_a_tenth_is_noticed() {
        let recording = Recording::new(&figure(), &[figure_motion(0.0)], Camera::VGA, 2.6);
        for noise in [0.3, 1.0] {
            let image = recording.image(0, SensorNoise { factor: noise, step: 0.001 });
            for wrong in [0.9, 1.1] {
                let found = check_focal_length(&recording.body, &scaled(wrong), &image);
                let found = found.unwrap();
                assert!((found.factor * wrong - 1.0).abs() < 0.02, "{wrong}: {found:?}");
            }
            for slightly in [1.0, 0.99, 1.01] {
                let found = check_focal_length(&recording.body, &scaled(slightly), &image);
                assert_eq!(found, None, "noise {noise}, {slightly}");
            }
        }
    }
}
