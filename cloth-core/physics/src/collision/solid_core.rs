use energy_dsl::Vector3;

/// The core of a solid: the solid holds all points within the radius of the core's points, segments and triangles.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Core {
    /// The vertices, in m.
    pub vertices: Vec<Vector3<f64>>,
    /// Triangles, whose sides and corners collide too.
    pub triangles: Vec<[usize; 3]>,
    /// Segments, whose ends collide too. A segment from a vertex to itself is a point.
    pub segments: Vec<[usize; 2]>,
    /// Triangles whose sides and corners do not collide. One that shares no vertex with other features stands for its
    /// whole plane. A segment a–b as a face [a, b, b] collides with points.
    pub faces: Vec<[usize; 3]>,
    /// The radius, in m.
    pub radius: f64,
}
