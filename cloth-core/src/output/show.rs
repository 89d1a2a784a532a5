use energy_dsl::Vector3;

use super::track::{Joined, Track};
use super::{Look, PictureError, SolidMesh, View, picture_png};
use crate::contact::AnySolid;
use crate::model::PartKind;
use crate::simulation::Simulation;

/// Colours of garments (cyclic), of hair and of solids.
const COLOURS: [[f32; 3]; 5] =
    [[0.16, 0.34, 0.52], [0.55, 0.20, 0.14], [0.20, 0.42, 0.24], [0.58, 0.42, 0.12], [0.36, 0.22, 0.44]];
const HAIR: [f32; 3] = [0.28, 0.15, 0.07];
const SOLID: [f32; 3] = [0.50, 0.48, 0.45];

/// The visible content of a run: the frames of its parts, and its solids.
#[derive(Debug)]
pub struct Show<'a> {
    simulation: &'a Simulation,
    frames: &'a [Vec<Vector3<f64>>],
    /// For each garment its triangles, numbered within it; for each hair its strands.
    triangles: Vec<Vec<[usize; 3]>>,
    strands: Vec<Vec<std::ops::Range<usize>>>,
    /// Each solid in each frame; in a single frame if it does not move.
    solids: Vec<Vec<SolidMesh>>,
    /// Centre of everything at the start, and side of the visible part of a plane, in m.
    centre: Vector3<f64>,
    size: f64,
}

impl<'a> Show<'a> {
    /// Collects the content of a simulation with these frames, `frame_time` seconds apart.
    #[must_use]
    pub fn new(simulation: &'a Simulation, frames: &'a [Vec<Vector3<f64>>], frame_time: f64) -> Self {
        let points = || frames.iter().flatten();
        let bound = |pick: fn(f64, f64) -> f64, start: f64| -> Vector3<f64> {
            std::array::from_fn(|axis| points().map(|p| p[axis]).fold(start, pick))
        };
        let (low, high) = (bound(f64::min, f64::INFINITY), bound(f64::max, f64::NEG_INFINITY));
        let centre = std::array::from_fn(|axis| 0.5 * (low[axis] + high[axis]));
        let size = 1.6 * (0..3).map(|axis| high[axis] - low[axis]).fold(0.0, f64::max);
        let mut show =
            Self { simulation, frames, triangles: Vec::new(), strands: Vec::new(), solids: Vec::new(), centre, size };
        for part in simulation.parts() {
            let (triangles, strands) = match &part.kind {
                PartKind::Cloth(mesh) => (mesh.triangles().to_vec(), Vec::new()),
                PartKind::Hair { joints, .. } => {
                    let starts = (0..part.vertices.len()).step_by(*joints);
                    (Vec::new(), starts.map(|start| start..start + joints).collect())
                }
            };
            show.triangles.push(triangles);
            show.strands.push(strands);
        }
        let end = frames.len().saturating_sub(1) as f64 * frame_time;
        for obstacle in simulation.obstacles() {
            let moves = obstacle.motion.as_ref().is_some_and(|motion| motion.moves(0.0, end) || motion.keys.len() > 1);
            let count = if moves { frames.len() } else { 1 };
            let at = |frame: usize| SolidMesh::of(&obstacle.at(frame as f64 * frame_time), centre, size);
            show.solids.push((0..count).map(at).collect());
        }
        show
    }

    /// Returns a track for every garment, hair and solid.
    #[must_use]
    pub fn tracks(&self) -> Vec<Track<'_>> {
        let mut tracks = Vec::new();
        for (number, part) in self.simulation.parts().iter().enumerate() {
            let frames = self.frames.iter().map(|frame| &frame[part.vertices.clone()]).collect();
            let (joined, colour) = match part.kind {
                PartKind::Cloth(_) => (Joined::Triangles(&self.triangles[number]), COLOURS[number % COLOURS.len()]),
                PartKind::Hair { .. } => (Joined::Strands(&self.strands[number]), HAIR),
            };
            tracks.push(Track { name: &part.name, colour, joined, frames });
        }
        for (obstacle, meshes) in self.simulation.obstacles().iter().zip(&self.solids) {
            let frames = meshes.iter().map(|mesh| mesh.vertices.as_slice()).collect();
            let joined = Joined::Triangles(&meshes[0].triangles);
            tracks.push(Track { name: &obstacle.name, colour: SOLID, joined, frames });
        }
        tracks
    }

    /// Draws the vertices at a time, in s. Pictures of a `sequence` are framed for all frames. A horizontal plane
    /// serves as the floor that receives shadows.
    ///
    /// # Errors
    /// Returns an error if the picture cannot be encoded.
    pub fn picture(&self, positions: &[Vector3<f64>], time: f64, sequence: bool) -> Result<Vec<u8>, PictureError> {
        self.picture_with(positions, time, sequence, &Look::default())
    }

    /// Draws the vertices with another appearance.
    ///
    /// # Errors
    /// Returns an error if the picture cannot be encoded.
    pub fn picture_with(
        &self,
        positions: &[Vector3<f64>],
        time: f64,
        sequence: bool,
        look: &Look<'_>,
    ) -> Result<Vec<u8>, PictureError> {
        let (mut floor, mut solids) = (None, Vec::new());
        for obstacle in self.simulation.obstacles() {
            match obstacle.at(time) {
                AnySolid::HalfSpace(plane) if plane.normal[2] > 0.999 => {
                    floor = Some(floor.map_or(plane.point[2], |other: f64| other.max(plane.point[2])));
                }
                solid => solids.push(SolidMesh::of(&solid, self.centre, self.size)),
            }
        }
        let step = (self.frames.len() / 12).max(1);
        let framed: Vec<Vector3<f64>> = match sequence {
            true => self.frames.iter().step_by(step).flatten().copied().collect(),
            false => Vec::new(),
        };
        picture_png(&View {
            positions,
            triangles: self.simulation.triangles(),
            strands: self.simulation.strands(),
            solids: &solids,
            floor,
            framed: &framed,
            look: *look,
        })
    }
}
