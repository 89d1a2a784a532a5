//! Bodies, motions and recordings.

use std::cell::RefCell;
use std::path::Path;
use std::sync::LazyLock;

use cloth_core::physics::mesh::{ObjOptions, read_obj_surface};
use fusion_core::body::{Bone, SkinnedBody, figure, parse_gltf, read_body, read_makehuman, read_obj};
use fusion_core::depth::{Camera, DepthImage, DepthSequence, PixelRays, read_depth, read_mask, write_depth};
use fusion_core::model::{DeformationModel, ModelOptions};
use fusion_core::skeleton::{Bvh, JointTrack, Retarget, Skeleton};
use fusion_core::tracker::{Tracker, TrackerOptions, TrackerState};
use mesh_io::obj::ObjFile;

use crate::target::{Target, message, text};

/// A motion in Biovision's format, also on the bones of the built-in figure.
pub(crate) const BVH: Target = Target { name: "bvh", words: WORDS, shared: &[], made: Vec::new, read: bvh };

/// An OBJ file, as cloth and as a body.
pub(crate) const OBJ: Target = Target { name: "obj", words: WORDS, shared: &[], made: Vec::new, read: obj };

/// A body in JSON.
pub(crate) const BODY: Target = Target {
    name: "body",
    words: WORDS,
    shared: &[],
    made: Vec::new,
    read: |input, folder| checked(&read_body(&file(folder, "model.json", input)).map_err(message)?),
};

/// A rig of MakeHuman.
pub(crate) const RIG: Target = Target { name: "rig", words: WORDS, shared: &[], made: Vec::new, read: rig };

/// A binary glTF file.
pub(crate) const GLB: Target = Target {
    name: "glb",
    words: WORDS,
    shared: &[],
    made: || crate::target("gltf").seeds().iter().map(|seed| container(seed)).collect(),
    read: |input, _| checked(&parse_gltf(input, Path::new("body.glb")).map_err(message)?),
};

/// The description of a glTF file and, after a zero byte, its data. The container with its lengths is added.
pub(crate) const GLTF: Target = Target {
    name: "gltf",
    words: GLTF_WORDS,
    shared: &[],
    made: Vec::new,
    read: |input, folder| (GLB.read)(&container(input), folder),
};

/// Motions of bones in JSON.
pub(crate) const SKELETON: Target =
    Target { name: "skeleton", words: WORDS, shared: &[], made: skeleton_seed, read: skeleton };

/// Joints of a body tracker in JSON.
pub(crate) const JOINTS: Target = Target { name: "joints", words: WORDS, shared: &[], made: Vec::new, read: joints };

/// The camera of a recording, `intrinsics.json`.
pub(crate) const CAMERA: Target = Target {
    name: "camera",
    words: WORDS,
    shared: &[],
    made: || vec![INTRINSICS.to_vec()],
    read: |input, folder| recording(input, LIST, folder),
};

/// The list of a recording's images, `depth.txt`.
pub(crate) const IMAGE_LIST: Target = Target {
    name: "image_list",
    words: WORDS,
    shared: &[],
    made: || vec![LIST.to_vec()],
    read: |input, folder| recording(INTRINSICS, input, folder),
};

/// An image of depths, or a mask.
pub(crate) const DEPTH_IMAGE: Target =
    Target { name: "depth_image", words: &[], shared: &[], made: || vec![SMALL_IMAGE.clone()], read: depth_image };

/// The state of a tracker in the checkpoint of a track.
pub(crate) const TRACK: Target = Target {
    name: "track",
    words: WORDS,
    shared: &[],
    made: || TRACKER.with_borrow(|tracker| vec![serde_json::to_vec(&tracker.state()).expect("a state is JSON")]),
    read: track,
};

const INTRINSICS: &[u8] = br#"{"fx": 5.0, "fy": 5.0, "cx": 1.5, "cy": 1, "width": 4, "height": 3, "depth_scale": 1000,
    "distortion": {"k1": 0.01, "p1": 0.001}}"#;
const LIST: &[u8] = b"# timestamp filename\n0.0 depth/0.png\n0.1 depth/1.png\n";

static SMALL_IMAGE: LazyLock<Vec<u8>> = LazyLock::new(|| {
    let folder = tempfile::tempdir().expect("the folder of temporary files can be written to");
    let path = folder.path().join("depth.png");
    let depth = (0_u16..12).map(|pixel| f32::from(pixel) / 10.0).collect();
    write_depth(&path, &DepthImage { width: 4, height: 3, depth }, 1000.0).expect("the image can be written");
    std::fs::read(path).expect("the image was written")
});

