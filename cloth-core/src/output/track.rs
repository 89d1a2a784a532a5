use std::ops::Range;

use energy_dsl::Vector3;

/// An animated object: its topology, and its points in each frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Track<'a> {
    /// Name of the object.
    pub name: &'a str,
    /// Linear RGB colour, from 0 to 1.
    pub colour: [f32; 3],
    /// Topology of the points.
    pub joined: Joined<'a>,
    /// The points in each frame, in m; a single frame if the object does not move.
    pub frames: Vec<&'a [Vector3<f64>]>,
}

/// The topology of the points of a track.
#[derive(Clone, Debug, PartialEq)]
pub enum Joined<'a> {
    /// Two-sided triangles.
    Triangles(&'a [[usize; 3]]),
    /// Polylines through successive points.
    Strands(&'a [Range<usize>]),
}
