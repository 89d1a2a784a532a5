//! Thousands of changed files for every reader: each gives an error or finite numbers, and never a panic.

use std::panic::catch_unwind;
use std::path::Path;

use fastrand::Rng;
use fusion_core::body::{figure, read_body, read_makehuman, read_obj};
use fusion_core::depth::{Camera, DepthImage, DepthSequence, read_depth, write_depth};
use fusion_core::skeleton::{Bvh, JointTrack, Retarget, Skeleton};

const CASES: usize = 1000;

/// Pieces that readers of text know, and numbers at their limits.
const WORDS: &[&str] = &[
    "0",
    "-1",
    "1",
    "4294967296",
    "1e308",
    "-1e999",
    "nan",
    "inf",
    "null",
    "[",
    "]",
    "{",
    "}",
    ",",
    ":",
    "\"",
    "\n",
    " ",
    "/",
    "v ",
    "f ",
    "g ",
    "ROOT a",
    "JOINT b",
    "End Site",
    "OFFSET",
    "CHANNELS 3",
    "MOTION",
    "Frames:",
    "#",
];

/// Changes a file in one to four places.
fn mutated(seed: &[u8], random: &mut Rng) -> Vec<u8> {
    let mut bytes = seed.to_vec();
    for _ in 0..random.usize(1..5) {
        let at = random.usize(..=bytes.len());
        let end = (at + random.usize(..12)).min(bytes.len());
        let word = random.choice(WORDS).unwrap().bytes();
        match random.u32(..6) {
            0 => drop(bytes.splice(at..end, word)),
            1 => drop(bytes.splice(at..at, word)),
            2 => drop(bytes.drain(at..end)),
            3 if at < bytes.len() => bytes[at] ^= 1 << random.u32(..8),
            4 if random.u32(..8) == 0 => bytes.truncate(at),
            _ => {
                let copied = bytes[at..end].to_vec();
                let to = random.usize(..=bytes.len());
                bytes.splice(to..to, copied);
            }
        }
    }
    bytes
}

/// Reads changed files. A reader returns whether there is a result, and checks it.
fn replay(name: &str, seed: &[u8], read: impl Fn(&Path) -> Result<(), String> + std::panic::RefUnwindSafe) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join(name);
    std::fs::write(&path, seed).unwrap();
    assert_eq!(read(&path), Ok(()), "the seed of {name}");
    let mut random = Rng::with_seed(56);
    let mut refused = 0;
    for case in 0..CASES {
        let bytes = mutated(seed, &mut random);
        std::fs::write(&path, &bytes).unwrap();
        let outcome = catch_unwind(|| read(&path)).unwrap_or_else(|_| {
            panic!("{name}, case {case}: a panic from {:?}", String::from_utf8_lossy(&bytes));
        });
        if let Err(error) = outcome {
            refused += 1;
            assert!(error.len() < 4000, "{name}, case {case}: a message of {} bytes", error.len());
        }
    }
    assert!((CASES / 20..CASES).contains(&refused), "{name}: {refused} of {CASES} refused");
}

fn message(error: impl std::error::Error) -> String {
    let cause = error.source().map(|cause| format!(": {cause}")).unwrap_or_default();
    format!("{error}{cause}")
}

fn is_finite(body: &fusion_core::body::SkinnedBody) -> bool {
    let mesh = &body.mesh;
    mesh.vertices.iter().chain(&mesh.normals).all(|v| v.iter().all(|x| x.is_finite()))
}

const MOTION: &[u8] = b"HIERARCHY\nROOT Hips\n{\nOFFSET 0 0.9 0\nCHANNELS 6 Xposition Yposition Zposition Zrotation Xrotation \
    Yrotation\nJOINT LeftUpLeg\n{\nOFFSET 0.1 0 0\nCHANNELS 3 Zrotation Xrotation Yrotation\nJOINT LeftLeg\n{\nOFFSET 0 -0.4 0\n\
    CHANNELS 3 Zrotation Xrotation Yrotation\nEnd Site\n{\nOFFSET 0 -0.4 0\n}\n}\n}\n}\nMOTION\nFrames: 2\nFrame Time: 0.03\n\
    0 0 0 0 0 0 0 0 0 0 0 0\n0.1 0 0 5 6 7 8 9 1 2 3 4\n";

#[test]
fn motions() {
    let bones = figure().bones;
    replay("m.bvh", MOTION, |path| {
        let motion = Bvh::read(path).map_err(message)?;
        for frame in 0..motion.frames() {
            let pose = motion.pose(frame).expect("the frame exists");
            assert!(pose.iter().all(|joint| joint.translation.vector.iter().all(|x| x.is_finite())));
        }
        let retarget = Retarget::new(&bones, &motion).map_err(message)?;
        for frame in 0..motion.frames() {
            let motions = retarget.motions(frame).map_err(message)?;
            assert!(motions.iter().all(|bone| bone.rotation.coords.iter().all(|x| x.is_finite())));
        }
        Ok(())
    });
}

#[test]
fn meshes() {
    let text = b"# a body\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvn 0 0 1\ng body\nf 1/1/1 2/1/1 3//1\nusemtl red\nf 1 3 4\n";
    replay("body.obj", text, |path| {
        let body = read_obj(path).map_err(message)?;
        assert!(is_finite(&body));
        Ok(())
    });
}

