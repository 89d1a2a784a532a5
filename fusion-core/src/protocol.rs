//! Test data: a body that moves in front of a depth camera, with its true motion, the images, and a body tracker's
//! bones.

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};

use crate::body::{Bone, Mesh, SkinnedBody};
use crate::depth::{Camera, DepthImage, SensorNoise, render, visible_vertices};
use crate::evaluation::{FrameErrors, TrackErrors};
use crate::skeleton::{BoneNoise, noisy};
use crate::tracker::{FrameError, FrameReport, Tracker};

/// A moving body in the camera's coordinates. The first frame is the rest shape.
#[derive(Clone, Debug)]
pub struct Recording {
    /// The body in the first frame.
    pub body: SkinnedBody,
    /// Motions of the bones from the first frame, by frame.
    pub motions: Vec<Vec<Isometry3<f64>>>,
    /// The depth camera.
    pub camera: Camera,
    /// Seed of the random numbers: recordings with different seeds have independent noise.
    pub seed: u64,
}

impl Recording {
    /// Places a camera in front of a body, at `distance` and at the height of the body's centroid. The motions of the
    /// bones are from the body's own rest, with y up. The first bone's z axis points to the front in the first frame.
    #[must_use]
    pub fn new(body: &SkinnedBody, motions: &[Vec<Isometry3<f64>>], camera: Camera, distance: f64) -> Self {
        Self::seen_from(body, motions, camera, distance, 0.0)
    }

    /// Places a camera as [`Self::new`] does, turned about the body by `azimuth` in rad: π/2 sees its left side.
    #[must_use]
    pub fn seen_from(
        body: &SkinnedBody,
        motions: &[Vec<Isometry3<f64>>],
        camera: Camera,
        distance: f64,
        azimuth: f64,
    ) -> Self {
        let Some(first) = motions.first() else {
            return Self { body: body.clone(), motions: Vec::new(), camera, seed: 0 };
        };
        let centroid = body.posed(first).centroid();
        let forwards = first.first().map_or(Vector3::z(), |root| root.rotation * Vector3::z());
        let forwards = Vector3::new(forwards.x, 0.0, forwards.z).try_normalize(1e-9).unwrap_or(Vector3::z());
        let forwards = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), azimuth) * forwards;
        let view = view(centroid + distance * forwards, -forwards);
        let start: Vec<Isometry3<f64>> = first.iter().map(|motion| view * motion).collect();
        let motions = motions
            .iter()
            .map(|frame| frame.iter().zip(&start).map(|(motion, start)| view * motion * start.inverse()).collect())
            .collect();
        Self { body: body.at_rest_in(&start), motions, camera, seed: 0 }
    }

    /// Returns the true mesh in a frame.
    #[must_use]
    pub fn truth(&self, frame: usize) -> Mesh {
        let posed = self.body.posed(&self.motions[frame]);
        Mesh::new(posed.vertices, posed.triangles)
    }

    /// Returns the camera's image of a frame. The noise of a frame is reproducible.
    #[must_use]
    pub fn image(&self, frame: usize, noise: SensorNoise) -> DepthImage {
        let mut image = render(&self.truth(frame), &self.camera);
        noise.add(&mut image, &mut fastrand::Rng::with_seed(self.stream(frame)));
        image
    }

    /// Returns the seed of a frame's random numbers.
    fn stream(&self, frame: usize) -> u64 {
        (self.seed << 32).wrapping_add(frame as u64)
    }
}

