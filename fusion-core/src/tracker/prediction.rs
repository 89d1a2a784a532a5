//! Motions predicted from the last frames.

use nalgebra::{Isometry3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};

use super::state::StoredMotion;

/// Predicts rigid motions at constant velocity: the velocity part of an α–β filter, whose position part is the energy's
/// minimum.
#[derive(Clone, Debug)]
pub(super) struct Prediction {
    /// Points at rest that the motions rotate about, in m.
    centres: Vec<Vector3<f64>>,
    last: Vec<Isometry3<f64>>,
    velocities: Vec<Velocity>,
}

/// A change per frame.
#[derive(Clone, Copy, Debug, Default)]
struct Velocity {
    /// Translation of the centre, in m.
    shift: Vector3<f64>,
    /// Rotation vector, in rad.
    turn: Vector3<f64>,
}

/// Stored state of a prediction: motions of the last frame, and velocities.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PredictionState {
    last: Vec<StoredMotion>,
    /// Changes per frame: translation in m, then rotation vector in rad.
    velocities: Vec<[f64; 6]>,
}

impl PredictionState {
    /// Returns the numbers of motions and velocities.
    pub(super) fn lengths(&self) -> [usize; 2] {
        [self.last.len(), self.velocities.len()]
    }

    /// Returns all numbers.
    pub(super) fn numbers(&self) -> impl Iterator<Item = f64> {
        self.last.iter().flat_map(|motion| motion.0).chain(self.velocities.as_flattened().iter().copied())
    }
}

impl Prediction {
    /// Gain β: the part of a velocity's error that one frame corrects.
    const GAIN: f64 = 0.5;
    /// Factor of the velocity in each frame without data, so that a lost body comes to rest.
    const DECAY: f64 = 0.8;

    /// Creates a prediction of motions at rest.
    pub(super) fn new(centres: Vec<Vector3<f64>>) -> Self {
        let last = vec![Isometry3::identity(); centres.len()];
        let velocities = vec![Velocity::default(); centres.len()];
        Self { centres, last, velocities }
    }

    /// Returns the number of motions.
    pub(super) fn len(&self) -> usize {
        self.last.len()
    }

    /// Returns what the last frames have left.
    pub(super) fn state(&self) -> PredictionState {
        let numbers = |Velocity { shift, turn }: &Velocity| [shift.x, shift.y, shift.z, turn.x, turn.y, turn.z];
        PredictionState {
            last: self.last.iter().map(StoredMotion::from).collect(),
            velocities: self.velocities.iter().map(numbers).collect(),
        }
    }

    /// Continues from a state of the same length.
    pub(super) fn restore(&mut self, state: &PredictionState) {
        self.last = state.last.iter().map(|&motion| motion.into()).collect();
        let velocity =
            |[a, b, c, d, e, f]: [f64; 6]| Velocity { shift: Vector3::new(a, b, c), turn: Vector3::new(d, e, f) };
        self.velocities = state.velocities.iter().map(|&numbers| velocity(numbers)).collect();
    }

    /// Returns the motions expected in the next frame.
    pub(super) fn next(&self) -> Vec<Isometry3<f64>> {
        let one = |((centre, last), velocity): ((&Vector3<f64>, &Isometry3<f64>), &Velocity)| {
            let turn = UnitQuaternion::from_scaled_axis(velocity.turn) * last.rotation;
            let place = last.transform_point(&(*centre).into()).coords + velocity.shift;
            Isometry3::from_parts((place - turn * centre).into(), turn)
        };
        self.centres.iter().zip(&self.last).zip(&self.velocities).map(one).collect()
    }

    /// Takes the motions that were found where `expected` was predicted.
    pub(super) fn update(&mut self, expected: &[Isometry3<f64>], found: &[Isometry3<f64>]) {
        for (i, (expected, found)) in expected.iter().zip(found).enumerate() {
            let centre = self.centres[i].into();
            let shift = found.transform_point(&centre) - expected.transform_point(&centre);
            let turn = (found.rotation * expected.rotation.inverse()).scaled_axis();
            self.velocities[i].shift += Self::GAIN * shift;
            self.velocities[i].turn += Self::GAIN * turn;
        }
        self.last.copy_from_slice(found);
    }

    /// Slows down, after a frame without data.
    pub(super) fn slow_down(&mut self) {
        for velocity in &mut self.velocities {
            velocity.shift *= Self::DECAY;
            velocity.turn *= Self::DECAY;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A point 1 m from the origin that moves along y and turns about z.
    fn motion(frame: f64) -> Isometry3<f64> {
        let turn = UnitQuaternion::from_scaled_axis(Vector3::z() * (0.1 * frame));
        let place = Vector3::new(1.0, 0.02 * frame, 0.0);
        Isometry3::from_parts((place - turn * Vector3::x()).into(), turn)
    }

    #[test]
    fn a_steady_motion_is_predicted() {
        let mut prediction = Prediction::new(vec![Vector3::x()]);
        for frame in 1..=20 {
            let expected = prediction.next();
            prediction.update(&expected, &[motion(f64::from(frame))]);
        }
        let error = prediction.next()[0].to_homogeneous() - motion(21.0).to_homogeneous();
        assert!(error.norm() < 1e-5, "{error}");
    }

    #[test]
    fn a_lost_body_comes_to_rest() {
        let mut prediction = Prediction::new(vec![Vector3::zeros()]);
        prediction.velocities[0].shift = Vector3::x() * 0.03;
        for _ in 0..200 {
            let expected = prediction.next();
            prediction.update(&expected, &expected);
            prediction.slow_down();
        }
        let way = prediction.last[0].translation.vector.x;
        assert!((way - 0.15).abs() < 1e-9, "0.03 m / (1 - 0.8), got {way} m");
    }
}