#[test]
fn bodies() {
    let text = br#"{"vertices": [[0, 0, 0], [1, 0, 0], [0, 1, 0]], "triangles": [[0, 1, 2]],
        "bones": [{"name": "a", "parent": null, "head": [0, 0, 0], "tail": [0, 1, 0]},
                  {"name": "b", "parent": 0, "head": [0, 1, 0], "tail": [0, 2, 0]}],
        "weights": [[[0, 1.0]], [[0, 0.5], [1, 0.5]], [[1, 1.0]]]}"#;
    replay("model.json", text, |path| {
        let body = read_body(path).map_err(message)?;
        assert!(is_finite(&body));
        Ok(())
    });
}

#[test]
fn rigs() {
    let rig = br#"{"a": {"parent": "", "head": {"strategy": "CUBE", "cube_name": "joint-a"},
        "tail": {"strategy": "VERTEX", "vertex_index": 1}},
        "b": {"parent": "a", "head": {"strategy": "MEAN", "vertex_indices": [0, 1]},
        "tail": {"strategy": "VERTEX", "vertex_index": 2}}}"#;
    let weights = r#"{"weights": {"a": [[0, 1.0], [1, 1.0], [2, 0.5]], "b": [[2, 0.5]]}}"#;
    replay("rig.json", rig, |path| {
        let [mesh, list] = ["base.obj", "weights.json"].map(|name| path.with_file_name(name));
        std::fs::write(&mesh, "v 0 0 0\nv 1 0 0\nv 0 1 0\ng joint-a\nf 1 2 3\ng body\nf 1 2 3\n").unwrap();
        std::fs::write(&list, weights).unwrap();
        let body = read_makehuman(&mesh, path, &list).map_err(message)?;
        assert!(is_finite(&body));
        Ok(())
    });
}

#[test]
fn skeletons() {
    let bones = figure().bones;
    let names: Vec<&str> = bones.iter().map(|bone| bone.name.as_str()).collect();
    let frames = vec![vec![[1.0, 0.0, 0.0, 0.0, 0.1, 0.2, 0.3]; bones.len()]; 2];
    let text = serde_json::json!({"bones": names, "frames": frames, "timestamps": [0.0, 0.1]}).to_string();
    replay("skeleton.json", text.as_bytes(), |path| {
        let skeleton =
            Skeleton::read(path).map_err(message)?.for_images(path, 2, Some(&[0.0, 0.1])).map_err(message)?;
        for frame in 0..2 {
            let motions = skeleton.motions(frame, &bones).map_err(message)?.unwrap_or_default();
            assert!(motions.iter().all(|bone| bone.translation.vector.iter().all(|x| x.is_finite())));
        }
        Ok(())
    });
}

#[test]
fn joints() {
    let bones = [fusion_core::body::Bone { name: "Hips".into(), parent: None, head: [0.0; 3], tail: [0.0, 1.0, 0.0] }];
    let text = br#"{"joints": ["a", "b"], "positions": [[[0, 0, 0], [0, 1, 0]], [[0, 0, 0.1], [0.1, 1, 0]]],
        "orientations": [[[1, 0, 0, 0], null], [[0, 1, 0, 0], null]], "timestamps": [0, 0.1], "units_per_metre": 1,
        "mapping": {"Hips": {"head": ["a"], "tail": ["b"]}}}"#;
    replay("joints.json", text, |path| {
        let track = JointTrack::read(path).map_err(message)?;
        let skeleton = track.skeleton(path, &bones, Some(&[0.0, 0.1])).map_err(message)?;
        assert!(skeleton.frames.iter().flatten().flatten().all(|x| x.is_finite()));
        Ok(())
    });
}

#[test]
fn cameras_and_lists() {
    let image = DepthImage { width: 4, height: 3, depth: vec![1.0; 12] };
    let camera = br#"{"fx": 5.0, "fy": 5.0, "cx": 1.5, "cy": 1, "width": 4, "height": 3, "depth_scale": 1000,
        "distortion": {"k1": 0.01, "p1": 0.001}}"#;
    let list = b"# timestamp filename\n0.0 depth/0.png\n0.1 depth/1.png\n";
    for (name, text) in [("intrinsics.json", &camera[..]), ("depth.txt", list)] {
        replay(name, text, |path| {
            let folder = path.parent().unwrap();
            std::fs::create_dir_all(folder.join("depth")).unwrap();
            for file in ["0.png", "1.png"].map(|name| folder.join("depth").join(name)) {
                if !file.exists() {
                    write_depth(&file, &image, 1000.0).unwrap();
                }
            }
            for (other, text) in [("intrinsics.json", &camera[..]), ("depth.txt", list)] {
                if other != name {
                    std::fs::write(folder.join(other), text).unwrap();
                }
            }
            let sequence = DepthSequence::open(folder).map_err(message)?;
            for frame in 0..sequence.len() {
                sequence.image(frame).map_err(message)?;
            }
            fusion_core::depth::PixelRays::new(sequence.info.camera).map_err(message).map(drop)
        });
    }
}

#[test]
fn images() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("seed.png");
    let depth = (0..64 * 48).map(|i| i as f32 / 1000.0).collect();
    write_depth(&path, &DepthImage { width: 64, height: 48, depth }, 1000.0).unwrap();
    let seed = std::fs::read(&path).unwrap();
    for size in [Some([64, 48]), None] {
        replay("d.png", &seed, |path| {
            let image = read_depth(path, 1000.0, size).map_err(message)?;
            assert_eq!(image.depth.len(), image.width * image.height);
            assert!(image.depth.iter().all(|depth| depth.is_finite()));
            Ok(())
        });
    }
    assert!(Camera::VGA.fault().is_none());
}