/// Writes an input as a file.
fn file(folder: &Path, name: &str, input: &[u8]) -> std::path::PathBuf {
    let path = folder.join(name);
    std::fs::write(&path, input).expect("the folder is there");
    path
}

/// Asserts that a body is sound.
fn checked(body: &SkinnedBody) -> Result<(), String> {
    let SkinnedBody { mesh, bones, weights, .. } = body;
    assert!(mesh.triangles.iter().flatten().all(|&vertex| (vertex as usize) < mesh.vertices.len()));
    assert!(mesh.vertices.iter().chain(&mesh.normals).all(|vector| vector.iter().all(|x| x.is_finite())));
    assert!(weights.iter().flatten().all(|&(bone, weight)| bone < bones.len() && weight >= 0.0 && weight.is_finite()));
    assert!(bones.iter().flat_map(|bone| [bone.head, bone.tail]).flatten().all(f64::is_finite));
    Ok(())
}

fn bvh(input: &[u8], folder: &Path) -> Result<(), String> {
    let motion = Bvh::read(&file(folder, "motion.bvh", input)).map_err(message)?;
    for frame in 0..motion.frames().min(100) {
        let pose = motion.pose(frame).expect("the frame exists");
        assert!(pose.iter().all(|joint| joint.translation.vector.iter().all(|x| x.is_finite())));
    }
    let bones = figure().bones;
    let retarget = Retarget::new(&bones, &motion).map_err(message)?;
    for frame in 0..motion.frames().min(100) {
        let motions = retarget.motions(frame).map_err(message)?;
        assert!(motions.iter().all(|bone| bone.rotation.coords.iter().all(|x| x.is_finite())));
    }
    Ok(())
}

fn obj(input: &[u8], folder: &Path) -> Result<(), String> {
    let path = file(folder, "mesh.obj", input);
    let parsed = ObjFile::read(&path).map_err(message)?;
    assert!(parsed.uvs.as_flattened().iter().all(|&x| (x as f32).is_finite()), "a texture coordinate is not finite");
    let cloth = cloth_core::physics::mesh::read_obj(&path).map_err(message).map(|mesh| {
        assert!(mesh.triangles().iter().flatten().all(|&vertex| vertex < mesh.vertices().len()));
    });
    let mut options = ObjOptions::default();
    options.weld = Some(1e-3);
    if let Ok(surface) = read_obj_surface(&path, options) {
        assert!(surface.kept.iter().all(|&triangle| triangle < surface.unwelded_triangles));
    }
    match read_obj(&path) {
        Ok(body) => checked(&body),
        Err(error) => cloth.and(Err(message(error))),
    }
}

fn rig(input: &[u8], folder: &Path) -> Result<(), String> {
    let mesh = b"v 0 0 0\nv 1 0 0\nv 0 1 0\ng joint-a\nf 1 2 3\ng body\nf 1 2 3\n";
    let weights = br#"{"weights": {"a": [[0, 1.0], [1, 1.0], [2, 0.5]], "b": [[2, 0.5]]}}"#;
    let [mesh, weights] = [("base.obj", &mesh[..]), ("weights.json", weights)].map(|(name, of)| file(folder, name, of));
    checked(&read_makehuman(&mesh, &file(folder, "rig.json", input), &weights).map_err(message)?)
}

/// Returns a binary glTF file of a description and, after a zero byte, data.
fn container(input: &[u8]) -> Vec<u8> {
    let end = input.iter().position(|&byte| byte == 0).unwrap_or(input.len());
    let padded = |bytes: &[u8], with: u8| {
        let mut chunk = bytes.to_vec();
        chunk.resize(bytes.len().next_multiple_of(4), with);
        chunk
    };
    let (json, data) = (padded(&input[..end], b' '), padded(input.get(end + 1..).unwrap_or_default(), 0));
    let number = |length: usize| u32::try_from(length).expect("inputs are short").to_le_bytes();
    let mut file = [&b"glTF"[..], &number(2), &number(28 + json.len() + data.len())].concat();
    for (name, chunk) in [(b"JSON", json), (b"BIN\0", data)] {
        file.extend(number(chunk.len()));
        file.extend(name);
        file.extend(chunk);
    }
    file
}

