use std::ops::Range;

use energy_dsl::Vector3;
use mesh_io::animation::{AnimatedMesh, AnimationError, Axes, Elements, Shape, animation_glb as meshes_glb};

use super::track::{Joined, Track};
use super::vertex_normals;
use crate::mesh::SplitMesh;

/// Encodes an animation as a binary glTF 2.0 file (`.glb`), as [`mesh_io::animation::animation_glb`] does. The first
/// frame is at 0 s. glTF's y axis points up: (x, y, z) becomes (x, z, −y).
///
/// # Errors
/// Returns an error if the file would be too large or its JSON part cannot be written.
pub fn animation_glb(tracks: &[Track<'_>], frames_per_second: f64) -> Result<Vec<u8>, AnimationError> {
    let frames = tracks.iter().map(|track| track.frames.len()).max().unwrap_or(0);
    let times: Vec<f64> = (0..frames).map(|frame| frame as f64 / frames_per_second).collect();
    let meshes: Vec<AnimatedMesh<'_>> = tracks.iter().map(animated).collect();
    meshes_glb(&meshes, &times, Axes::ZUp)
}

/// Returns a track as an animated mesh.
fn animated<'a>(track: &'a Track<'a>) -> AnimatedMesh<'a> {
    let topology = Topology::of(track);
    AnimatedMesh {
        name: track.name,
        colour: track.colour,
        elements: topology.elements(),
        uvs: topology.uvs(),
        frames: track.frames.len(),
        shape: Box::new(move |frame| topology.shape(track.frames[frame])),
    }
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

    fn elements(&self) -> Elements {
        match self {
            Self::Triangles(triangles) => Elements::Triangles(triangles.to_vec()),
            Self::Split(split) => Elements::Triangles(split.triangles.clone()),
            Self::Strands(strands) => {
                let segments =
                    |strand: &Range<usize>| (strand.start..strand.end.saturating_sub(1)).map(|at| [at, at + 1]);
                Elements::Lines(strands.iter().flat_map(segments).collect())
            }
        }
    }

    fn uvs(&self) -> Vec<[f64; 2]> {
        match self {
            Self::Split(split) => split.uvs.clone(),
            Self::Triangles(_) | Self::Strands(_) => Vec::new(),
        }
    }

    fn shape(&self, frame: &[Vector3<f64>]) -> Shape {
        match self {
            Self::Triangles(triangles) => {
                Shape { positions: frame.to_vec(), normals: vertex_normals(frame, triangles) }
            }
            Self::Split(split) => {
                let positions = split.sources.iter().map(|&vertex| frame[vertex]).collect();
                Shape { positions, normals: split.normals(frame) }
            }
            Self::Strands(_) => Shape { positions: frame.to_vec(), normals: Vec::new() },
        }
    }
}
