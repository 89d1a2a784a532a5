//! The protocol on a scanned body and captured motion, if the data is available: `base.obj`, `rig.cmu_mb.json`,
//! `weights.cmu_mb.json` and `01_01.bvh` in the folder `FUSION_BODY`, or in a folder `human` next to the workspace.

use std::path::{Path, PathBuf};

use fusion_core::body::read_makehuman;
use fusion_core::depth::{Camera, SensorNoise};
use fusion_core::evaluation::TrackErrors;
use fusion_core::model::{DeformationModel, ModelOptions};
use fusion_core::protocol::{Recording, skeleton_alone, track_recording};
use fusion_core::skeleton::{BoneNoise, Bvh, Retarget};
use fusion_core::tracker::{Tracker, TrackerOptions};

fn folder() -> Option<PathBuf> {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../shared/data/human");
    let folder = std::env::var_os("FUSION_BODY").map_or(beside, PathBuf::from);
    folder.join("base.obj").exists().then_some(folder)
}

/// A jump, frames 420 to 660 at 30 Hz, with a camera at 2.6 m.
fn recording(folder: &Path) -> Recording {
    let file = |name: &str| folder.join(name);
    let body = read_makehuman(&file("base.obj"), &file("rig.cmu_mb.json"), &file("weights.cmu_mb.json")).unwrap();
    assert_eq!((body.mesh.vertices.len(), body.bones.len()), (13_380, 31));
    let motion = Bvh::read(&file("01_01.bvh")).unwrap();
    let retarget = Retarget::new(&body.bones, &motion).unwrap();
    let frames: Vec<_> = (420..=660).step_by(4).map(|frame| retarget.motions(frame).unwrap()).collect();
    Recording::new(&body, &frames, Camera::VGA, 2.6)
}

fn run(recording: &Recording, options: TrackerOptions, noise: BoneNoise, name: &str) -> TrackErrors {
    let model = DeformationModel::new(&recording.body, ModelOptions::default()).unwrap();
    let mut tracker = Tracker::new(model, recording.camera, options).unwrap();
    let errors = track_recording(recording, &mut tracker, SensorNoise::default(), Some(noise), |frame, result| {
        assert!(result.is_ok(), "frame {frame}: {}", result.as_ref().unwrap_err());
    });
    for (what, errors) in [("tracked", &errors), ("skeleton alone", &skeleton_alone(recording, noise))] {
        let one = errors.all();
        println!(
            "{name}, {what}: mean {:.2} mm, median {:.2} mm, 95 % {:.1} mm, share < 25 mm {:.3}",
            one.mean, one.median, one.p95, one.share_below_25
        );
    }
    errors
}

#[test]
fn a_real_body_is_tracked() {
    let Some(folder) = folder() else {
        eprintln!("skipped: no data of a real body; name its folder in FUSION_BODY");
        return;
    };
    let recording = recording(&folder);
    assert_eq!(recording.motions.len(), 61);
    let exact = run(&recording, TrackerOptions::default(), BoneNoise::default(), "exact bones").all();
    assert!(exact.median <= 3.0 && exact.mean <= 6.0, "{exact:?}");
    let noise = BoneNoise { turn: 5.0_f64.to_radians(), shift: 0.02 };
    let noisy = run(&recording, TrackerOptions::with_unknown_bones(), noise, "noisy bones").all();
    assert!(noisy.median <= 9.0 && noisy.p95 <= 60.0 && noisy.share_below_25 >= 0.85, "{noisy:?}");
}
