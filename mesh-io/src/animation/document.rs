use gltf_json::accessor::{ComponentType, GenericComponentType, Type};
use gltf_json::buffer::{Target, View};
use gltf_json::validation::{Checked::Valid, USize64};
use gltf_json::{Accessor, Buffer, Index, Root};

use super::error::AnimationError;

/// A glTF document with its binary buffer.
#[derive(Default)]
pub(crate) struct Document {
    pub root: Root,
    data: Vec<u8>,
}

impl Document {
    /// Adds vectors at vertices, with their bounds.
    pub fn vectors(&mut self, vectors: &[[f32; 3]]) -> Index<Accessor> {
        let bytes: Vec<u8> = vectors.iter().flatten().flat_map(|number| number.to_le_bytes()).collect();
        let bound = |pick: fn(f32, f32) -> f32| {
            let start = vectors.first().copied().unwrap_or_default();
            vectors.iter().fold(start, |sum, v| std::array::from_fn(|axis| pick(sum[axis], v[axis]))).to_vec()
        };
        let bounds = Some((bound(f32::min), bound(f32::max)));
        self.accessor(&bytes, vectors.len(), ComponentType::F32, Type::Vec3, bounds, Some(Target::ArrayBuffer))
    }

    /// Adds texture coordinates. Their second axis points down in glTF.
    pub fn uvs(&mut self, uvs: &[[f64; 2]]) -> Index<Accessor> {
        let numbers = uvs.iter().flat_map(|[u, v]| [*u as f32, (1.0 - v) as f32]);
        let bytes: Vec<u8> = numbers.flat_map(f32::to_le_bytes).collect();
        self.accessor(&bytes, uvs.len(), ComponentType::F32, Type::Vec2, None, Some(Target::ArrayBuffer))
    }

    /// Adds the keys of an animation, with their bounds.
    pub fn scalars(&mut self, numbers: &[f32]) -> Index<Accessor> {
        let bytes: Vec<u8> = numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
        let bound = |pick: fn(f32, f32) -> f32| vec![numbers.iter().copied().reduce(pick).unwrap_or_default()];
        let bounds = Some((bound(f32::min), bound(f32::max)));
        self.accessor(&bytes, numbers.len(), ComponentType::F32, Type::Scalar, bounds, None)
    }

    /// Adds the vertices of elements.
    pub fn indices(&mut self, corners: &[usize]) -> Index<Accessor> {
        let bytes: Vec<u8> = corners.iter().flat_map(|&corner| (corner as u32).to_le_bytes()).collect();
        let target = Some(Target::ElementArrayBuffer);
        self.accessor(&bytes, corners.len(), ComponentType::U32, Type::Scalar, None, target)
    }

    fn accessor(
        &mut self,
        bytes: &[u8],
        count: usize,
        component: ComponentType,
        type_: Type,
        bounds: Option<(Vec<f32>, Vec<f32>)>,
        target: Option<Target>,
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

    /// Returns the header and the two chunks of a `.glb` file.
    pub fn finish(mut self) -> Result<Vec<u8>, AnimationError> {
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
