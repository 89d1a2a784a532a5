//! Bones from the joints of body trackers.

use std::path::Path;

use fusion_core::body::{Bone, figure, figure_motion};
use fusion_core::skeleton::JointTrack;
use nalgebra::{Isometry3, Vector3};
use serde_json::{Value, json};

/// Joints of Azure Kinect: name, the bone that begins there (or ends, at its tail), and whether it is the tail.
const KINECT: [(&str, &str, bool); 20] = [
    ("PELVIS", "Hips", false),
    ("SPINE_NAVEL", "Spine", false),
    ("SPINE_CHEST", "Chest", false),
    ("NECK", "Chest", true),
    ("HEAD", "Head", false),
    ("CLAVICLE_LEFT", "LeftArm", false),
    ("SHOULDER_LEFT", "LeftArm", false),
    ("ELBOW_LEFT", "LeftForeArm", false),
    ("WRIST_LEFT", "LeftHand", false),
    ("HANDTIP_LEFT", "LeftHand", true),
    ("HIP_LEFT", "LeftUpLeg", false),
    ("KNEE_LEFT", "LeftLeg", false),
    ("CLAVICLE_RIGHT", "RightArm", false),
    ("SHOULDER_RIGHT", "RightArm", false),
    ("ELBOW_RIGHT", "RightForeArm", false),
    ("WRIST_RIGHT", "RightHand", false),
    ("HANDTIP_RIGHT", "RightHand", true),
    ("HIP_RIGHT", "RightUpLeg", false),
    ("KNEE_RIGHT", "RightLeg", false),
    ("NOSE", "Head", true),
];
/// Joints that the table lacks: feet, and ears at the sides of the head.
const MORE: [(&str, &str, [f64; 3]); 6] = [
    ("ANKLE_LEFT", "LeftFoot", [0.10, 0.10, 0.0]),
    ("FOOT_LEFT", "LeftFoot", [0.10, 0.02, 0.12]),
    ("ANKLE_RIGHT", "RightFoot", [-0.10, 0.10, 0.0]),
    ("FOOT_RIGHT", "RightFoot", [-0.10, 0.02, 0.12]),
    ("EAR_LEFT", "Head", [0.07, 1.62, 0.0]),
    ("EAR_RIGHT", "Head", [-0.07, 1.62, 0.0]),
];

/// The true joints of the figure in mm, and the true motions of its bones.
fn kinect(times: &[f64]) -> (Value, Vec<Vec<Isometry3<f64>>>) {
    let bones = figure().bones;
    let at = |name: &str| bones.iter().position(|bone| bone.name == name).unwrap();
    let mut joints: Vec<(&str, usize, Vector3<f64>)> = Vec::new();
    for (name, bone, tail) in KINECT {
        let Bone { head, tail: end, .. } = &bones[at(bone)];
        joints.push((name, at(bone), Vector3::from(if tail { *end } else { *head })));
    }
    joints.extend(MORE.map(|(name, bone, place)| (name, at(bone), place.into())));
    let motions: Vec<_> = times.iter().map(|&time| figure_motion(time)).collect();
    let frame = |motions: &Vec<Isometry3<f64>>| -> Vec<[f64; 3]> {
        joints
            .iter()
            .map(|(_, bone, place)| (1e3 * motions[*bone].transform_point(&(*place).into()).coords).into())
            .collect()
    };
    let orientations = |motions: &Vec<Isometry3<f64>>| -> Vec<[f64; 4]> {
        let numbers = |bone: usize| {
            let q = motions[bone].rotation;
            [q.w, q.i, q.j, q.k]
        };
        joints.iter().map(|(_, bone, _)| numbers(*bone)).collect()
    };
    let file = json!({
        "joints": joints.iter().map(|joint| format!("K4ABT_JOINT_{}", joint.0)).collect::<Vec<_>>(),
        "positions": motions.iter().map(frame).collect::<Vec<_>>(),
        "orientations": motions.iter().map(orientations).collect::<Vec<_>>(),
        "units_per_metre": 1000,
        "tracker": "azure-kinect",
    });
    (file, motions)
}

const PATH: &str = "joints.json";

fn parsed(file: &Value) -> JointTrack {
    serde_json::from_value(file.clone()).unwrap()
}

/// Largest distance of the figure's vertices from the true ones in a frame, in mm.
fn largest_error(file: &Value, truth: &[Vec<Isometry3<f64>>], frame: usize) -> f64 {
    let body = figure();
    let skeleton = parsed(file).skeleton(Path::new(PATH), &body.bones, None).unwrap();
    let motions = skeleton.motions(frame, &body.bones).unwrap().unwrap();
    let (found, truth) = (body.posed(&motions).vertices, body.posed(&truth[frame]).vertices);
    found.iter().zip(&truth).map(|(a, b)| 1e3 * (a - b).norm()).fold(0.0, f64::max)
}

