//! A fit of the model's size to the first image, which shows the model at rest.

use nalgebra::{Matrix4, Vector3, Vector4};

use crate::body::{Bone, Mesh, SkinnedBody};
use crate::correspondence::{Gates, correspondences};
use crate::depth::{Camera, DepthImage, NormalMap, PixelRays};
use crate::energy::{Moved, Pair};
use crate::focal_length::median_distance;
use crate::silhouette::BodyView;

/// A change of size and place with which the model at rest explains the first image much better.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SizeFit {
    /// Factor of the size, about [`Self::centre`].
    pub factor: f64,
    /// Centroid of the model's mesh, in the camera's coordinates, in m.
    pub centre: Vector3<f64>,
    /// Translation of the model, in m.
    pub shift: Vector3<f64>,
    /// Median distance of the model from the image along normals, in m; unmatched vertices count as 0.08 m.
    pub residual: f64,
    /// The same after the fit.
    pub explained: f64,
}

impl SizeFit {
    /// Returns the body with its size and place changed: x becomes c + s (x − c) + d. Motions of bones stay valid,
    /// because they are relative to the true body at rest.
    #[must_use]
    pub fn applied(&self, body: &SkinnedBody) -> SkinnedBody {
        let bones = body.bones.iter().map(|bone| Bone {
            head: self.moved(&bone.head.into()).into(),
            tail: self.moved(&bone.tail.into()).into(),
            ..bone.clone()
        });
        SkinnedBody { mesh: self.mesh(&body.mesh), bones: bones.collect(), weights: body.weights.clone() }
    }

    fn moved(&self, point: &Vector3<f64>) -> Vector3<f64> {
        self.centre + self.factor * (point - self.centre) + self.shift
    }

    fn mesh(&self, mesh: &Mesh) -> Mesh {
        let vertices = mesh.vertices.iter().map(|vertex| self.moved(vertex)).collect();
        Mesh { vertices, normals: mesh.normals.clone(), triangles: mesh.triangles.clone() }
    }
}

/// Distance of a match in the first and in the last search, in m.
const GATES: [f64; 2] = [0.08, 0.03];
/// Searches for matches, each followed by a Gauss–Newton step.
const STEPS: usize = 15;
/// Largest change of the size that is believed.
const MOST_CHANGE: f64 = 0.15;
/// Smallest change that is made: smaller ones do not stand out from noise.
const LEAST_CHANGE: f64 = 0.01;
/// Quotient of the medians from which on the size counts as wrong.
const LEAST_GAIN: f64 = 1.3;

/// Looks for a size and a place with which the model at rest agrees with the first image. Minimises the distances of
/// vertices from measured points along normals, with Tukey's loss, over the factor s and the translation d.
///
/// Returns `None` if the size is right within 1 %, the model differs for another reason, or the camera cannot be used.
/// A wrong focal length stretches the image only sideways; compare [`SizeFit::explained`] with that of
/// [`check_focal_length`](crate::focal_length::check_focal_length).
#[must_use]
pub fn fit_size(body: &SkinnedBody, camera: &Camera, image: &DepthImage) -> Option<SizeFit> {
    let rays = PixelRays::new(*camera).ok()?;
    let residual = median_distance(&body.mesh, &rays, image)?;
    let mut fit =
        SizeFit { factor: 1.0, centre: body.mesh.centroid(), shift: Vector3::zeros(), residual, explained: residual };
    for step in 0..STEPS {
        let part = step as f64 / (STEPS - 1) as f64;
        let gate = GATES[0] * (GATES[1] / GATES[0]).powf(part);
        let change = gauss_newton(&fit, &body.mesh, &rays, image, gate)?;
        fit.factor += change[0];
        fit.shift += change.fixed_rows::<3>(1);
    }
    fit.explained = median_distance(&fit.mesh(&body.mesh), &rays, image)?;
    let change = (fit.factor - 1.0).abs();
    let stands_out = (LEAST_CHANGE..MOST_CHANGE).contains(&change) && residual >= LEAST_GAIN * fit.explained;
    stands_out.then_some(fit)
}

/// Returns the step of the factor and the translation; `None` if too few points match.
fn gauss_newton(fit: &SizeFit, rest: &Mesh, rays: &PixelRays, image: &DepthImage, gate: f64) -> Option<Vector4<f64>> {
    let mesh = fit.mesh(rest);
    let gates = Gates { distance: gate, ..Gates::default() };
    let view = BodyView::new(&mesh, rays.camera());
    let hidden = view.hidden(&mesh.vertices, 0.03);
    let mut normals = NormalMap::new(image, rays, gates.normal_reach);
    let moved = Moved { vertices: mesh.vertices.clone(), normals: mesh.normals.clone() };
    let (mut pairs, _) = correspondences(&moved, &Vector3::zeros(), &mut normals, &gates, &hidden);
    pairs.extend(view.uncovered(&mesh, image, rays, &Vector3::zeros(), gate));
    let (mut matrix, mut right) = (Matrix4::zeros(), Vector4::zeros());
    for Pair { vertex, point } in pairs {
        let (place, normal) = (mesh.vertices[vertex as usize], mesh.normals[vertex as usize]);
        let distance = normal.dot(&(place - point));
        let weight = (1.0 - (distance / gate).powi(2)).max(0.0).powi(2);
        let row =
            Vector4::new(normal.dot(&(rest.vertices[vertex as usize] - fit.centre)), normal.x, normal.y, normal.z);
        matrix += weight * row * row.transpose();
        right -= weight * distance * row;
    }
    Some(matrix.cholesky()?.solve(&right))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::{figure, figure_motion};
    use crate::depth::SensorNoise;
    use crate::protocol::Recording;

    #[test]
    fn a_model_of_the_wrong_size_is_fitted() {
        let recording = Recording::new(&figure(), &[figure_motion(0.0)], Camera::VGA, 2.6);
        let image = recording.image(0, SensorNoise::default());
        let size = |factor: f64| SizeFit {
            factor,
            centre: recording.body.mesh.centroid(),
            shift: Vector3::new(0.005, 0.0, 0.01),
            residual: 0.0,
            explained: 0.0,
        };
        for wrong in [0.93, 0.97, 1.03, 1.07] {
            let body = size(wrong).applied(&recording.body);
            let found = fit_size(&body, &Camera::VGA, &image).unwrap();
            assert!((found.factor * wrong - 1.0).abs() < 0.004, "{wrong}: {found:?}");
            let fitted = found.applied(&body);
            let error = (fitted.mesh.centroid() - recording.body.mesh.centroid()).norm();
            assert!(error < 0.003, "{wrong}: centroid off by {error} m");
            let head = |body: &SkinnedBody| Vector3::from(body.bones.last().unwrap().head);
            assert!((head(&fitted) - head(&recording.body)).norm() < 0.005, "bones follow");
        }
        for right in [0.995, 1.0, 1.005] {
            let mut body = size(right).applied(&recording.body);
            body.mesh.vertices.iter_mut().for_each(|vertex| *vertex -= Vector3::new(0.005, 0.0, 0.01));
            assert_eq!(fit_size(&body, &Camera::VGA, &image), None, "{right}");
        }
    }
}
