//! The protocol on a scanned body: `cargo run --release -p fusion-core --example real_body -- FOLDER`.
use std::path::PathBuf;
use std::time::Instant;

use fusion_core::body::read_makehuman;
use fusion_core::depth::{Camera, SensorNoise};
use fusion_core::energy::{BoneMode, TermWeights};
use fusion_core::evaluation::TrackErrors;
use fusion_core::model::{DeformationModel, ModelOptions};
use fusion_core::protocol::{Recording, skeleton_alone, track_recording};
use fusion_core::skeleton::{BoneNoise, Bvh, Retarget};
use fusion_core::tracker::{Tracker, TrackerOptions};

fn print(name: &str, errors: &TrackErrors) {
    for (which, s) in [("all", errors.all()), ("visible", errors.visible())] {
        println!(
            "{name:<24} {which:<8} mean {:6.2} median {:6.2} p95 {:6.1} <25mm {:.3}",
            s.mean, s.median, s.p95, s.share_below_25
        );
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let args: Vec<String> = std::env::args().collect();
    let get =
        |key: &str, default: f64| args.iter().position(|a| a == key).map_or(default, |i| args[i + 1].parse().unwrap());
    let folder = PathBuf::from(args.get(1).map_or("../shared/data/human", |s| s.as_str()));
    let body =
        read_makehuman(&folder.join("base.obj"), &folder.join("rig.cmu_mb.json"), &folder.join("weights.cmu_mb.json"))?;
    println!(
        "{} vertices {} triangles {} bones",
        body.mesh.vertices.len(),
        body.mesh.triangles.len(),
        body.bones.len()
    );
    let motion = Bvh::read(&folder.join("01_01.bvh"))?;
    let retarget = Retarget::new(&body.bones, &motion)?;
    println!("missing {:?}", retarget.missing().collect::<Vec<_>>());
    let frames: Vec<_> =
        (420..=660).step_by(get("--step", 4.0) as usize).map(|f| retarget.motions(f)).collect::<Result<_, _>>()?;
    let recording = Recording::new(&body, &frames, Camera::VGA, 2.6);
    if args.iter().any(|a| a == "--pictures") {
        for f in [0, 15, 30, 45, 60] {
            fusion_core::depth::write_depth(
                &PathBuf::from(format!("/tmp/fx/d{f}.png")),
                &recording.image(f, SensorNoise::default()),
                10000.0,
            )?;
        }
    }
    let model = DeformationModel::new(&recording.body, ModelOptions::default())?;
    println!("{} nodes", model.nodes.len());
    let noisy = BoneNoise { turn: 5f64.to_radians(), shift: 0.02 };
    let which = args.get(2).map_or("exact", |s| s.as_str());
    let noise = if which == "exact" { BoneNoise::default() } else { noisy };
    print("skeleton alone", &skeleton_alone(&recording, noise));
    let mut options = TrackerOptions::default();
    options.iterations = get("--iter", if which == "exact" { 6.0 } else { 8.0 }) as usize;
    let w = TermWeights::default();
    options.energy.weights = TermWeights {
        graph: get("--g", w.graph),
        binding: get("--b", if which == "noisy" { 0.5 } else { w.binding }),
        prior: get("--p", w.prior),
        joints: get("--j", w.joints),
        skeleton: get("--s", w.skeleton),
        ..w
    };
    options.first_distance = get("--first", options.first_distance);
    options.gates.distance = get("--last", options.gates.distance);
    options.gates.angle = get("--angle", 60.0).to_radians();
    let tukey = get("--tukey", 0.0);
    options.energy.data_tukey = (tukey > 0.0).then_some(tukey);
    if which == "unknown" {
        options.energy.bones = BoneMode::Unknown;
    }
    let mut tracker = Tracker::new(model, recording.camera, options)?;
    let start = Instant::now();
    let errors =
        track_recording(&recording, &mut tracker, SensorNoise::default(), Some(noise), |frame, result| match result {
            Ok(r) if frame % 20 == 1 => {
                let last = r.iterations.last().unwrap();
                println!(
                    "{frame}: {:?} {:?} {:.5}->{:.5} f{}",
                    r.counts,
                    last.terms.iter().map(|t| (t.name.clone(), t.energy)).collect::<Vec<_>>(),
                    last.before,
                    last.after,
                    last.fraction
                )
            }
            Ok(_) => {}
            Err(e) => println!("{frame}: {e}"),
        });
    println!("{:.1?}", start.elapsed());
    print("tracked", &errors);
    Ok(())
}