/// Returns a pose moved to the place of another one: the root turns about the vertical to the other's heading, and
/// moves horizontally to the other's position. Heights stay, so that a standing pose stays on the floor.
///
/// Motions are from the body's own rest, with y up. The root's z axis points to the front.
///
/// # Panics
/// If a pose lacks the root's motion.
#[must_use]
pub fn at_place_of(bones: &[Bone], pose: &[Isometry3<f64>], other: &[Isometry3<f64>]) -> Vec<Isometry3<f64>> {
    let Some(root) = bones.iter().position(|bone| bone.parent.is_none()) else { return pose.to_vec() };
    let head = bones[root].head.into();
    let [here, there] = [pose, other].map(|motions| motions[root].transform_point(&head).coords);
    let [from, to] = [pose, other].map(|motions| {
        let forwards = motions[root].rotation * Vector3::z();
        forwards.x.atan2(forwards.z)
    });
    let turn = UnitQuaternion::from_axis_angle(&Vector3::y_axis(), to - from);
    let turned = turn * here;
    let shift = Translation3::new(there.x - turned.x, 0.0, there.z - turned.z);
    let place = Isometry3::from_parts(shift, turn);
    pose.iter().map(|motion| place * motion).collect()
}

/// Returns the bones that a body tracker reports: the true motions with errors, which are reproducible for a frame.
#[must_use]
pub fn reported_bones(recording: &Recording, frame: usize, noise: BoneNoise) -> Vec<Isometry3<f64>> {
    let mut random = fastrand::Rng::with_seed(1000 + recording.stream(frame));
    noisy(&recording.body.bones, &recording.motions[frame], noise, &mut random)
}

/// Tracks and measures all frames except the first, which is the model's rest. Calls `each` for every frame. A skipped
/// frame is measured with the tracker's last state.
pub fn track_recording(
    recording: &Recording,
    tracker: &mut Tracker,
    sensor: SensorNoise,
    bones: Option<BoneNoise>,
    mut each: impl FnMut(usize, &Result<FrameReport, FrameError>),
) -> TrackErrors {
    let mut errors = TrackErrors::default();
    for frame in 1..recording.motions.len() {
        let image = recording.image(frame, sensor);
        let reported = bones.map(|noise| reported_bones(recording, frame, noise));
        each(frame, &tracker.track(&image, reported.as_deref()));
        errors.frames.push(measured(recording, frame, &tracker.vertices()));
    }
    errors
}

/// Measures the skinned skeleton without tracking.
#[must_use]
pub fn skeleton_alone(recording: &Recording, noise: BoneNoise) -> TrackErrors {
    let frame =
        |frame| measured(recording, frame, &recording.body.posed(&reported_bones(recording, frame, noise)).vertices);
    TrackErrors { frames: (1..recording.motions.len()).map(frame).collect() }
}

fn measured(recording: &Recording, frame: usize, found: &[Vector3<f64>]) -> FrameErrors {
    let truth = recording.truth(frame);
    FrameErrors::new(found, &truth.vertices, &visible_vertices(&truth, &recording.camera))
}

/// Returns the motion from the world, y up, to a camera that looks along a horizontal direction: x right, y down, z
/// forwards.
fn view(place: Vector3<f64>, along: Vector3<f64>) -> Isometry3<f64> {
    let down = -Vector3::y();
    let right = down.cross(&along);
    let rows = Matrix3::from_rows(&[right.transpose(), down.transpose(), along.transpose()]);
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rows));
    Isometry3::from_parts(Translation3::from(-(rotation * place)), rotation)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::{figure, figure_motion};

    #[test]
    fn a_pose_moves_to_the_place_of_another() {
        let bones = figure().bones;
        let away = Isometry3::new(Vector3::new(0.5, 0.2, -1.5), Vector3::y() * 2.0);
        let other: Vec<_> = figure_motion(1.0).iter().map(|motion| away * motion).collect();
        let moved = at_place_of(&bones, &figure_motion(0.0), &other);
        let head = |motions: &[Isometry3<f64>]| motions[0].transform_point(&bones[0].head.into());
        let (found, wanted) = (head(&moved), head(&other));
        assert!((found.x - wanted.x).abs() < 1e-12 && (found.z - wanted.z).abs() < 1e-12, "{found}, {wanted}");
        assert!((found.y - bones[0].head[1]).abs() < 1e-12, "{found}: the height stays");
        let [a, b] = [&moved, &other].map(|motions| motions[0].rotation * Vector3::z());
        assert!((a.x * b.z - a.z * b.x).abs() < 1e-12 && a.x * b.x + a.z * b.z > 0.0, "{a}, {b}");
    }
}
