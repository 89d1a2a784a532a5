use std::collections::BTreeMap;
use std::ops::Range;

use energy_dsl::Vector3;
use gltf_json::accessor::{ComponentType, GenericComponentType, Type};
use gltf_json::animation::{Channel, Interpolation, Property, Sampler, Target};
use gltf_json::buffer::{Target as Use, View};
use gltf_json::mesh::{Mode, MorphTarget, Primitive, Semantic};
use gltf_json::validation::{Checked::Valid, USize64};
use gltf_json::{Accessor, Animation, Buffer, Index, Material, Mesh, Node, Root, Scene};

use super::track::{Joined, Track};
use super::vertex_normals;
use crate::mesh::SplitMesh;

/// An animation that cannot be encoded.
#[derive(Debug, thiserror::Error)]
pub enum AnimationError {
    /// The file exceeds 4 GiB, the limit of binary glTF.
    #[error("the animation would take {bytes} bytes, but a .glb file holds less than 4 GiB; write fewer frames")]
    TooLarge {
        /// The size it would have, in bytes.
        bytes: usize,
    },
    /// The JSON part cannot be written.
    #[error("cannot encode the JSON part of the animation")]
    Json(#[from] gltf_json::Error),
}

/// The largest number of morph targets of a mesh. Programs keep all targets of a mesh in graphics memory, and visit all
/// of them for each frame.
const MOST_TARGETS: usize = 240;

/// Encodes an animation as a binary glTF 2.0 file (`.glb`). The first frame of a moving object is its mesh. Each later
/// frame is a morph target, and the animation moves the weight from one target to the next. Long animations are divided
/// into segments of 240 targets, each with a mesh of its own; only the node of the current segment is shown, the others
/// have the scale 0. glTF's y axis points up: (x, y, z) becomes (x, z, −y).
///
/// # Errors
/// Returns an error if the file would be too large or its JSON part cannot be written.
pub fn animation_glb(tracks: &[Track<'_>], frames_per_second: f64) -> Result<Vec<u8>, AnimationError> {
    let mut file = File::default();
    let mut nodes = Vec::new();
    let mut moving = Vec::new();
    for track in tracks {
        let topology = Topology::of(track);
        let (indices, mode) = if track.frames.is_empty() { continue } else { file.indices(&topology) };
        let starts: Vec<usize> = (0..track.frames.len().max(2) - 1).step_by(MOST_TARGETS).collect();
        for &start in &starts {
            let end = (start + MOST_TARGETS + 1).min(track.frames.len());
            let Some((rest, later)) = track.frames[start..end].split_first() else { continue };
            let first = topology.shape(rest);
            let mut attributes = file.attributes(&first);
            if let Topology::Split(split) = &topology
                && !split.uvs.is_empty()
            {
                attributes.insert(Valid(Semantic::TexCoords(0)), file.uvs(&split.uvs));
            }
            let targets = later.iter().map(|frame| file.morph(&topology.shape(frame), &first)).collect();
            let node = file.object(track, Parts { attributes, indices, mode, targets });
            if start > 0 {
                file.root.nodes[node.value()].scale = Some([0.0; 3]);
            }
            if !later.is_empty() {
                let is_last = start + MOST_TARGETS + 1 >= track.frames.len();
                moving.push(Segment { node, start, targets: later.len(), is_first: start == 0, is_last });
            }
            nodes.push(node);
        }
    }
    let (extensions, extras) = (None, Default::default());
    file.root.scene = Some(file.root.push(Scene { nodes, name: None, extensions, extras }));
    if !moving.is_empty() {
        file.animate(&moving, frames_per_second);
    }
    file.finish()
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
    attributes: BTreeMap<gltf_json::validation::Checked<Semantic>, Index<Accessor>>,
    indices: Index<Accessor>,
    mode: Mode,
    targets: Vec<MorphTarget>,
}

/// The connections between the points of a track.
enum Topology<'a> {
    Triangles(&'a [[usize; 3]]),
    /// Triangles whose vertices are split where texture coordinates or normals differ.
    Split(SplitMesh),
    Strands(&'a [Range<usize>]),
}

impl<'a> Topology<'a> {
    fn of(track: &Track<'a>) -> Self {
        match track.joined {
            Joined::Triangles(triangles) if track.corners.is_empty() => Self::Triangles(triangles),
            Joined::Triangles(triangles) => Self::Split(track.corners.split(triangles)),
            Joined::Strands(strands) => Self::Strands(strands),
        }
    }

    fn shape(&self, frame: &[Vector3<f64>]) -> Shape {
        match self {
            Self::Triangles(triangles) => Shape::of(frame, &vertex_normals(frame, triangles)),
            Self::Split(split) => {
                let points: Vec<Vector3<f64>> = split.sources.iter().map(|&vertex| frame[vertex]).collect();
                Shape::of(&points, &split.normals(frame))
            }
            Self::Strands(_) => Shape::of(frame, &[]),
        }
    }
}

struct Shape {
    positions: Vec<[f32; 3]>,
    /// Vertex normals; empty for polylines.
    normals: Vec<[f32; 3]>,
}

impl Shape {
    fn of(frame: &[Vector3<f64>], normals: &[Vector3<f64>]) -> Self {
        let upright = |p: &Vector3<f64>| [p[0] as f32, p[2] as f32, -p[1] as f32];
        Self { positions: frame.iter().map(upright).collect(), normals: normals.iter().map(upright).collect() }
    }
}

fn differences(to: &[[f32; 3]], from: &[[f32; 3]]) -> Vec<[f32; 3]> {
    to.iter().zip(from).map(|(a, b)| std::array::from_fn(|axis| a[axis] - b[axis])).collect()
}

/// A glTF document with its binary buffer.
#[derive(Default)]
struct File {
    root: Root,
    data: Vec<u8>,
}

impl File {
    fn vectors(&mut self, vectors: &[[f32; 3]]) -> Index<Accessor> {
        let bytes: Vec<u8> = vectors.iter().flatten().flat_map(|number| number.to_le_bytes()).collect();
        let bound = |pick: fn(f32, f32) -> f32| {
            let start = vectors.first().copied().unwrap_or_default();
            vectors.iter().fold(start, |sum, v| std::array::from_fn(|axis| pick(sum[axis], v[axis]))).to_vec()
        };
        let bounds = Some((bound(f32::min), bound(f32::max)));
        self.accessor(&bytes, vectors.len(), ComponentType::F32, Type::Vec3, bounds, Some(Use::ArrayBuffer))
    }

    /// Adds texture coordinates. Their second axis points down in glTF.
    fn uvs(&mut self, uvs: &[[f64; 2]]) -> Index<Accessor> {
        let numbers = uvs.iter().flat_map(|[u, v]| [*u as f32, (1.0 - v) as f32]);
        let bytes: Vec<u8> = numbers.flat_map(f32::to_le_bytes).collect();
        self.accessor(&bytes, uvs.len(), ComponentType::F32, Type::Vec2, None, Some(Use::ArrayBuffer))
    }

    fn scalars(&mut self, numbers: &[f32]) -> Index<Accessor> {
        let bytes: Vec<u8> = numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
        let bound = |pick: fn(f32, f32) -> f32| vec![numbers.iter().copied().reduce(pick).unwrap_or_default()];
        let bounds = Some((bound(f32::min), bound(f32::max)));
        self.accessor(&bytes, numbers.len(), ComponentType::F32, Type::Scalar, bounds, None)
    }

    fn accessor(
        &mut self,
        bytes: &[u8],
        count: usize,
        component: ComponentType,
        type_: Type,
        bounds: Option<(Vec<f32>, Vec<f32>)>,
        target: Option<Use>,
    ) -> Index<Accessor> {
        // All components have four bytes, so every view has the alignment that glTF requires.
        let view = self.root.push(View {
            buffer: Index::new(0),
            byte_length: USize64::from(bytes.len()),
            byte_offset: Some(USize64::from(self.data.len())),
            byte_stride: None,
            name: None,
            target: target.map(Valid),
            extensions: None,
            extras: Default::default(),
        });
        self.data.extend_from_slice(bytes);
        let (min, max) = bounds.map(|(min, max)| (min.into(), max.into())).unzip();
        self.root.push(Accessor {
            buffer_view: Some(view),
            byte_offset: None,
            count: USize64::from(count),
            component_type: Valid(GenericComponentType(component)),
            type_: Valid(type_),
            min,
            max,
            normalized: false,
            sparse: None,
            name: None,
            extensions: None,
            extras: Default::default(),
        })
    }

    fn indices(&mut self, topology: &Topology<'_>) -> (Index<Accessor>, Mode) {
        let (corners, mode): (Vec<usize>, Mode) = match topology {
            Topology::Triangles(triangles) => (triangles.as_flattened().to_vec(), Mode::Triangles),
            Topology::Split(split) => (split.triangles.as_flattened().to_vec(), Mode::Triangles),
            Topology::Strands(strands) => {
                let segments = |strand: &std::ops::Range<usize>| {
                    (strand.start..strand.end.saturating_sub(1)).flat_map(|at| [at, at + 1])
                };
                (strands.iter().flat_map(segments).collect(), Mode::Lines)
            }
        };
        let bytes: Vec<u8> = corners.iter().flat_map(|&corner| (corner as u32).to_le_bytes()).collect();
        let target = Some(Use::ElementArrayBuffer);
        (self.accessor(&bytes, corners.len(), ComponentType::U32, Type::Scalar, None, target), mode)
    }

    fn attributes(&mut self, shape: &Shape) -> BTreeMap<gltf_json::validation::Checked<Semantic>, Index<Accessor>> {
        let mut attributes = BTreeMap::from([(Valid(Semantic::Positions), self.vectors(&shape.positions))]);
        if !shape.normals.is_empty() {
            attributes.insert(Valid(Semantic::Normals), self.vectors(&shape.normals));
        }
        attributes
    }

    fn morph(&mut self, shape: &Shape, rest: &Shape) -> MorphTarget {
        let normals = (!rest.normals.is_empty()).then(|| self.vectors(&differences(&shape.normals, &rest.normals)));
        let positions = Some(self.vectors(&differences(&shape.positions, &rest.positions)));
        MorphTarget { positions, normals, tangents: None }
    }

    fn object(&mut self, track: &Track<'_>, parts: Parts) -> Index<Node> {
        let [red, green, blue] = track.colour;
        let mut material = Material { double_sided: true, ..Material::default() };
        material.pbr_metallic_roughness.base_color_factor.0 = [red, green, blue, 1.0];
        material.pbr_metallic_roughness.metallic_factor.0 = 0.0;
        material.pbr_metallic_roughness.roughness_factor.0 = 0.85;
        let material = self.root.push(material);
        let Parts { attributes, indices, mode, targets } = parts;
        let weights = (!targets.is_empty()).then(|| vec![0.0; targets.len()]);
        let mesh = self.root.push(Mesh {
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
            name: Some(track.name.to_owned()),
            extensions: None,
            extras: Default::default(),
        });
        self.root.push(Node { mesh: Some(mesh), name: Some(track.name.to_owned()), ..Node::default() })
    }

    /// Adds an animation. In each segment, the weight is 1 for target f − 1 at its frame f, and 0 for the others.
    fn animate(&mut self, segments: &[Segment], frames_per_second: f64) {
        let (mut channels, mut samplers) = (Vec::new(), Vec::new());
        let seconds = |frame: usize| (frame as f64 / frames_per_second) as f32;
        for segment in segments {
            let targets = segment.targets;
            let times: Vec<f32> = (0..=targets).map(|frame| seconds(segment.start + frame)).collect();
            let weight = |frame: usize, target: usize| if frame == target + 1 { 1.0 } else { 0.0 };
            let weights: Vec<f32> =
                (0..=targets).flat_map(|frame| (0..targets).map(move |target| weight(frame, target))).collect();
            let (input, output) = (self.scalars(&times), self.scalars(&weights));
            samplers.push(sampler(input, output, Interpolation::Linear));
            channels.push(channel(segment.node, Property::MorphTargetWeights, samplers.len() - 1));
            if segment.is_first && segment.is_last {
                continue;
            }
            // When the segment is shown, and when it is hidden again.
            let (shown, hidden) = (segment.start, segment.start + targets);
            let mut keys = vec![(0, if segment.is_first { 1.0 } else { 0.0 })];
            keys.extend((!segment.is_first).then_some((shown, 1.0)));
            keys.extend((!segment.is_last).then_some((hidden, 0.0)));
            let times: Vec<f32> = keys.iter().map(|&(frame, _)| seconds(frame)).collect();
            let scales: Vec<[f32; 3]> = keys.iter().map(|&(_, scale)| [scale; 3]).collect();
            let (input, output) = (self.scalars(&times), self.vectors(&scales));
            samplers.push(sampler(input, output, Interpolation::Step));
            channels.push(channel(segment.node, Property::Scale, samplers.len() - 1));
        }
        let name = Some("motion".into());
        self.root.push(Animation { channels, samplers, name, extensions: None, extras: Default::default() });
    }

    /// Writes the header and the two chunks of a `.glb` file.
    fn finish(mut self) -> Result<Vec<u8>, AnimationError> {
        self.root.push(Buffer {
            byte_length: USize64::from(self.data.len()),
            name: None,
            uri: None,
            extensions: None,
            extras: Default::default(),
        });
        let mut json = gltf_json::serialize::to_vec(&self.root)?;
        json.resize(json.len().next_multiple_of(4), b' ');
        let total = 12 + 8 + json.len() + 8 + self.data.len();
        if u32::try_from(total).is_err() {
            return Err(AnimationError::TooLarge { bytes: total });
        }
        let mut file = Vec::with_capacity(total);
        let word = |file: &mut Vec<u8>, number: usize| file.extend_from_slice(&(number as u32).to_le_bytes());
        file.extend_from_slice(b"glTF");
        word(&mut file, 2);
        word(&mut file, total);
        word(&mut file, json.len());
        file.extend_from_slice(b"JSON");
        file.extend_from_slice(&json);
        word(&mut file, self.data.len());
        file.extend_from_slice(b"BIN\0");
        file.extend_from_slice(&self.data);
        Ok(file)
    }
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
    use super::*;
    use crate::mesh::CornerAttributes;

    /// The nodes, channels and largest number of targets of a triangle that moves for some frames.
    fn encoded(count: usize) -> (Root, usize) {
        let triangles = [[0, 1, 2]];
        let corners = CornerAttributes::default();
        let frames: Vec<[Vector3<f64>; 3]> =
            (0..count).map(|n| [[0.0, 0.0, n as f64], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]).collect();
        let track = Track {
            name: "it",
            colour: [0.5; 3],
            joined: Joined::Triangles(&triangles),
            corners: &corners,
            frames: frames.iter().map(|frame| &frame[..]).collect(),
            velocities: Vec::new(),
            contact_forces: Vec::new(),
            width: 0.0,
        };
        let file = animation_glb(&[track], 25.0).unwrap();
        let length = u32::from_le_bytes(file[12..16].try_into().unwrap()) as usize;
        let root = Root::from_slice(&file[20..20 + length]).unwrap();
        let mut problems = Vec::new();
        use gltf_json::validation::Validate;
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
}
