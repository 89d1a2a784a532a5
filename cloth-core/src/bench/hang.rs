use energy_elements::ZeroLengthSpring;
use energy_solve::{ElementList, ListError, PotentialTerm, System, SystemError};
use serde::{Deserialize, Serialize};

use crate::Body;
use crate::barrier::{BarrierContact, ContactError, GAP_PER_THICKNESS, thinning};
use crate::collision::CollisionMesh;
use crate::fabric::{self, Bending, Fabric, FabricError, Material, Membrane, Strain, Surroundings};
use crate::integrator::StepError;
use crate::mesh::{Diagonals, MeshError, Plane, Sheet, SpringNetwork};

/// A fabric of the benchmark.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Cloth {
    /// Fifty times softer than cotton: σ = 0.2 kg/m², E h = 5 N/m, ν = 0.3, k = 10⁻⁶ N m.
    Soft,
    /// Cotton: σ = 0.1503 kg/m², E h = 261 N/m, ν = 0.243, k = 1.56·10⁻⁶ N m.
    Cotton,
}

impl Cloth {
    /// Both fabrics.
    pub const ALL: [Self; 2] = [Self::Soft, Self::Cotton];

    /// The name on the command line.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Soft => "soft",
            Self::Cotton => "cotton",
        }
    }

    fn fabric(self) -> Fabric {
        let (density, stretch_stiffness, poisson_ratio, stiffness) = match self {
            Self::Soft => (0.2, 5.0, 0.3, 1e-6),
            Self::Cotton => (0.1503, 261.0, 0.243, 1.56e-6),
        };
        let bending = Bending::Flat { stiffness };
        // The peers' triangles have their own strain.
        let material = Material::NeoHookean(Membrane { stretch_stiffness, poisson_ratio, bending });
        Fabric { strain: Strain::PerTriangle, ..Fabric::new(density, material) }
    }
}

/// A scene of the benchmark that cannot be set up or run.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
#[non_exhaustive]
pub enum BenchError {
    /// The mesh is invalid.
    #[error(transparent)]
    Mesh(#[from] MeshError),
    /// The fabric does not fit the mesh.
    #[error(transparent)]
    Fabric(#[from] FabricError),
    /// The springs at the corners are invalid.
    #[error(transparent)]
    List(#[from] ListError),
    /// The terms cannot be assembled into a system.
    #[error(transparent)]
    System(#[from] SystemError),
    /// The cloth touches itself at the start.
    #[error(transparent)]
    Contact(#[from] ContactError),
    /// A step failed.
    #[error("{cloth}, {vertices} vertices, step {step}: {source}")]
    Step {
        /// Name of the fabric.
        cloth: &'static str,
        vertices: usize,
        /// The step that failed, from 1.
        step: u64,
        /// Why it failed.
        source: StepError,
    },
}

/// Stiffness of the springs that hold the corners, in N/m.
const CORNER_STIFFNESS: f64 = 1e6;

/// Creates a square metre of cloth at rest in z = 0, with `cells` cells along each side and all diagonals along (+, +).
/// Gravity acts along −z, with a drag of 0.1 m v; stiff springs hold the two corners of the edge y = ½.
///
/// # Errors
/// Returns an error if `cells` is 0.
pub fn hang(cloth: Cloth, cells: usize) -> Result<Body, BenchError> {
    let sheet = sheet(cells);
    let mesh = sheet.mesh()?;
    let surroundings = Surroundings { gravity: [0.0, 0.0, -9.81], drag: 0.1 };
    let mut garment = fabric::terms(&cloth.fabric(), &mesh, &SpringNetwork::default(), &surroundings)?;
    let mut x = mesh.vertices().to_vec();
    let mut pinned = vec![false; x.len()];
    let corners = [sheet.vertex(0, cells), sheet.vertex(cells, cells)];
    garment.masses.reserve_exact(corners.len());
    let mut held = Vec::new();
    for corner in corners {
        held.push([corner, x.len()]);
        x.push(x[corner]);
        garment.masses.push(0.0);
        pinned.push(true);
    }
    let springs = vec![ZeroLengthSpring::new(CORNER_STIFFNESS, 0.0); held.len()];
    garment.terms.push(Box::new(PotentialTerm::new(ElementList::new("corners", springs, &held)?)));
    let system = System::new(garment.terms, &pinned)?;
    Ok(Body { v: vec![[0.0; 3]; x.len()], x, masses: garment.masses, system })
}

/// Lets a sheet of [`hang`] touch itself, with the thickness of its fabric as scenes have it.
///
/// # Errors
/// If the sheet touches itself at the start.
pub(super) fn add_contact(body: &mut Body, cloth: Cloth, cells: usize) -> Result<(), BenchError> {
    let mesh = sheet(cells).mesh()?;
    let x = &body.x;
    let is_free = (0..x.len()).map(|vertex| vertex < mesh.vertices().len()).collect();
    let mesh = CollisionMesh::new(x.len(), mesh.triangles(), &[], &[]);
    let whole = cloth.fabric().thickness();
    let thickness = thinning(whole, mesh.shortest_edge(x)) * whole;
    let gap = GAP_PER_THICKNESS * thickness;
    let contact = BarrierContact::new(mesh, x, is_free, vec![0.5 * thickness; x.len()], gap)?;
    body.system.set_contact(Box::new(contact));
    Ok(())
}

fn sheet(cells: usize) -> Sheet {
    Sheet {
        cells: [cells, cells],
        size: [1.0, 1.0],
        diagonals: Diagonals::Regular,
        plane: Plane::Horizontal,
        pleats: None,
    }
}
