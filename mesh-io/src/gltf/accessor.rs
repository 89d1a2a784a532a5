//! Numbers in the data of a glTF file. Types, counts and places are checked before anything is read.

use gltf_json::Accessor;
use gltf_json::accessor::{ComponentType, Type, sparse::Sparse};
use gltf_json::validation::Checked;

use super::container::{Container, Fault};

/// A use of an accessor, and the formats that glTF allows for it.
#[derive(Debug)]
pub struct Usage {
    /// The name, for messages.
    name: &'static str,
    shape: Type,
    components: &'static [ComponentType],
    /// Whether integers stand for numbers from 0 to 1.
    normalised: bool,
}

impl Usage {
    /// Positions of vertices.
    pub const POSITIONS: Self =
        Self { name: "positions", shape: Type::Vec3, components: &[ComponentType::F32], normalised: false };
    /// Corners of triangles, as indices of vertices.
    pub const INDICES: Self = Self {
        name: "indices",
        shape: Type::Scalar,
        components: &[ComponentType::U8, ComponentType::U16, ComponentType::U32],
        normalised: false,
    };
    /// Joints that move a vertex, as indices of a skin's joints.
    pub const JOINTS: Self = Self {
        name: "joints",
        shape: Type::Vec4,
        components: &[ComponentType::U8, ComponentType::U16],
        normalised: false,
    };
    /// Weights of the joints of a vertex.
    pub const WEIGHTS: Self = Self {
        name: "weights",
        shape: Type::Vec4,
        components: &[ComponentType::F32, ComponentType::U8, ComponentType::U16],
        normalised: true,
    };
    /// Matrices from the mesh at rest to the joints, by columns.
    pub const BIND_MATRICES: Self =
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

/// The numbers of a file. All accessors together read at most one number per byte of data: those that share bytes, or
/// have none, cannot multiply the memory.
#[derive(Debug)]
pub struct Accessors<'a> {
    file: &'a Container<'a>,
    /// Numbers that may still be read.
    budget: u64,
}

/// The checked elements of an accessor, of `N` numbers each. Each is decoded when it is visited.
#[derive(Clone, Debug)]
pub struct Values<'a, const N: usize> {
    count: usize,
    component: ComponentType,
    /// The data of all elements; `None` if they are zero.
    dense: Option<Elements<'a>>,
    /// The elements that are stored apart.
    sparse: Option<Replaced<'a>>,
}

impl<const N: usize> Values<'_, N> {
    /// Number of elements, at least 1.
    #[expect(clippy::len_without_is_empty, reason = "an accessor has elements")]
    #[must_use]
    pub fn len(&self) -> usize {
        self.count
    }

    /// Returns the elements in their order.
    pub fn iter(&self) -> impl Iterator<Item = [f64; N]> {
        let mut replaced = self.sparse.iter().flat_map(Replaced::iter).peekable();
        (0..self.count).map(move |at| {
            let stored = replaced.next_if(|(index, _)| *index == at).map(|(_, bytes)| bytes);
            let bytes = stored.or_else(|| self.dense.as_ref().map(|dense| dense.at(at)));
            bytes.map_or([0.0; N], |bytes| decoded(bytes, self.component))
        })
    }
}

/// Equally long elements at equal distances, in bytes.
#[derive(Clone, Copy, Debug)]
struct Elements<'a> {
    data: &'a [u8],
    stride: usize,
    size: usize,
}

impl<'a> Elements<'a> {
    fn at(&self, index: usize) -> &'a [u8] {
        &self.data[index * self.stride..][..self.size]
    }
}

/// Elements that are stored apart, with the increasing indices of those that they replace.
#[derive(Clone, Debug)]
struct Replaced<'a> {
    count: usize,
    index_type: ComponentType,
    indices: Elements<'a>,
    values: Elements<'a>,
}

impl<'a> Replaced<'a> {
    fn iter(&self) -> impl Iterator<Item = (usize, &'a [u8])> {
        (0..self.count).map(|at| {
            let [index] = decoded::<1>(self.indices.at(at), self.index_type);
            (index as usize, self.values.at(at))
        })
    }
}

