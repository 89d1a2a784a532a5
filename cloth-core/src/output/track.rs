use std::ops::Range;

use energy_dsl::Vector3;

/// A thing in an animation: what it is made of, and where its points are in each frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Track<'a> {
    /// What it is called.
    pub name: &'a str,
    /// Its colour, linear red, green and blue from 0 to 1.
    pub colour: [f32; 3],
    /// What joins its points.
    pub joined: Joined<'a>,
    /// The points in each frame, in m; one frame only where it does not move.
    pub frames: Vec<&'a [Vector3<f64>]>,
}

/// What joins points.
#[derive(Clone, Debug, PartialEq)]
pub enum Joined<'a> {
    /// Triangles, seen from both sides.
    Triangles(&'a [[usize; 3]]),
    /// Lines through successive points.
    Strands(&'a [Range<usize>]),
}
