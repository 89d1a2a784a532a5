//! The memory that a run will need, estimated before anything is built.

use std::fmt;

use crate::integrator::Scheme;
use crate::scene::{ContactChoice, Mesh, Scene};

/// Bytes of an OBJ file per vertex, with its share of faces: a short line each.
const FILE_BYTES_PER_VERTEX: f64 = 60.0;
/// Bytes of a pin or a garment in one reading, with its part of the file.
const READING: f64 = 500.0;
/// Bytes per entry of the ledger, one per step.
const LEDGER_ENTRY: f64 = 400.0;

/// An estimate of the memory that a run needs. Its factors were measured on sheets of 10,201 and 40,401 vertices.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MemoryNeed {
    /// Number of vertices.
    pub vertices: f64,
    /// Number of frames.
    pub frames: f64,
    /// Bytes of the simulation.
    pub simulation: f64,
    /// Bytes of the frames, and of the files that hold all of them.
    pub output: f64,
}

impl MemoryNeed {
    /// Estimates the need of a scene.
    #[must_use]
    pub fn of(scene: &Scene) -> Self {
        let vertices: f64 = scene.garments.iter().map(|garment| vertices_of(&garment.mesh, scene)).sum();
        let hair: f64 = scene.hair.iter().map(|hair| (hair.count * (hair.segments + 1)) as f64).sum();
        let vertices = vertices + hair;
        let per_vertex = match scene.integrator {
            Scheme::ExplicitEuler | Scheme::ExplicitEulerAsPrinted | Scheme::SymplecticEuler | Scheme::Verlet => 4500.0,
            Scheme::ImplicitEuler => 5500.0,
            _ if scene.contact == ContactChoice::On => 8000.0,
            _ => 7000.0,
        };
        let steps = scene.steps() as f64;
        let frames = (steps / scene.time_grid().steps_per_frame as f64).floor() + 1.0;
        let wanted = &scene.output;
        // Positions are kept. A file with all frames is built in memory, as text or in single precision with normals.
        let per_point = if wanted.usd {
            let vectors = usize::from(wanted.velocities) + usize::from(wanted.contact_forces);
            24.0 + 80.0 + (24.0 + 40.0) * vectors as f64
        } else if wanted.gltf {
            24.0 + 24.0
        } else {
            24.0
        };
        let readings = frames * (READING * (scene.pins.len() + scene.garments.len()) as f64);
        let ledger = if wanted.ledger { LEDGER_ENTRY * steps } else { 0.0 };
        Self {
            vertices,
            frames,
            simulation: per_vertex * vertices + ledger + readings,
            output: per_point * vertices * frames,
        }
    }

    /// The total, in bytes.
    #[must_use]
    pub fn total(&self) -> f64 {
        self.simulation + self.output
    }
}

fn vertices_of(mesh: &Mesh, scene: &Scene) -> f64 {
    let of_cells = |[columns, rows]: [usize; 2]| ((columns + 1) * (rows + 1)) as f64;
    match mesh {
        Mesh::Sheet(sheet) => of_cells(sheet.cells),
        Mesh::Strip(strip) => of_cells(strip.sheet().cells),
        Mesh::Disc(disc) => (1 + 3 * disc.rings * (disc.rings + 1)) as f64,
        Mesh::Obj { path, .. } => {
            let size = std::fs::metadata(scene.folder.join(path)).map_or(0, |metadata| metadata.len());
            size as f64 / FILE_BYTES_PER_VERTEX
        }
    }
}

impl fmt::Display for MemoryNeed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [simulation, output] = [self.simulation, self.output].map(Gigabytes);
        write!(f, "about {simulation} for {:.0} vertices and {output} for {:.0} frames", self.vertices, self.frames)
    }
}

/// A number of bytes.
pub(super) struct Gigabytes(pub f64);

impl fmt::Display for Gigabytes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.2} GB", 1e-9 * self.0)
    }
}
