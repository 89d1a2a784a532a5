use std::fmt;

/// An object whose vertices move. Its elements stay the same.
pub struct AnimatedMesh<'a> {
    /// Name of the object.
    pub name: &'a str,
    /// Linear RGB colour, from 0 to 1.
    pub colour: [f32; 3],
    /// The connections between the vertices.
    pub elements: Elements,
    /// Texture coordinates of the vertices, with the second axis up; empty without texture.
    pub uvs: Vec<[f64; 2]>,
    /// Number of frames; 1 if the object does not move. An object without frames is left out.
    pub frames: usize,
    /// Returns the shape in a frame, from 0 to `frames` − 1. Every frame has as many positions and normals as the
    /// first.
    pub shape: Box<dyn Fn(usize) -> Shape + 'a>,
}

impl fmt::Debug for AnimatedMesh<'_> {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { name, colour, elements, uvs, frames, shape: _ } = self;
        let mut fields = formatter.debug_struct("AnimatedMesh");
        fields.field("name", name).field("colour", colour).field("elements", elements);
        fields.field("uvs", uvs).field("frames", frames).finish_non_exhaustive()
    }
}

/// The connections between the vertices of a mesh, by their indices.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Elements {
    /// Two-sided triangles.
    Triangles(Vec<[usize; 3]>),
    /// Line segments.
    Lines(Vec<[usize; 2]>),
}

impl Elements {
    /// Returns the vertices of all elements, one element after the other.
    pub(crate) fn corners(&self) -> &[usize] {
        match self {
            Self::Triangles(triangles) => triangles.as_flattened(),
            Self::Lines(lines) => lines.as_flattened(),
        }
    }
}

/// The vertices of a mesh in a frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Shape {
    /// Positions, in m.
    pub positions: Vec<[f64; 3]>,
    /// Unit normals of the vertices; empty for lines.
    pub normals: Vec<[f64; 3]>,
}

/// The axes of positions and normals. The y axis of glTF points up.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axes {
    /// z points up: (x, y, z) becomes (x, z, −y).
    ZUp,
    /// The axes of a camera, x right, y down and z forwards: (x, y, z) becomes (x, −y, −z), as a glTF camera sees it.
    Camera,
}

impl Axes {
    /// Returns a vector in the axes of glTF.
    pub(crate) fn to_gltf(self, v: &[f64; 3]) -> [f32; 3] {
        match self {
            Self::ZUp => [v[0] as f32, v[2] as f32, -v[1] as f32],
            Self::Camera => [v[0] as f32, -v[1] as f32, -v[2] as f32],
        }
    }
}
