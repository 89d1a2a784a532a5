use std::collections::BTreeMap;

use gltf_json::animation::{Channel, Interpolation, Property, Sampler, Target};
use gltf_json::mesh::{Mode, MorphTarget, Primitive, Semantic};
use gltf_json::validation::Checked::{self, Valid};
use gltf_json::{Accessor, Animation, Index, Material, Mesh, Node, Scene};

use super::document::Document;
use super::error::AnimationError;
use super::mesh::{AnimatedMesh, Axes, Elements, Shape};

/// The largest number of morph targets of a mesh. Programs keep all targets of a mesh in graphics memory, and visit all
/// of them for each frame.
const MOST_TARGETS: usize = 240;

/// Encodes an animation as a binary glTF 2.0 file (`.glb`). `times` has the time of each frame in s, in increasing
/// order; all meshes share it. Numbers are stored in single precision, in the axes of glTF.
///
/// The first frame of a moving object is its mesh. Each later frame is a morph target, and the animation moves the
/// weight from one target to the next. Long animations are divided into segments of 240 targets, each with a separate
/// mesh. Only the node of the current segment is shown; the others have the scale 0. A file takes about 24 bytes per
/// vertex and frame.
///
/// # Errors
/// Returns an error if the file would be too large, if a frame lacks a time or has another number of vertices than the
/// first, if times do not increase, or if an element has a vertex that does not exist.
pub fn animation_glb(meshes: &[AnimatedMesh<'_>], times: &[f64], axes: Axes) -> Result<Vec<u8>, AnimationError> {
    let mut document = Document::default();
    let (mut nodes, mut moving) = (Vec::new(), Vec::new());
    for mesh in meshes.iter().filter(|mesh| mesh.frames > 0) {
        check_times(mesh, times)?;
        add(mesh, axes, &mut document, &mut nodes, &mut moving)?;
    }
    let (extensions, extras) = (None, Default::default());
    document.root.scene = Some(document.root.push(Scene { nodes, name: None, extensions, extras }));
    if !moving.is_empty() {
        animate(&mut document, &moving, times);
    }
    document.finish()
}

/// Consecutive frames of a moving object.
struct Segment {
    node: Index<Node>,
    /// Its first frame, which is its mesh.
    start: usize,
    targets: usize,
    is_first: bool,
    is_last: bool,
}

/// The accessors of a mesh.
struct Parts {
    attributes: BTreeMap<Checked<Semantic>, Index<Accessor>>,
    indices: Index<Accessor>,
    mode: Mode,
    targets: Vec<MorphTarget>,
}

/// The vertices of a mesh in a frame, as a file holds them.
struct Stored {
    positions: Vec<[f32; 3]>,
    /// Vertex normals; empty for lines.
    normals: Vec<[f32; 3]>,
}

impl Stored {
    fn of(shape: &Shape, axes: Axes) -> Self {
        let all = |vectors: &[[f64; 3]]| vectors.iter().map(|vector| axes.to_gltf(vector)).collect();
        Self { positions: all(&shape.positions), normals: all(&shape.normals) }
    }
}

/// Checks that every frame of a moving mesh has a time, later than the one before.
fn check_times(mesh: &AnimatedMesh<'_>, times: &[f64]) -> Result<(), AnimationError> {
    if mesh.frames == 1 {
        return Ok(());
    }
    let Some(used) = times.get(..mesh.frames) else {
        let (name, frames) = (mesh.name.to_owned(), mesh.frames);
        return Err(AnimationError::MissingTimes { name, frames, times: times.len() });
    };
    let is_later = |number: usize| number == 0 || used[number] as f32 > used[number - 1] as f32;
    match (0..used.len()).find(|&number| !(used[number] as f32).is_finite() || !is_later(number)) {
        Some(number) => Err(AnimationError::Times { number, time: used[number] }),
        None => Ok(()),
    }
}

/// Adds the segments of a mesh.
fn add(
    mesh: &AnimatedMesh<'_>,
    axes: Axes,
    document: &mut Document,
    nodes: &mut Vec<Index<Node>>,
    moving: &mut Vec<Segment>,
) -> Result<(), AnimationError> {
    let indices = document.indices(mesh.elements.corners());
    let mode = match mesh.elements {
        Elements::Triangles(_) => Mode::Triangles,
        Elements::Lines(_) => Mode::Lines,
    };
    for start in (0..mesh.frames.max(2) - 1).step_by(MOST_TARGETS) {
        let end = (start + MOST_TARGETS + 1).min(mesh.frames);
        let first = Stored::of(&(mesh.shape)(start), axes);
        check_vertices(mesh, &first)?;
        let mut attributes = attributes(document, &first);
        if !mesh.uvs.is_empty() {
            attributes.insert(Valid(Semantic::TexCoords(0)), document.uvs(&mesh.uvs));
        }
        let mut targets = Vec::new();
        for frame in start + 1..end {
            let shape = Stored::of(&(mesh.shape)(frame), axes);
            check_alike(mesh, frame, &shape, &first)?;
            targets.push(morph(document, &shape, &first));
        }
        let count = targets.len();
        let node = object(document, mesh, Parts { attributes, indices, mode, targets });
        if start > 0 {
            document.root.nodes[node.value()].scale = Some([0.0; 3]);
        }
        if count > 0 {
            let is_last = start + MOST_TARGETS + 1 >= mesh.frames;
            moving.push(Segment { node, start, targets: count, is_first: start == 0, is_last });
        }
        nodes.push(node);
    }
    Ok(())
}

fn check_vertices(mesh: &AnimatedMesh<'_>, first: &Stored) -> Result<(), AnimationError> {
    let vertices = first.positions.len();
    match mesh.elements.corners().iter().find(|&&vertex| vertex >= vertices) {
        Some(&vertex) => Err(AnimationError::Vertex { name: mesh.name.to_owned(), vertex, vertices }),
        None => Ok(()),
    }
}

fn check_alike(mesh: &AnimatedMesh<'_>, frame: usize, shape: &Stored, first: &Stored) -> Result<(), AnimationError> {
    let (vertices, normals) = (shape.positions.len(), shape.normals.len());
    if (vertices, normals) == (first.positions.len(), first.normals.len()) {
        return Ok(());
    }
    Err(AnimationError::Unlike { name: mesh.name.to_owned(), frame, vertices, normals })
}

fn attributes(document: &mut Document, shape: &Stored) -> BTreeMap<Checked<Semantic>, Index<Accessor>> {
    let mut attributes = BTreeMap::from([(Valid(Semantic::Positions), document.vectors(&shape.positions))]);
    if !shape.normals.is_empty() {
        attributes.insert(Valid(Semantic::Normals), document.vectors(&shape.normals));
    }
    attributes
}

fn morph(document: &mut Document, shape: &Stored, rest: &Stored) -> MorphTarget {
    let normals = (!rest.normals.is_empty()).then(|| document.vectors(&differences(&shape.normals, &rest.normals)));
    let positions = Some(document.vectors(&differences(&shape.positions, &rest.positions)));
    MorphTarget { positions, normals, tangents: None }
}

fn differences(to: &[[f32; 3]], from: &[[f32; 3]]) -> Vec<[f32; 3]> {
    to.iter().zip(from).map(|(a, b)| std::array::from_fn(|axis| a[axis] - b[axis])).collect()
}

/// Adds the material, the mesh and the node of a segment.
fn object(document: &mut Document, mesh: &AnimatedMesh<'_>, parts: Parts) -> Index<Node> {
    let [red, green, blue] = mesh.colour;
    let mut material = Material { double_sided: true, ..Material::default() };
    material.pbr_metallic_roughness.base_color_factor.0 = [red, green, blue, 1.0];
    material.pbr_metallic_roughness.metallic_factor.0 = 0.0;
    material.pbr_metallic_roughness.roughness_factor.0 = 0.85;
    let material = document.root.push(material);
    let Parts { attributes, indices, mode, targets } = parts;
    let weights = (!targets.is_empty()).then(|| vec![0.0; targets.len()]);
    let name = Some(mesh.name.to_owned());
    let mesh = document.root.push(Mesh {
        primitives: vec![Primitive {
            attributes,
            indices: Some(indices),
            material: Some(material),
            mode: Valid(mode),
            targets: (!targets.is_empty()).then_some(targets),
            extensions: None,
            extras: Default::default(),
        }],
        weights,
        name: name.clone(),
        extensions: None,
        extras: Default::default(),
    });
    document.root.push(Node { mesh: Some(mesh), name, ..Node::default() })
}

/// Adds an animation. In each segment, the weight is 1 for target f − 1 at its frame f, and 0 for the others.
fn animate(document: &mut Document, segments: &[Segment], times: &[f64]) {
    let (mut channels, mut samplers) = (Vec::new(), Vec::new());
    let seconds = |frame: usize| times[frame] as f32;
    for segment in segments {
        let targets = segment.targets;
        let times: Vec<f32> = (0..=targets).map(|frame| seconds(segment.start + frame)).collect();
        let weight = |frame: usize, target: usize| if frame == target + 1 { 1.0 } else { 0.0 };
        let weights: Vec<f32> =
            (0..=targets).flat_map(|frame| (0..targets).map(move |target| weight(frame, target))).collect();
        let (input, output) = (document.scalars(&times), document.scalars(&weights));
        samplers.push(sampler(input, output, Interpolation::Linear));
        channels.push(channel(segment.node, Property::MorphTargetWeights, samplers.len() - 1));
        if segment.is_first && segment.is_last {
            continue;
        }
        let keys = visibility(segment);
        let times: Vec<f32> = keys.iter().map(|&(frame, _)| seconds(frame)).collect();
        let scales: Vec<[f32; 3]> = keys.iter().map(|&(_, scale)| [scale; 3]).collect();
        let (input, output) = (document.scalars(&times), document.vectors(&scales));
        samplers.push(sampler(input, output, Interpolation::Step));
        channels.push(channel(segment.node, Property::Scale, samplers.len() - 1));
    }
    let name = Some("motion".into());
    document.root.push(Animation { channels, samplers, name, extensions: None, extras: Default::default() });
}

/// Returns the frames at which a segment is shown (scale 1) or hidden (scale 0).
fn visibility(segment: &Segment) -> Vec<(usize, f32)> {
    let (shown, hidden) = (segment.start, segment.start + segment.targets);
    let mut keys = vec![(0, if segment.is_first { 1.0 } else { 0.0 })];
    keys.extend((!segment.is_first).then_some((shown, 1.0)));
    keys.extend((!segment.is_last).then_some((hidden, 0.0)));
    keys
}

fn sampler(input: Index<Accessor>, output: Index<Accessor>, interpolation: Interpolation) -> Sampler {
    Sampler { input, output, interpolation: Valid(interpolation), extensions: None, extras: Default::default() }
}

fn channel(node: Index<Node>, property: Property, sampler: usize) -> Channel {
    let (extensions, extras) = (None, Default::default());
    let target = Target { node, path: Valid(property), extensions, extras };
    let sampler = Index::new(u32::try_from(sampler).expect("few things move"));
    Channel { sampler, target, extensions: None, extras: Default::default() }
}

#[cfg(test)]
mod tests {
    use gltf_json::Root;
    use gltf_json::validation::Validate;

    use super::*;

    /// A triangle whose first vertex rises by 1 m per frame.
    fn triangle(frames: usize) -> AnimatedMesh<'static> {
        let positions = |n: usize| vec![[0.0, 0.0, n as f64], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
        AnimatedMesh {
            name: "it",
            colour: [0.5; 3],
            elements: Elements::Triangles(vec![[0, 1, 2]]),
            uvs: Vec::new(),
            frames,
            shape: Box::new(move |n| Shape { positions: positions(n), normals: vec![[0.0, 0.0, 1.0]; 3] }),
        }
    }

    /// Returns times at 25 Hz.
    fn times(count: usize) -> Vec<f64> {
        (0..count).map(|frame| frame as f64 / 25.0).collect()
    }

    /// The document of a triangle that moves for some frames, and the largest number of targets of a mesh.
    fn encoded(count: usize) -> (Root, usize) {
        let file = animation_glb(&[triangle(count)], &times(count), Axes::ZUp).unwrap();
        let length = u32::from_le_bytes(file[12..16].try_into().unwrap()) as usize;
        let root = Root::from_slice(&file[20..20 + length]).unwrap();
        let mut problems = Vec::new();
        root.validate(&root, gltf_json::Path::new, &mut |path, error| problems.push(format!("{} {error}", path())));
        assert!(problems.is_empty(), "{problems:?}");
        let targets = |mesh: &Mesh| mesh.primitives[0].targets.as_ref().map_or(0, Vec::len);
        let most = root.meshes.iter().map(targets).max().unwrap_or(0);
        (root, most)
    }

    #[test]
    fn long_animations_are_divided_and_one_segment_is_shown_at_a_time() {
        for (frames, nodes, channels, most) in [(1, 1, 0, 0), (2, 1, 1, 1), (241, 1, 1, 240), (500, 3, 6, 240)] {
            let (root, targets) = encoded(frames);
            let found = root.animations.first().map_or(0, |animation| animation.channels.len());
            assert_eq!((root.nodes.len(), found, targets), (nodes, channels, most), "{frames} frames");
        }
        let (root, _) = encoded(500);
        let hidden = root.nodes.iter().filter(|node| node.scale == Some([0.0; 3])).count();
        assert_eq!(hidden, 2, "without an animation only the first segment is seen");
        // The second segment is shown from frame 240, and hidden from frame 480 on.
        let animation = &root.animations[0];
        let scale = animation.channels.iter().filter(|channel| channel.target.path == Valid(Property::Scale)).nth(1);
        let input = animation.samplers[scale.unwrap().sampler.value()].input;
        let last = root.accessors[input.value()].max.as_ref().unwrap().as_array().unwrap()[0].as_f64().unwrap();
        assert!((last - 480.0 / 25.0).abs() < 1e-5, "{last}");
    }

    #[test]
    fn inputs_that_do_not_fit_are_refused() {
        let error = |mesh, times: &[f64]| animation_glb(&[mesh], times, Axes::ZUp).unwrap_err().to_string();
        assert!(error(triangle(3), &times(2)).contains("it has 3 frames, but the animation has 2 times"));
        assert!(error(triangle(3), &[0.0, 1.0, 1.0]).contains("time 2 of the animation is 1 s"));
        assert!(error(triangle(3), &[0.0, f64::NAN, 1.0]).contains("time 1"));
        let mut outside = triangle(1);
        outside.elements = Elements::Lines(vec![[0, 3]]);
        assert!(error(outside, &[]).contains("3 vertices, but an element has vertex 3"));
        let mut shrinking = triangle(2);
        shrinking.shape = Box::new(|n| Shape { positions: vec![[0.0; 3]; 4 - n], normals: Vec::new() });
        assert!(error(shrinking, &times(2)).contains("frame 1 of it has 3 positions and 0 normals"));
    }

    #[test]
    fn axes_become_those_of_gltf() {
        assert_eq!(Axes::ZUp.to_gltf(&[1.0, 2.0, 3.0]), [1.0, 3.0, -2.0]);
        assert_eq!(Axes::Camera.to_gltf(&[1.0, 2.0, 3.0]), [1.0, -2.0, -3.0]);
    }
}
