//! A built-in figure of tubes with a motion, for trying everything without files.

use std::f64::consts::TAU;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};

use super::mesh::Mesh;
use super::skinned::{Bone, SkinnedBody};

/// A chain of bones inside one closed tube.
struct Limb {
    /// Joints from the root of the chain to its end.
    joints: &'static [[f64; 3]],
    /// Indices of the bones between the joints.
    bones: &'static [usize],
    /// Semi-axes of the tube's cross-section at each joint, sideways and forwards.
    radii: &'static [[f64; 2]],
    /// Vertices around the tube.
    around: usize,
}

const HIPS: usize = 0;
const SPINE: usize = 1;
const CHEST: usize = 2;
const HEAD: usize = 3;

/// Name, parent, head, tail.
type BoneRow = (&'static str, Option<usize>, [f64; 3], [f64; 3]);

/// x to the figure's left, y up, z forwards.
const BONES: [BoneRow; 16] = [
    ("Hips", None, [0.0, 0.95, 0.0], [0.0, 1.08, 0.0]),
    ("Spine", Some(HIPS), [0.0, 1.08, 0.0], [0.0, 1.25, 0.0]),
    ("Chest", Some(SPINE), [0.0, 1.25, 0.0], [0.0, 1.48, 0.0]),
    ("Head", Some(CHEST), [0.0, 1.48, 0.0], [0.0, 1.74, 0.0]),
    ("LeftArm", Some(CHEST), [0.16, 1.40, 0.0], [0.43, 1.40, 0.0]),
    ("LeftForeArm", Some(4), [0.43, 1.40, 0.0], [0.68, 1.40, 0.0]),
    ("LeftHand", Some(5), [0.68, 1.40, 0.0], [0.84, 1.40, 0.0]),
    ("RightArm", Some(CHEST), [-0.16, 1.40, 0.0], [-0.43, 1.40, 0.0]),
    ("RightForeArm", Some(7), [-0.43, 1.40, 0.0], [-0.68, 1.40, 0.0]),
    ("RightHand", Some(8), [-0.68, 1.40, 0.0], [-0.84, 1.40, 0.0]),
    ("LeftUpLeg", Some(HIPS), [0.10, 0.92, 0.0], [0.10, 0.50, 0.0]),
    ("LeftLeg", Some(10), [0.10, 0.50, 0.0], [0.10, 0.10, 0.0]),
    ("LeftFoot", Some(11), [0.10, 0.10, 0.0], [0.10, 0.02, 0.0]),
    ("RightUpLeg", Some(HIPS), [-0.10, 0.92, 0.0], [-0.10, 0.50, 0.0]),
    ("RightLeg", Some(13), [-0.10, 0.50, 0.0], [-0.10, 0.10, 0.0]),
    ("RightFoot", Some(14), [-0.10, 0.10, 0.0], [-0.10, 0.02, 0.0]),
];

const ARM: [[f64; 2]; 4] = [[0.055, 0.060], [0.045, 0.047], [0.032, 0.036], [0.020, 0.042]];
const LEG: [[f64; 2]; 4] = [[0.080, 0.085], [0.058, 0.060], [0.042, 0.050], [0.045, 0.070]];

const LIMBS: [Limb; 5] = [
    Limb {
        joints: &[[0.0, 0.88, 0.0], [0.0, 1.08, 0.0], [0.0, 1.25, 0.0], [0.0, 1.48, 0.0], [0.0, 1.74, 0.0]],
        bones: &[HIPS, SPINE, CHEST, HEAD],
        radii: &[[0.160, 0.110], [0.130, 0.100], [0.165, 0.115], [0.060, 0.065], [0.070, 0.085]],
        around: 28,
    },
    Limb {
        joints: &[[0.14, 1.40, 0.0], [0.43, 1.40, 0.0], [0.68, 1.40, 0.0], [0.84, 1.40, 0.0]],
        bones: &[4, 5, 6],
        radii: &ARM,
        around: 14,
    },
    Limb {
        joints: &[[-0.14, 1.40, 0.0], [-0.43, 1.40, 0.0], [-0.68, 1.40, 0.0], [-0.84, 1.40, 0.0]],
        bones: &[7, 8, 9],
        radii: &ARM,
        around: 14,
    },
    Limb {
        joints: &[[0.10, 0.95, 0.0], [0.10, 0.50, 0.0], [0.10, 0.10, 0.0], [0.10, 0.01, 0.0]],
        bones: &[10, 11, 12],
        radii: &LEG,
        around: 18,
    },
    Limb {
        joints: &[[-0.10, 0.95, 0.0], [-0.10, 0.50, 0.0], [-0.10, 0.10, 0.0], [-0.10, 0.01, 0.0]],
        bones: &[13, 14, 15],
        radii: &LEG,
        around: 18,
    },
];

/// Creates a standing figure with outstretched arms: 1.7 m tall, 16 bones, five closed tubes with about 2800 vertices.
///
/// # Panics
/// Never: the figure is fixed.
#[must_use]
pub fn figure() -> SkinnedBody {
    let bones = BONES.map(|(name, parent, head, tail)| Bone { name: name.into(), parent, head, tail }).to_vec();
    let (mut vertices, mut triangles, mut weights) = (Vec::new(), Vec::new(), Vec::new());
    for limb in &LIMBS {
        limb.build(&mut vertices, &mut triangles, &mut weights);
    }
    SkinnedBody::new(Mesh::new(vertices, triangles), bones, weights).expect("the figure's parts fit")
}

impl Limb {
    /// Builds rings along the chain, closed by a point at each end.
    fn build(
        &self,
        vertices: &mut Vec<Vector3<f64>>,
        triangles: &mut Vec<[u32; 3]>,
        weights: &mut Vec<Vec<(usize, f64)>>,
    ) {
        const SPACING: f64 = 0.022;
        let joints: Vec<Vector3<f64>> = self.joints.iter().map(|&joint| joint.into()).collect();
        let length: f64 = joints.windows(2).map(|pair| (pair[1] - pair[0]).norm()).sum();
        let along = (joints[joints.len() - 1] - joints[0]).normalize();
        let forwards = Vector3::z();
        let sideways = forwards.cross(&along);
        let rings = (length / SPACING).round() as usize;
        let first = vertices.len() as u32;
        for ring in 0..=rings {
            let at = length * ring as f64 / rings as f64;
            let (centre, [a, b], bones) = self.section(&joints, at);
            // Rounded ends.
            let from_end = at.min(length - at) / 0.05;
            let scale = if from_end < 1.0 { (1.0 - (1.0 - from_end).powi(2)).sqrt().max(0.15) } else { 1.0 };
            for step in 0..self.around {
                let angle = TAU * step as f64 / self.around as f64;
                vertices.push(centre + scale * (a * angle.cos() * sideways + b * angle.sin() * forwards));
                weights.push(bones.clone());
            }
        }
        let around = self.around as u32;
        for ring in 0..rings as u32 {
            for step in 0..around {
                let next = (step + 1) % around;
                let [p, q] = [step, next].map(|at| first + ring * around + at);
                let [r, s] = [p + around, q + around];
                triangles.extend([[p, q, r], [q, s, r]]);
            }
        }
        for (ring, end) in [(0, 0), (rings as u32, joints.len() - 1)] {
            let pole = vertices.len() as u32;
            vertices.push(joints[end]);
            weights.push(vec![(self.bones[end.min(self.bones.len() - 1)], 1.0)]);
            for step in 0..around {
                let [p, q] = [step, (step + 1) % around].map(|at| first + ring * around + at);
                triangles.push(if ring == 0 { [pole, q, p] } else { [pole, p, q] });
            }
        }
    }

    /// Returns centre, semi-axes and bone weights at a distance along the chain. Two bones share the weight near a
    /// joint.
    fn section(&self, joints: &[Vector3<f64>], at: f64) -> (Vector3<f64>, [f64; 2], Vec<(usize, f64)>) {
        const SHARED: f64 = 0.06;
        let (mut start, mut segment) = (0.0, 0);
        let length = |i: usize| (joints[i + 1] - joints[i]).norm();
        while segment + 2 < joints.len() && at > start + length(segment) {
            start += length(segment);
            segment += 1;
        }
        let within = at - start;
        let part = (within / length(segment)).min(1.0);
        let centre = joints[segment].lerp(&joints[segment + 1], part);
        let smooth = part * part * (3.0 - 2.0 * part);
        let [near, far] = [self.radii[segment], self.radii[segment + 1]];
        let radii = std::array::from_fn(|i| near[i] + smooth * (far[i] - near[i]));
        let (before, after) = (within, length(segment) - within);
        let mut bones = vec![(self.bones[segment], 1.0)];
        if before < SHARED && segment > 0 {
            let share = 0.5 * (1.0 - before / SHARED);
            bones = vec![(self.bones[segment], 1.0 - share), (self.bones[segment - 1], share)];
        } else if after < SHARED && segment + 1 < self.bones.len() {
            let share = 0.5 * (1.0 - after / SHARED);
            bones = vec![(self.bones[segment], 1.0 - share), (self.bones[segment + 1], share)];
        }
        (centre, radii, bones)
    }
}

/// Returns the motions of the figure's bones at a time in s: it sways, lowers and waves its arms, and bends its knees,
/// with a period of four seconds.
#[must_use]
pub fn figure_motion(time: f64) -> Vec<Isometry3<f64>> {
    let swing = |period: f64, phase: f64| (TAU * (time / period + phase)).sin();
    let start = |period: f64| 0.5 * (1.0 - (TAU * time / period).cos());
    let turn = |axis: Vector3<f64>, angle: f64| UnitQuaternion::from_scaled_axis(axis * angle);
    let (x, y, z) = (Vector3::x(), Vector3::y(), Vector3::z());
    let (bend, lower, wave) = (start(2.0), start(4.0), swing(1.0, 0.0));
    let mut rotations = [UnitQuaternion::identity(); BONES.len()];
    rotations[HIPS] = turn(y, 0.25 * swing(4.0, 0.0));
    rotations[SPINE] = turn(z, 0.10 * swing(2.0, 0.0));
    rotations[CHEST] = turn(x, 0.15 * bend);
    rotations[HEAD] = turn(y, 0.3 * swing(4.0, 0.1) - 0.3 * 0.587_785_252_292_473_1);
    rotations[4] = turn(z, -lower);
    rotations[5] = turn(y, -0.9 * bend);
    rotations[6] = turn(z, 0.2 * wave);
    rotations[7] = turn(z, 0.5 * lower);
    rotations[8] = turn(z, -0.9 * lower) * turn(z, -0.3 * wave * lower);
    for (hip, knee) in [(10, 11), (13, 14)] {
        rotations[hip] = turn(x, -0.5 * bend);
        rotations[knee] = turn(x, 0.9 * bend);
    }
    let drop = 0.42 * (1.0 - (0.5 * bend).cos()) + 0.40 * (1.0 - (0.4 * bend).cos());
    let mut motions: Vec<Isometry3<f64>> = Vec::with_capacity(BONES.len());
    for (bone, (_, parent, head, _)) in BONES.iter().enumerate() {
        let head = Vector3::from(*head);
        let about_head = Isometry3::from_parts(Translation3::from(head - rotations[bone] * head), rotations[bone]);
        let base = match parent {
            Some(parent) => motions[*parent],
            None => Isometry3::translation(0.05 * swing(4.0, 0.0), -drop, 0.0),
        };
        motions.push(base * about_head);
    }
    motions
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_figure_is_closed_and_faces_outwards() {
        let body = figure();
        assert!(body.mesh.vertices.len() > 2000, "{}", body.mesh.vertices.len());
        let volume: f64 = body
            .mesh
            .triangles
            .iter()
            .map(|t| {
                let [a, b, c] = t.map(|v| body.mesh.vertices[v as usize]);
                a.dot(&b.cross(&c)) / 6.0
            })
            .sum();
        assert!((0.04..0.12).contains(&volume), "{volume} m³");
        let mut edges = std::collections::BTreeMap::new();
        for t in &body.mesh.triangles {
            for (a, b) in [(0, 1), (1, 2), (2, 0)] {
                *edges.entry((t[a].min(t[b]), t[a].max(t[b]))).or_insert(0) += if t[a] < t[b] { 1 } else { -1 };
            }
        }
        assert!(edges.values().all(|&balance| balance == 0), "every edge is run along once in each direction");
    }

    #[test]
    fn the_motion_starts_at_rest() {
        for motion in figure_motion(0.0) {
            assert!((motion.to_homogeneous() - nalgebra::Matrix4::identity()).norm() < 1e-12, "{motion}");
        }
        let body = figure();
        let moved = body.posed(&figure_motion(1.0));
        let furthest = moved.vertices.iter().zip(&body.mesh.vertices).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
        assert!((0.3..1.5).contains(&furthest), "{furthest} m");
    }
}
