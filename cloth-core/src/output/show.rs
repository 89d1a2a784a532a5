use energy_dsl::Vector3;

use super::style::{garment_colour, linear};
use super::track::{Joined, Track};
use super::{Framing, Look, PictureError, Scenery, SolidMesh};
use crate::geometry::Bounds;
use crate::mesh::CornerAttributes;
use crate::model::PartKind;
use crate::scene::Style;
use crate::simulation::Simulation;

/// Linear colours of hair and of solids.
const HAIR: [f32; 3] = [0.28, 0.15, 0.07];
const SOLID: [f32; 3] = [0.50, 0.48, 0.45];

/// Solids have no attributes.
const PLAIN: CornerAttributes = CornerAttributes { uvs: None, normals: None };

/// The visible content of a run: the frames of its parts, and its solids.
#[derive(Debug)]
pub struct Show<'a> {
    simulation: &'a Simulation,
    frames: Vec<&'a [Vector3<f64>]>,
    /// Velocities of all vertices in each frame; empty if they are not written.
    velocities: Vec<&'a [Vector3<f64>]>,
    contact_forces: Vec<&'a [Vector3<f64>]>,
    /// For each garment its triangles, numbered within it; for each hair its strands.
    triangles: Vec<Vec<[usize; 3]>>,
    strands: Vec<Vec<std::ops::Range<usize>>>,
    /// Each solid in each frame; in a single frame if it does not move.
    solids: Vec<Vec<SolidMesh>>,
    scenery: Scenery,
    /// The part of space that all frames need.
    framing: Framing,
}

impl<'a> Show<'a> {
    /// Collects the content of a simulation with these frames, `rate` of them per simulated second.
    #[must_use]
    pub fn new<F: AsRef<[Vector3<f64>]>>(simulation: &'a Simulation, frames: &'a [F], rate: f64, style: Style) -> Self {
        let frames: Vec<&[Vector3<f64>]> = frames.iter().map(AsRef::as_ref).collect();
        let bounds = frames.iter().map(|frame| Bounds::of(frame)).fold(Bounds::EMPTY, Bounds::around);
        let (scenery, framing) = (Scenery::of(simulation, style), Framing::loose(bounds));
        let (triangles, strands, solids) = (Vec::new(), Vec::new(), Vec::new());
        let (velocities, contact_forces) = (Vec::new(), Vec::new());
        let mut show =
            Self { simulation, frames, velocities, contact_forces, triangles, strands, solids, scenery, framing };
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
        let count = show.frames.len();
        let end = count.saturating_sub(1) as f64 / rate;
        for obstacle in simulation.obstacles() {
            let has_keys = obstacle.motion.as_ref().is_some_and(|motion| motion.keys.len() > 1);
            let moves = has_keys || obstacle.deformation.is_some() || obstacle.moves(0.0, end);
            let count = if moves { count } else { 1 };
            let at = |frame: usize| {
                let solid = obstacle.at(frame as f64 / rate);
                SolidMesh::of(&solid, framing.centre(), framing.size())
            };
            show.solids.push((0..count).map(at).collect());
        }
        show
    }

    /// Adds the velocities of all vertices in each frame, in m/s, and the forces of contact on them, in N. Files omit
    /// empty vectors.
    #[must_use]
    pub fn with_vectors(mut self, frames: impl Iterator<Item = [&'a [Vector3<f64>]; 2]>) -> Self {
        for [velocities, forces] in frames {
            self.velocities.extend((!velocities.is_empty()).then_some(velocities));
            self.contact_forces.extend((!forces.is_empty()).then_some(forces));
        }
        self
    }

    /// Returns a track for every garment, hair and solid.
    #[must_use]
    pub fn tracks(&self) -> Vec<Track<'_>> {
        let mut tracks = Vec::new();
        for (number, part) in self.simulation.parts().iter().enumerate() {
            let frames = self.frames.iter().map(|frame| &frame[part.vertices.clone()]).collect();
            let (joined, colour, width) = match part.kind {
                PartKind::Cloth(_) => (Joined::Triangles(&self.triangles[number]), linear(garment_colour(number)), 0.0),
                PartKind::Hair { width, .. } => (Joined::Strands(&self.strands[number]), HAIR, width),
            };
            let colour = part.colour.map_or(colour, linear);
            let of_part = |all: &[&'a [Vector3<f64>]]| all.iter().map(|frame| &frame[part.vertices.clone()]).collect();
            let (velocities, contact_forces) = (of_part(&self.velocities), of_part(&self.contact_forces));
            let (name, corners) = (&part.name, &part.corners);
            tracks.push(Track { name, colour, joined, corners, frames, velocities, contact_forces, width });
        }
        for (obstacle, meshes) in self.simulation.obstacles().iter().zip(&self.solids) {
            let frames = meshes.iter().map(|mesh| mesh.vertices.as_slice()).collect();
            let joined = Joined::Triangles(&meshes[0].triangles);
            let corners = const { &PLAIN };
            let (name, colour, width) = (&obstacle.name, SOLID, 0.0);
            let (velocities, contact_forces) = (Vec::new(), Vec::new());
            tracks.push(Track { name, colour, joined, corners, frames, velocities, contact_forces, width });
        }
        tracks
    }

    /// Draws the vertices at a time, in s. A horizontal plane serves as the floor that receives shadows.
    ///
    /// # Errors
    /// Returns an error if the picture cannot be encoded.
    pub fn picture(&self, positions: &[Vector3<f64>], time: f64) -> Result<Vec<u8>, PictureError> {
        self.picture_with(positions, time, &Look::default())
    }

    /// Draws the vertices with another appearance.
    ///
    /// # Errors
    /// Returns an error if the picture cannot be encoded.
    pub fn picture_with(
        &self,
        positions: &[Vector3<f64>],
        time: f64,
        look: &Look<'_>,
    ) -> Result<Vec<u8>, PictureError> {
        self.scenery.picture(positions, time, &self.framing, look)
    }
}
