use std::f64::consts::TAU;

use energy_dsl::Vector3;
use schemars::JsonSchema;
use serde::Deserialize;

use super::{MeshError, TriangleMesh};
use crate::bounded::{Count, Positive, Real};

/// A built-in disc, centred on the origin in z = 0 with its front upwards.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Disc {
    /// The radius, in m.
    #[serde(with = "Real::<Positive>")]
    pub radius: f64,
    /// Rings of triangles; ring k has 6 k vertices.
    #[serde(with = "Count::<1, 4096>")]
    pub rings: usize,
}

impl Disc {
    /// Builds the mesh. Vertex 0 is the centre; then ring by ring, anticlockwise from the first axis.
    ///
    /// ```
    /// use cloth_physics::mesh::{Disc, lumped_masses};
    /// let mesh = Disc { radius: 2.0, rings: 40 }.mesh()?;
    /// assert_eq!(mesh.vertices().len(), 1 + 3 * 40 * 41);
    /// let mass: f64 = lumped_masses(&mesh, 1.0).iter().sum();
    /// assert!((mass / (4.0 * std::f64::consts::PI) - 1.0).abs() < 1e-3);
    /// # Ok::<(), cloth_physics::mesh::MeshError>(())
    /// ```
    ///
    /// # Errors
    /// Returns an error if its triangles have no area.
    pub fn mesh(&self) -> Result<TriangleMesh, MeshError> {
        let mut vertices: Vec<Vector3<f64>> = vec![[0.0; 3]];
        let mut triangles = Vec::with_capacity(6 * self.rings * self.rings);
        for ring in 1..=self.rings {
            let radius = self.radius * ring as f64 / self.rings as f64;
            let around = 6 * ring;
            let at = |step: usize| {
                let (sine, cosine) = (TAU * step as f64 / around as f64).sin_cos();
                [radius * cosine, radius * sine, 0.0]
            };
            vertices.extend((0..around).map(at));
            for sector in 0..6 {
                let outer = |step: usize| vertex(ring, sector * ring + step);
                let inner = |step: usize| vertex(ring - 1, sector * (ring - 1) + step);
                triangles.extend((0..ring).map(|step| [inner(step), outer(step), outer(step + 1)]));
                triangles.extend((0..ring - 1).map(|step| [inner(step), outer(step + 1), inner(step + 1)]));
            }
        }
        TriangleMesh::new(vertices, triangles)
    }
}

/// Returns the index of a vertex, given its ring and its position along the ring.
fn vertex(ring: usize, step: usize) -> usize {
    if ring == 0 { 0 } else { 1 + 3 * ring * (ring - 1) + step % (6 * ring) }
}
