//! Numbers in the data of a glTF file. Types, counts and places are checked before anything is read.

use gltf::json::Accessor;
use gltf::json::accessor::{ComponentType, Type, sparse::Sparse};
use gltf::json::validation::Checked;

use super::glb::{Container, Fault};

/// A use of an accessor, and the formats that glTF allows for it.
#[derive(Debug)]
pub(super) struct Usage {
    /// The name, for messages.
    pub name: &'static str,
    pub shape: Type,
    pub components: &'static [ComponentType],
    /// Whether integers stand for numbers from 0 to 1.
    pub normalised: bool,
}

impl Usage {
    pub(super) const POSITIONS: Self =
        Self { name: "positions", shape: Type::Vec3, components: &[ComponentType::F32], normalised: false };
    pub(super) const INDICES: Self = Self {
        name: "indices",
        shape: Type::Scalar,
        components: &[ComponentType::U8, ComponentType::U16, ComponentType::U32],
        normalised: false,
    };
    pub(super) const JOINTS: Self = Self {
        name: "joints",
        shape: Type::Vec4,
        components: &[ComponentType::U8, ComponentType::U16],
        normalised: false,
    };
    pub(super) const WEIGHTS: Self = Self {
        name: "weights",
        shape: Type::Vec4,
        components: &[ComponentType::F32, ComponentType::U8, ComponentType::U16],
        normalised: true,
    };
    pub(super) const BIND_MATRICES: Self =
        Self { name: "inverse bind matrices", shape: Type::Mat4, components: &[ComponentType::F32], normalised: false };

    /// Checks the type of an accessor, and returns that of its components.
    fn check(&self, accessor: &Accessor) -> Result<ComponentType, String> {
        let (Checked::Valid(shape), Checked::Valid(component)) = (accessor.type_, accessor.component_type) else {
            return Err("its type is unknown".into());
        };
        let component = component.0;
        if shape != self.shape || !self.components.contains(&component) {
            let (shapes, components) = (self.shape, self.components);
            return Err(format!("expected {shapes:?} of {components:?}, got {shape:?} of {component:?}"));
        }
        let normalised = self.normalised && component != ComponentType::F32;
        match accessor.normalized == normalised {
            true => Ok(component),
            false => Err(format!("expected `normalized` to be {normalised} for {component:?}")),
        }
    }
}

/// The numbers of a file. Together, no more are read than the file has bytes of data: accessors that share bytes, or
/// have none, do not multiply.
#[derive(Debug)]
pub(super) struct Accessors<'a> {
    file: &'a Container<'a>,
    /// Numbers that may still be read.
    budget: u64,
}

/// Equally long elements at equal distances, in bytes.
struct Elements<'a> {
    data: &'a [u8],
    stride: usize,
    size: usize,
}

impl<'a> Elements<'a> {
    fn iter(&self) -> impl Iterator<Item = &'a [u8]> {
        self.data.chunks(self.stride).map(|element| &element[..self.size])
    }
}

/// A place in the data: a buffer view, and an offset in it, in bytes.
#[derive(Clone, Copy)]
struct Place {
    view: usize,
    offset: u64,
}

impl<'a> Accessors<'a> {
    pub(super) fn new(file: &'a Container<'a>) -> Self {
        Self { file, budget: file.data.len() as u64 }
    }

    /// Takes numbers from the budget.
    pub(super) fn charge(&mut self, numbers: u64) -> Result<(), String> {
        let bytes = self.file.data.len();
        let left = self.budget.checked_sub(numbers);
        self.budget = left.ok_or_else(|| format!("the file has more numbers than its {bytes} bytes of data hold"))?;
        Ok(())
    }

    /// Reads the elements of an accessor, of `N` numbers each.
    pub(super) fn read<const N: usize>(&mut self, index: usize, usage: &Usage) -> Result<Vec<[f64; N]>, Fault> {
        let part = || format!("accessor {index} ({})", usage.name);
        self.elements_of(index, usage).map_err(|reason| Fault::new(part(), reason))
    }

    fn elements_of<const N: usize>(&mut self, index: usize, usage: &Usage) -> Result<Vec<[f64; N]>, String> {
        let accessors = &self.file.root.accessors;
        let accessor = accessors.get(index).ok_or_else(|| format!("there are only {} accessors", accessors.len()))?;
        let component = usage.check(accessor)?;
        let count = accessor.count.0;
        if count == 0 {
            return Err("expected at least one element".into());
        }
        self.charge(count.saturating_mul(N as u64))?;
        let mut values = vec![[0.0; N]; count as usize];
        if let Some(view) = accessor.buffer_view {
            let place = Place { view: view.value(), offset: accessor.byte_offset.map_or(0, |offset| offset.0) };
            let elements = self.elements(place, count, N * component.size(), component)?;
            values.iter_mut().zip(elements.iter()).for_each(|(value, bytes)| *value = decoded(bytes, component));
        } else if accessor.sparse.is_none() {
            return Err("it has no buffer view".into());
        }
        if let Some(sparse) = &accessor.sparse {
            self.replace(&mut values, sparse, component)?;
        }
        check_bounds(accessor, &values)?;
        Ok(values)
    }

