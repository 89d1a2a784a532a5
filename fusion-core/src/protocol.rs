//! A body that moves in front of a depth camera, as test data: where it truly is, what the camera sees, what a body tracker says.

use nalgebra::{Isometry3, Matrix3, Rotation3, Translation3, UnitQuaternion, Vector3};

use crate::body::{Mesh, SkinnedBody};
use crate::depth::{Camera, DepthImage, SensorNoise, render, visible_vertices};
use crate::evaluation::{FrameErrors, TrackErrors};
use crate::skeleton::{BoneNoise, noisy};
use crate::tracker::{FrameError, FrameReport, Tracker};

/// A moving body in the camera's coordinates. The first frame is the rest shape.
#[derive(Clone, Debug)]
pub struct Recording {
    /// The body as in the first frame.
    pub body: SkinnedBody,
    /// For each frame the motions of the bones from the first.
    pub motions: Vec<Vec<Isometry3<f64>>>,
    /// The camera.
    pub camera: Camera,
}

impl Recording {
    /// Puts a camera `distance` in front of a body whose bones move as given from its own rest, in coordinates whose y points up. In front
    /// is where the first bone's z axis points to in the first frame, at the height of the body's centroid.
    #[must_use]
    pub fn new(body: &SkinnedBody, motions: &[Vec<Isometry3<f64>>], camera: Camera, distance: f64) -> Self {
        let Some(first) = motions.first() else {
            return Self { body: body.clone(), motions: Vec::new(), camera };
        };
        let centroid = body.posed(first).centroid();
        let forwards = first.first().map_or(Vector3::z(), |root| root.rotation * Vector3::z());
        let forwards = Vector3::new(forwards.x, 0.0, forwards.z).try_normalize(1e-9).unwrap_or(Vector3::z());
        let view = view(centroid + distance * forwards, -forwards);
        let start: Vec<Isometry3<f64>> = first.iter().map(|motion| view * motion).collect();
        let motions = motions
            .iter()
            .map(|frame| frame.iter().zip(&start).map(|(motion, start)| view * motion * start.inverse()).collect())
            .collect();
        Self { body: body.at_rest_in(&start), motions, camera }
    }

    /// Where the body truly is.
    #[must_use]
    pub fn truth(&self, frame: usize) -> Mesh {
        let posed = self.body.posed(&self.motions[frame]);
        Mesh::new(posed.vertices, posed.triangles)
    }

    /// What the camera sees. The noise of a frame is always the same.
    #[must_use]
    pub fn image(&self, frame: usize, noise: SensorNoise) -> DepthImage {
        let mut image = render(&self.truth(frame), &self.camera);
        noise.add(&mut image, &mut fastrand::Rng::with_seed(frame as u64));
        image
    }
}

/// What a body tracker says of a recording: the true motions with errors, always the same ones for a frame.
#[must_use]
pub fn reported_bones(recording: &Recording, frame: usize, noise: BoneNoise) -> Vec<Isometry3<f64>> {
    let mut random = fastrand::Rng::with_seed(1000 + frame as u64);
    noisy(&recording.body.bones, &recording.motions[frame], noise, &mut random)
}

/// Tracks all frames but the first, which is the model's rest, and measures each. `each` hears of every frame; a frame that was skipped
/// is measured as the tracker left it.
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

/// The errors of the skinned skeleton without any tracking.
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

/// From the world, y up, to a camera at a place looking along a horizontal direction: x right, y down, z forwards.
fn view(place: Vector3<f64>, along: Vector3<f64>) -> Isometry3<f64> {
    let down = -Vector3::y();
    let right = down.cross(&along);
    let rows = Matrix3::from_rows(&[right.transpose(), down.transpose(), along.transpose()]);
    let rotation = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(rows));
    Isometry3::from_parts(Translation3::from(-(rotation * place)), rotation)
}
