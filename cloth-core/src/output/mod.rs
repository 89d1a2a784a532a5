//! Output files: frames (OBJ, PLY, PNG), animations (glTF, USD), pictures.

mod animation;
mod crease;
mod floor;
mod floor_shadow;
mod folder;
mod patch;
mod picture;
mod ply;
mod point_cache;
mod projection;
mod raster;
mod scenery;
mod shade;
mod show;
mod smooth_surface;
mod solid_mesh;
mod style;
mod subdivision;
mod surfaces;
mod track;
mod usd;
mod visibility;

pub use animation::animation_glb;
pub use folder::{OutputError, OutputFolder};
pub use mesh_io::animation::AnimationError;
pub use picture::{Look, PictureError, View, picture_png};
pub use ply::ply_bytes;
pub use point_cache::{mdd_bytes, pc2_bytes};
pub use scenery::{Framing, Scenery};
pub use show::Show;
pub use solid_mesh::SolidMesh;
pub use track::{Joined, Track};
pub use usd::usd_text;

use energy_dsl::Vector3;

use crate::geometry::{cross, norm, subtract};

/// Returns unit vertex normals: the area-weighted mean of the adjacent triangles' normals.
#[must_use]
pub fn vertex_normals(positions: &[Vector3<f64>], triangles: &[[usize; 3]]) -> Vec<Vector3<f64>> {
    let mut normals = vec![[0.0; 3]; positions.len()];
    for &corners in triangles {
        let [a, b, c] = corners.map(|corner| positions[corner]);
        let normal = cross(subtract(b, a), subtract(c, a));
        for corner in corners {
            (0..3).for_each(|axis| normals[corner][axis] += normal[axis]);
        }
    }
    for normal in &mut normals {
        let length = norm(*normal);
        // The normals of folded triangles may cancel; any unit vector is good enough for shading.
        *normal = if length > 0.0 && length.is_finite() {
            normal.map(|component| component / length)
        } else {
            [0.0, 0.0, 1.0]
        };
    }
    normals
}
