//! Overpressure inside closed garments.

use std::collections::BTreeSet;

use energy_dsl::Vector3;
use energy_elements::Pressure;
use energy_solve::DrivenLaw;

use crate::geometry::{cross, dot, subtract};
use crate::mesh::TriangleMesh;
use crate::scene::Inflation;

/// The pressure on the triangles of a closed surface.
#[derive(Debug)]
pub(super) struct PressureLaw {
    pub inflation: Inflation,
    /// A point near the surface, in m.
    pub centre: Vector3<f64>,
}

impl DrivenLaw for PressureLaw {
    type Element = Pressure;

    fn element(&self, _: usize, time: f64) -> Pressure {
        Pressure::new(self.inflation.at(time), self.centre)
    }

    fn varies(&self, from: f64, to: f64) -> bool {
        self.inflation.at(from) != self.inflation.at(to)
    }
}

/// A mesh that encloses no volume.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
#[non_exhaustive]
pub enum NotClosed {
    /// The mesh has a boundary.
    #[error(
        "expected a closed mesh, but {count} edges have a triangle on one side only, first {}–{}; close the mesh, or \
         weld doubled vertices with `weld`", .edge[0], .edge[1]
    )]
    Boundary { count: usize, edge: [usize; 2] },
    /// Two triangles traverse an edge in the same direction.
    #[error(
        "the two triangles at the edge {}–{} have opposite fronts; turn the corners of one, so that all run \
         anticlockwise seen from outside", .edge[0], .edge[1]
    )]
    Unoriented { edge: [usize; 2] },
    /// The fronts point inwards.
    #[error(
        "the mesh is inside out: it encloses {volume:.3e} m³; turn the corners of all triangles, so that they run \
         anticlockwise seen from outside"
    )]
    InsideOut { volume: f64 },
}

/// Returns an error if a mesh does not enclose a positive volume.
pub(super) fn check_closed(mesh: &TriangleMesh) -> Result<(), NotClosed> {
    let mut directed: BTreeSet<[usize; 2]> = BTreeSet::new();
    for edge in mesh.triangles().iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]) {
        if !directed.insert(edge) {
            return Err(NotClosed::Unoriented { edge });
        }
    }
    let mut open = directed.iter().filter(|[a, b]| !directed.contains(&[*b, *a]));
    if let Some(&edge) = open.next() {
        return Err(NotClosed::Boundary { count: 1 + open.count(), edge });
    }
    let volume = volume(mesh);
    if volume > 0.0 { Ok(()) } else { Err(NotClosed::InsideOut { volume }) }
}

/// Returns the volume that the vertices enclose, in m³.
fn volume(mesh: &TriangleMesh) -> f64 {
    let origin = mesh.vertices()[0];
    let cone = |corners: &[usize; 3]| {
        let [a, b, c] = corners.map(|corner| subtract(mesh.vertices()[corner], origin));
        dot(a, cross(b, c)) / 6.0
    };
    mesh.triangles().iter().map(cone).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    const TETRAHEDRON: [[usize; 3]; 4] = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];

    fn checked(triangles: &[[usize; 3]]) -> Result<(), NotClosed> {
        let vertices = vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        check_closed(&TriangleMesh::new(vertices, triangles.to_vec()).unwrap())
    }

    #[test]
    fn only_closed_meshes_with_their_fronts_outside_hold_pressure() {
        assert_eq!(checked(&TETRAHEDRON), Ok(()));
        let open = checked(&TETRAHEDRON[..3]).unwrap_err();
        assert!(open.to_string().contains("but 3 edges have a triangle on one side only, first 0–"), "{open}");
        let mut turned = TETRAHEDRON;
        turned[3].swap(0, 1);
        assert!(matches!(checked(&turned), Err(NotClosed::Unoriented { .. })));
        let flipped = TETRAHEDRON.map(|[a, b, c]| [a, c, b]);
        assert!(
            matches!(checked(&flipped), Err(NotClosed::InsideOut { volume }) if (volume + 1.0 / 6.0).abs() < 1e-15)
        );
    }

    #[test]
    fn the_energy_of_pressure_is_that_of_the_enclosed_volume_and_a_ring_swells() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../scenes/torus.obj");
        let text = format!(
            "dt = 0.01\nduration = 0.1\nintegrator = \"newton\"\ncontact = \"off\"\ngravity = [0.0, 0.0, 0.0]\n\
             [[garment]]\nname = \"tube\"\nmesh.obj.path = \"{path}\"\nfabric.density = 0.2\n\
             fabric.material.stvk = {{ stretch_stiffness = 400.0, poisson_ratio = 0.3 }}\n\
             inflation = {{ pressure = 500.0, rise = 0.05 }}\n"
        );
        let scene = crate::scene::Scene::parse(&text, "tube.toml".as_ref()).unwrap();
        let mut simulation = crate::Simulation::new(&scene).unwrap();
        simulation.keep_ledger().unwrap();
        let volumes: Vec<f64> = (0..=10)
            .map(|step| {
                if step > 0 {
                    simulation.step().unwrap_or_else(|error| panic!("{error}"));
                }
                let mesh = simulation.mesh(0).unwrap();
                let now = TriangleMesh::new(simulation.positions().to_vec(), mesh.triangles().to_vec()).unwrap();
                volume(&now)
            })
            .collect();
        assert!(volumes[10] > 1.01 * volumes[0], "{volumes:?}");
        let ledger = simulation.ledger().unwrap();
        let at = ledger.potentials().iter().position(|name| name == "tube: pressure").unwrap();
        for (step, pressure) in [(0, 0.0), (2, 200.0), (10, 500.0)] {
            let energy = ledger.entries()[step].potential[at];
            assert!((energy + pressure * volumes[step]).abs() <= 1e-12 * pressure, "step {step}: {energy} J");
        }
        let open = text.replace("mesh.obj.path", "mesh.disc = { radius = 0.1, rings = 3 } # ");
        let scene = crate::scene::Scene::parse(&open, "tube.toml".as_ref()).unwrap();
        let message = crate::Simulation::new(&scene).unwrap_err().to_string();
        assert!(message.starts_with("tube: inflation: expected a closed mesh, but 18 edges"), "{message}");
    }
}