#[test]
fn joints_of_azure_kinect_move_the_bones() {
    let (mut file, truth) = kinect(&[0.0, 0.4, 1.1]);
    for frame in [0, 1, 2] {
        assert!(largest_error(&file, &truth, frame) < 1.0, "{}", largest_error(&file, &truth, frame));
    }
    // Positions leave the rotation about a limb open, but keep its axis. The bent elbow twists by 20° at most.
    file.as_object_mut().unwrap().remove("orientations");
    assert!(largest_error(&file, &truth, 0) < 1e-9);
    for frame in [1, 2] {
        let error = largest_error(&file, &truth, frame);
        assert!(error < 25.0, "frame {frame}: {error} mm");
    }
}

#[test]
fn missing_joints_leave_bones_with_their_parents() {
    let (mut file, _) = kinect(&[0.0, 0.4, 0.8]);
    let body = figure();
    let joint = |name: &str| file["joints"].as_array().unwrap().iter().position(|j| j.as_str() == Some(name)).unwrap();
    let (pelvis, wrist) = (joint("K4ABT_JOINT_PELVIS"), joint("K4ABT_JOINT_WRIST_LEFT"));
    file["positions"][1][wrist] = Value::Null;
    file["positions"][2][pelvis] = Value::Null;
    let skeleton = parsed(&file).skeleton(Path::new(PATH), &body.bones, None).unwrap();
    let at = |name: &str| body.bones.iter().position(|bone| bone.name == name).unwrap();
    let motions = skeleton.motions(1, &body.bones).unwrap().unwrap();
    assert_eq!(motions[at("LeftHand")], motions[at("LeftArm")]);
    assert_ne!(motions[at("RightHand")], motions[at("RightArm")]);
    assert!(skeleton.motions(2, &body.bones).unwrap().is_none(), "no root, no bones");
}

#[test]
fn the_rest_is_the_frame_of_the_first_image() {
    let (mut file, _) = kinect(&[0.7, 0.0, 0.4]);
    file["timestamps"] = json!([9.0, 10.001, 10.4]);
    let body = figure();
    let skeleton = parsed(&file).skeleton(Path::new(PATH), &body.bones, Some(&[10.0, 10.4])).unwrap();
    let images = skeleton.for_images(Path::new(PATH), 2, Some(&[10.0, 10.4])).unwrap();
    let rest = images.motions(0, &body.bones).unwrap().unwrap();
    assert!(rest.iter().all(|motion| (motion.to_homogeneous() - nalgebra::Matrix4::identity()).norm() < 1e-9));
    let error = parsed(&file).skeleton(Path::new(PATH), &body.bones, Some(&[20.0, 20.1])).unwrap_err().to_string();
    assert!(error.contains("first image") && error.contains("clock"), "{error}");
}

/// Changes the file and asserts that it is refused.
fn refused(change: impl FnOnce(&mut Value), parts: &[&str]) {
    let (mut file, _) = kinect(&[0.0, 0.4]);
    change(&mut file);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(PATH);
    std::fs::write(&path, file.to_string()).unwrap();
    let skeleton = JointTrack::read(&path).and_then(|track| track.skeleton(&path, &figure().bones, None));
    let error = energy_cli::message(&skeleton.unwrap_err().into());
    assert!(error.contains(PATH) && parts.iter().all(|part| error.contains(part)), "{parts:?} not in: {error}");
}

#[test]
fn files_that_do_not_fit_are_refused() {
    refused(|file| file["joints"][0] = "HIPS".into(), &["bone `Hips` needs the joint `pelvis`"]);
    refused(|file| file["positions"][1] = json!([[0, 0, 0]]), &["frame 1: expected 26 positions", "got 1"]);
    refused(|file| file["positions"][0][7] = Value::Null, &["frame 0", "`LeftArm`", "at rest"]);
    refused(|file| file["orientations"] = json!([]), &["orientations for 2 frames of 26 joints"]);
    refused(|file| file["units_per_metre"] = 0.into(), &["units_per_metre", "got 0"]);
    refused(|file| file["mapping"] = json!({}), &["either `tracker`", "or `mapping`"]);
    refused(|file| file["position"] = json!([]), &["unknown field `position`"]);
    let mapped = |mapping: Value| {
        move |file: &mut Value| {
            file.as_object_mut().unwrap().remove("tracker");
            file["mapping"] = mapping;
        }
    };
    let arm = json!({"head": ["SHOULDER_LEFT"], "tail": ["ELBOW_LEFT"]});
    refused(mapped(json!({"Arm": arm})), &["no bone `Arm`", "LeftArm"]);
    refused(mapped(json!({"LeftArm": arm})), &["lacks `Hips`"]);
    refused(mapped(json!({"Hips": {"head": [], "tail": ["NECK"]}})), &["`Hips` needs at least one joint"]);
}