fn skeleton_seed() -> Vec<Vec<u8>> {
    let bones: Vec<String> = figure().bones.into_iter().map(|bone| bone.name).collect();
    let frames = vec![vec![[1.0, 0.0, 0.0, 0.0, 0.1, 0.2, 0.3]; bones.len()]; 2];
    vec![serde_json::json!({"bones": bones, "frames": frames, "timestamps": [0.0, 0.1]}).to_string().into_bytes()]
}

fn skeleton(input: &[u8], folder: &Path) -> Result<(), String> {
    let path = file(folder, "skeleton.json", input);
    let skeleton = Skeleton::read(&path).map_err(message)?;
    let skeleton = skeleton.for_images(&path, 2, Some(&[0.0, 0.1])).map_err(message)?;
    let bones = figure().bones;
    for frame in 0..2 {
        let motions = skeleton.motions(frame, &bones).map_err(message)?.unwrap_or_default();
        assert!(motions.iter().all(|bone| bone.translation.vector.iter().all(|x| x.is_finite())));
    }
    Ok(())
}

fn joints(input: &[u8], folder: &Path) -> Result<(), String> {
    let path = file(folder, "joints.json", input);
    let bones = [Bone { name: "Hips".into(), parent: None, head: [0.0; 3], tail: [0.0, 1.0, 0.0] }];
    let track = JointTrack::read(&path).map_err(message)?;
    let skeleton = track.skeleton(&path, &bones, Some(&[0.0, 0.1])).map_err(message)?;
    assert!(skeleton.frames.iter().flatten().flatten().all(|x| x.is_finite()));
    Ok(())
}

/// Reads a recording of two images.
fn recording(intrinsics: &[u8], list: &[u8], folder: &Path) -> Result<(), String> {
    let images = folder.join("depth");
    std::fs::create_dir_all(&images).expect("the folder is there");
    for (folder, name, contents) in [
        (&*images, "0.png", &**SMALL_IMAGE),
        (&*images, "1.png", &**SMALL_IMAGE),
        (folder, "intrinsics.json", intrinsics),
        (folder, "depth.txt", list),
    ] {
        file(folder, name, contents);
    }
    let sequence = DepthSequence::open(folder).map_err(message)?;
    for frame in 0..sequence.len().min(4) {
        let image = sequence.image(frame).map_err(message)?;
        assert!(image.depth.iter().all(|depth| depth.is_finite()));
    }
    let Camera { width, height, .. } = sequence.info.camera;
    if width * height < 10_000 {
        PixelRays::new(sequence.info.camera).map_err(message)?;
    }
    Ok(())
}

fn depth_image(input: &[u8], folder: &Path) -> Result<(), String> {
    let path = file(folder, "depth.png", input);
    let _ = read_mask(&path, [4, 3]);
    let image = read_depth(&path, 1000.0, None).map_err(message)?;
    assert_eq!(image.depth.len(), image.width * image.height);
    assert!(image.depth.iter().all(|depth| depth.is_finite()));
    Ok(())
}

thread_local! {
    static TRACKER: RefCell<Tracker> = RefCell::new({
        let model = DeformationModel::new(&figure(), ModelOptions { node_radius: 0.5, ..ModelOptions::default() });
        let model = model.expect("the figure is a body");
        Tracker::new(model, Camera::VGA, TrackerOptions::default()).expect("the usual options are valid")
    });
}

fn track(input: &[u8], _: &Path) -> Result<(), String> {
    let state: TrackerState = serde_json::from_str(text(input)?).map_err(message)?;
    TRACKER.with_borrow_mut(|tracker| {
        tracker.restore(&state).map_err(message)?;
        assert!(!tracker.vertices().is_empty());
        Ok(())
    })
}

pub(crate) const WORDS: &[&str] = &[
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
    "//",
    "v ",
    "vn ",
    "vt ",
    "f ",
    "g ",
    "o ",
    "#",
    "\\\n",
    "\r\n",
    "ROOT a",
    "JOINT b",
    "End Site",
    "OFFSET",
    "CHANNELS 3",
    "MOTION",
    "Frames:",
    "\\u001b",
    "<script>",
];

const GLTF_WORDS: &[&str] = &[
    "null",
    "[]",
    "{}",
    "true",
    "\"SCALAR\"",
    "\"VEC3\"",
    "\"VEC4\"",
    "\"MAT4\"",
    "5120",
    "5121",
    "5123",
    "5125",
    "5126",
    "\"sparse\"",
    "\"byteStride\"",
    "\"normalized\"",
    "[",
    "]",
    "{",
    "}",
    ",",
    "\0",
];