/// A place in the data: a buffer view, and an offset in it, in bytes.
#[derive(Clone, Copy)]
struct Place {
    view: usize,
    offset: u64,
}

impl<'a> Accessors<'a> {
    /// Creates a reader of a file's numbers.
    #[must_use]
    pub fn new(file: &'a Container<'a>) -> Self {
        Self { file, budget: file.data.len() as u64 }
    }

    /// Takes numbers from the budget.
    ///
    /// # Errors
    /// If fewer are left.
    pub fn charge(&mut self, numbers: u64) -> Result<(), String> {
        let bytes = self.file.data.len();
        let left = self.budget.checked_sub(numbers);
        self.budget = left.ok_or_else(|| format!("the file has more numbers than its {bytes} bytes of data hold"))?;
        Ok(())
    }

    /// Returns the elements of an accessor, of `N` numbers each.
    ///
    /// # Errors
    /// If the accessor has another format, lacks data, or has other bounds than it states.
    pub fn read<const N: usize>(&mut self, index: usize, usage: &Usage) -> Result<Values<'a, N>, Fault> {
        let part = || format!("accessor {index} ({})", usage.name);
        self.values_of(index, usage).map_err(|reason| Fault::new(part(), reason))
    }

    fn values_of<const N: usize>(&mut self, index: usize, usage: &Usage) -> Result<Values<'a, N>, String> {
        let accessors = &self.file.root.accessors;
        let accessor = accessors.get(index).ok_or_else(|| format!("there are only {} accessors", accessors.len()))?;
        let component = usage.check(accessor)?;
        let count = accessor.count.0;
        if count == 0 {
            return Err("expected at least one element".into());
        }
        self.charge(count.saturating_mul(N as u64))?;
        let dense = accessor.buffer_view.map(|view| {
            let place = Place { view: view.value(), offset: accessor.byte_offset.map_or(0, |offset| offset.0) };
            self.elements(place, count, N * component.size(), component)
        });
        if dense.is_none() && accessor.sparse.is_none() {
            return Err("it has no buffer view".into());
        }
        let count = count as usize;
        let sparse =
            accessor.sparse.as_ref().map(|sparse| self.replaced(count, sparse, N * component.size(), component));
        let values = Values { count, component, dense: dense.transpose()?, sparse: sparse.transpose()? };
        check_bounds(accessor, &values)?;
        Ok(values)
    }

    /// Returns the elements that an accessor of `elements` elements stores apart.
    fn replaced(
        &self,
        elements: usize,
        sparse: &Sparse,
        size: usize,
        component: ComponentType,
    ) -> Result<Replaced<'a>, String> {
        let count = sparse.count.0;
        if count == 0 || count > elements as u64 {
            return Err(format!("expected 1 to {elements} sparse elements, got {count}"));
        }
        let Checked::Valid(index_type) = sparse.indices.component_type else {
            return Err("the type of its sparse indices is unknown".into());
        };
        let index_type = index_type.0;
        let place = Place { view: sparse.indices.buffer_view.value(), offset: sparse.indices.byte_offset.0 };
        let indices = self.elements(place, count, index_type.size(), index_type)?;
        let place = Place { view: sparse.values.buffer_view.value(), offset: sparse.values.byte_offset.0 };
        let values = self.elements(place, count, size, component)?;
        let replaced = Replaced { count: count as usize, index_type, indices, values };
        let mut least = 0;
        for (index, _) in replaced.iter() {
            if index < least || index >= elements {
                return Err(format!("sparse index {index}: expected increasing numbers less than {elements}"));
            }
            least = index + 1;
        }
        Ok(replaced)
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
fn check_bounds<const N: usize>(accessor: &Accessor, values: &Values<'_, N>) -> Result<(), String> {
    let stated = |bound: &Option<gltf_json::Value>| -> Option<[f64; N]> {
        let list: Vec<f64> = bound.as_ref()?.as_array()?.iter().filter_map(gltf_json::Value::as_f64).collect();
        list.try_into().ok()
    };
    let (Some(least), Some(largest)) = (stated(&accessor.min), stated(&accessor.max)) else { return Ok(()) };
    for axis in 0..N {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for value in values.iter() {
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
