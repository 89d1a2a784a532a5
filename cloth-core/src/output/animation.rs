use std::collections::BTreeMap;

use energy_dsl::Vector3;
use gltf_json::accessor::{ComponentType, GenericComponentType, Type};
use gltf_json::animation::{Channel, Interpolation, Property, Sampler, Target};
use gltf_json::buffer::View;
use gltf_json::mesh::{Mode, MorphTarget, Primitive, Semantic};
use gltf_json::validation::{Checked::Valid, USize64};
use gltf_json::{Accessor, Animation, Buffer, Index, Material, Mesh, Node, Root, Scene};

use super::vertex_normals;

/// An animation that cannot be encoded.
#[derive(Debug, thiserror::Error)]
pub enum AnimationError {
    /// A binary glTF file holds less than 4 GiB.
    #[error("the animation would take {bytes} bytes, but a .glb file holds less than 4 GiB; write fewer frames")]
    TooLarge {
        /// What it would take.
        bytes: usize,
    },
    /// The JSON part.
    #[error("the animation's JSON part")]
    Json(#[from] gltf_json::Error),
}

/// The frames as one binary glTF 2.0 file (`.glb`), which common viewers play: the first frame is the mesh, each later one a
/// morph target, and the animation moves the weight from one to the next. `frame_time` is in s. glTF's y points up: (x, y, z)
/// becomes (x, z, −y).
///
/// # Errors
/// When the file would be too large or its JSON part cannot be written.
pub fn animation_glb(
    frames: &[Vec<Vector3<f64>>],
    triangles: &[[usize; 3]],
    frame_time: f64,
) -> Result<Vec<u8>, AnimationError> {
    let mut file = File::default();
    let indices: Vec<u8> = triangles.iter().flatten().flat_map(|&corner| (corner as u32).to_le_bytes()).collect();
    let indices = file.accessor(&indices, 3 * triangles.len(), ComponentType::U32, Type::Scalar, None);

    let shapes: Vec<Shape> = frames.iter().map(|frame| Shape::of(frame, triangles)).collect();
    let Some((rest, later)) = shapes.split_first() else {
        return file.finish();
    };
    let attributes = BTreeMap::from([
        (Valid(Semantic::Positions), file.vectors(&rest.positions)),
        (Valid(Semantic::Normals), file.vectors(&rest.normals)),
    ]);
    let morph = |file: &mut File, shape: &Shape| MorphTarget {
        positions: Some(file.vectors(&differences(&shape.positions, &rest.positions))),
        normals: Some(file.vectors(&differences(&shape.normals, &rest.normals))),
        tangents: None,
    };
    let targets: Vec<MorphTarget> = later.iter().map(|shape| morph(&mut file, shape)).collect();
    let node = file.cloth(attributes, indices, targets);
    if !later.is_empty() {
        file.animate(node, later.len(), frame_time);
    }
    file.finish()
}

struct Shape {
    positions: Vec<[f32; 3]>,
    normals: Vec<[f32; 3]>,
}

impl Shape {
    fn of(frame: &[Vector3<f64>], triangles: &[[usize; 3]]) -> Self {
        let upright = |p: &Vector3<f64>| [p[0] as f32, p[2] as f32, -p[1] as f32];
        Self {
            positions: frame.iter().map(upright).collect(),
            normals: vertex_normals(frame, triangles).iter().map(upright).collect(),
        }
    }
}

fn differences(to: &[[f32; 3]], from: &[[f32; 3]]) -> Vec<[f32; 3]> {
    to.iter().zip(from).map(|(a, b)| std::array::from_fn(|axis| a[axis] - b[axis])).collect()
}

/// A glTF document and its binary part.
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
        self.accessor(&bytes, vectors.len(), ComponentType::F32, Type::Vec3, Some((bound(f32::min), bound(f32::max))))
    }

    fn scalars(&mut self, numbers: &[f32]) -> Index<Accessor> {
        let bytes: Vec<u8> = numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
        let bound = |pick: fn(f32, f32) -> f32| vec![numbers.iter().copied().reduce(pick).unwrap_or_default()];
        self.accessor(&bytes, numbers.len(), ComponentType::F32, Type::Scalar, Some((bound(f32::min), bound(f32::max))))
    }

    fn accessor(
        &mut self,
        bytes: &[u8],
        count: usize,
        component: ComponentType,
        type_: Type,
        bounds: Option<(Vec<f32>, Vec<f32>)>,
    ) -> Index<Accessor> {
        // Every number has four bytes, so that everything stays aligned as glTF asks.
        let view = self.root.push(View {
            buffer: Index::new(0),
            byte_length: USize64::from(bytes.len()),
            byte_offset: Some(USize64::from(self.data.len())),
            byte_stride: None,
            name: None,
            target: None,
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

    fn cloth(
        &mut self,
        attributes: BTreeMap<gltf_json::validation::Checked<Semantic>, Index<Accessor>>,
        indices: Index<Accessor>,
        targets: Vec<MorphTarget>,
    ) -> Index<Node> {
        let mut material = Material { double_sided: true, ..Material::default() };
        material.pbr_metallic_roughness.base_color_factor.0 = [0.16, 0.34, 0.52, 1.0];
        material.pbr_metallic_roughness.metallic_factor.0 = 0.0;
        material.pbr_metallic_roughness.roughness_factor.0 = 0.85;
        let material = self.root.push(material);
        let weights = (!targets.is_empty()).then(|| vec![0.0; targets.len()]);
        let mesh = self.root.push(Mesh {
            primitives: vec![Primitive {
                attributes,
                indices: Some(indices),
                material: Some(material),
                mode: Valid(Mode::Triangles),
                targets: (!targets.is_empty()).then_some(targets),
                extensions: None,
                extras: Default::default(),
            }],
            weights,
            name: Some("cloth".into()),
            extensions: None,
            extras: Default::default(),
        });
        let node = self.root.push(Node { mesh: Some(mesh), name: Some("cloth".into()), ..Node::default() });
        let scene =
            self.root.push(Scene { nodes: vec![node], name: None, extensions: None, extras: Default::default() });
        self.root.scene = Some(scene);
        node
    }

    /// At frame f the weight of target f − 1 is 1, and of all others 0.
    fn animate(&mut self, node: Index<Node>, targets: usize, frame_time: f64) {
        let times: Vec<f32> = (0..=targets).map(|frame| (frame as f64 * frame_time) as f32).collect();
        let weight = |frame: usize, target: usize| if frame == target + 1 { 1.0 } else { 0.0 };
        let weights: Vec<f32> =
            (0..=targets).flat_map(|frame| (0..targets).map(move |target| weight(frame, target))).collect();
        let sampler = Sampler {
            input: self.scalars(&times),
            interpolation: Valid(Interpolation::Linear),
            output: self.scalars(&weights),
            extensions: None,
            extras: Default::default(),
        };
        let target =
            Target { node, path: Valid(Property::MorphTargetWeights), extensions: None, extras: Default::default() };
        let channel = Channel { sampler: Index::new(0), target, extensions: None, extras: Default::default() };
        self.root.push(Animation {
            channels: vec![channel],
            samplers: vec![sampler],
            name: Some("motion".into()),
            extensions: None,
            extras: Default::default(),
        });
    }

    /// The two chunks of a `.glb` file behind its header.
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