    /// Replaces some elements by those that an accessor stores apart.
    fn replace<const N: usize>(
        &self,
        values: &mut [[f64; N]],
        sparse: &Sparse,
        component: ComponentType,
    ) -> Result<(), String> {
        let count = sparse.count.0;
        if count == 0 || count > values.len() as u64 {
            return Err(format!("expected 1 to {} sparse elements, got {count}", values.len()));
        }
        let (indices, replaced) = (&sparse.indices, &sparse.values);
        let Checked::Valid(index_type) = indices.component_type else {
            return Err("the type of its sparse indices is unknown".into());
        };
        let place = Place { view: indices.buffer_view.value(), offset: indices.byte_offset.0 };
        let indices = self.elements(place, count, index_type.0.size(), index_type.0)?;
        let place = Place { view: replaced.buffer_view.value(), offset: replaced.byte_offset.0 };
        let replaced = self.elements(place, count, N * component.size(), component)?;
        let mut least = 0;
        for (index, bytes) in indices.iter().zip(replaced.iter()) {
            let [index] = decoded::<1>(index, index_type.0);
            let index = index as usize;
            if index < least || index >= values.len() {
                return Err(format!("sparse index {index}: expected increasing numbers less than {}", values.len()));
            }
            values[index] = decoded(bytes, component);
            least = index + 1;
        }
        Ok(())
    }

    /// Returns elements of `size` bytes, after checks of their place.
    fn elements(
        &self,
        Place { view, offset }: Place,
        count: u64,
        size: usize,
        component: ComponentType,
    ) -> Result<Elements<'a>, String> {
        let root = &self.file.root;
        let number = view;
        let view = root.buffer_views.get(number).ok_or_else(|| format!("there is no buffer view {number}"))?;
        let buffer = root.buffers.get(view.buffer.value()).filter(|_| view.buffer.value() == 0);
        let buffer = buffer.filter(|buffer| buffer.uri.is_none()).ok_or_else(|| {
            format!("buffer view {number} has data outside the file; export the body as one binary file (.glb)")
        })?;
        let held = buffer.byte_length.0.min(self.file.data.len() as u64);
        let (start, length) = (view.byte_offset.map_or(0, |offset| offset.0), view.byte_length.0);
        if start.checked_add(length).is_none_or(|end| end > held) {
            let place = format!("bytes {start} to {}", start.saturating_add(length));
            return Err(format!("buffer view {number} has {place}, but the data have only {held} bytes"));
        }
        let alignment = component.size() as u64;
        if !offset.is_multiple_of(alignment) || !start.wrapping_add(offset).is_multiple_of(alignment) {
            return Err(format!("its data begin at a place that is not a multiple of {alignment} bytes"));
        }
        let stride = view.byte_stride.map_or(size, |stride| stride.0);
        if stride < size {
            return Err(format!("buffer view {number}: expected a stride of at least {size} bytes, got {stride}"));
        }
        let end =
            (stride as u64).checked_mul(count - 1).and_then(|end| end.checked_add(size as u64)?.checked_add(offset));
        match end {
            Some(end) if end <= length => {
                let data = &self.file.data[(start + offset) as usize..(start + end) as usize];
                Ok(Elements { data, stride, size })
            }
            _ => Err(format!("its {count} elements of {size} bytes exceed the {length} bytes of buffer view {number}")),
        }
    }
}

/// Compares the smallest and the largest values with those that the accessor states: bytes at a wrong place have
/// others.
fn check_bounds<const N: usize>(accessor: &Accessor, values: &[[f64; N]]) -> Result<(), String> {
    let stated = |bound: &Option<serde_json::Value>| -> Option<[f64; N]> {
        let list: Vec<f64> = bound.as_ref()?.as_array()?.iter().filter_map(serde_json::Value::as_f64).collect();
        list.try_into().ok()
    };
    let (Some(least), Some(largest)) = (stated(&accessor.min), stated(&accessor.max)) else { return Ok(()) };
    for axis in 0..N {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for value in values {
            (low, high) = (low.min(value[axis]), high.max(value[axis]));
        }
        // Some exporters round the bounds.
        let tolerance = 1e-3 * (1.0 + least[axis].abs().max(largest[axis].abs()));
        if (low - least[axis]).abs() > tolerance || (high - largest[axis]).abs() > tolerance {
            let stated = format!("`min` and `max` are {} and {}", least[axis], largest[axis]);
            return Err(format!("component {axis} is between {low} and {high}, but {stated}; is the file damaged?"));
        }
    }
    Ok(())
}

/// Decodes little-endian numbers. Integers stay integers: the weights of a vertex are divided by their sum later.
fn decoded<const N: usize>(bytes: &[u8], component: ComponentType) -> [f64; N] {
    let size = component.size();
    std::array::from_fn(|i| {
        let at = |offset: usize| bytes[i * size + offset];
        match component {
            ComponentType::I8 => f64::from(at(0) as i8),
            ComponentType::U8 => f64::from(at(0)),
            ComponentType::I16 => f64::from(i16::from_le_bytes([at(0), at(1)])),
            ComponentType::U16 => f64::from(u16::from_le_bytes([at(0), at(1)])),
            ComponentType::U32 => f64::from(u32::from_le_bytes([at(0), at(1), at(2), at(3)])),
            ComponentType::F32 => f64::from(f32::from_le_bytes([at(0), at(1), at(2), at(3)])),
        }
    })
}
