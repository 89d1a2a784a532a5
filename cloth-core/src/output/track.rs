use std::ops::Range;

use energy_dsl::Vector3;

use crate::mesh::CornerAttributes;

/// An animated object: its topology, and its points in each frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Track<'a> {
    /// Name of the object.
    pub name: &'a str,
    /// Linear RGB colour, from 0 to 1.
    pub colour: [f32; 3],
    /// Topology of the points.
    pub joined: Joined<'a>,
    /// Attributes of the corners of triangles, from a file.
    pub corners: &'a CornerAttributes,
    /// The points in each frame, in m; a single frame if the object does not move.
    pub frames: Vec<&'a [Vector3<f64>]>,
    /// Width of strands, in m; 0 for triangles.
    pub width: f64,
    /// The velocities of the points in each frame, in m/s; empty if they are not written.
    pub velocities: Vec<&'a [Vector3<f64>]>,
    /// The forces of contact on the points in each frame, in N; empty if they are not written.
    pub contact_forces: Vec<&'a [Vector3<f64>]>,
}

/// The topology of the points of a track.
#[derive(Clone, Debug, PartialEq)]
pub enum Joined<'a> {
    /// Two-sided triangles.
    Triangles(&'a [[usize; 3]]),
    /// Polylines through successive points.
    Strands(&'a [Range<usize>]),
}
