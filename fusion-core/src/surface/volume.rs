use fast_surface_nets::ndshape::RuntimeShape;
use fast_surface_nets::{SurfaceNetsBuffer, surface_nets};
use nalgebra::{Isometry3, Vector3};
use serde::{Deserialize, Serialize};

use super::grid::Grid;
use super::model_distance::model_distances;
use crate::body::Mesh;
use crate::depth::{DepthImage, NormalMap, PixelRays};
use crate::model::DeformationModel;
use crate::option_error::OptionError;
use crate::silhouette::BodyView;

/// Options of a [`SurfaceVolume`].
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
#[non_exhaustive]
pub struct SurfaceOptions {
    /// Distance between voxels, in m.
    pub voxel: f64,
    /// Largest stored distance τ, in m. Several times the sensor's noise, and less than the thickness of the thinnest
    /// limb.
    pub truncation: f64,
    /// Largest distance from the model at which the surface is fused, in m.
    pub reach: f64,
    /// Weight of the model's own surface, in frames seen from the front at 1 m.
    pub model_weight: f64,
}

impl Default for SurfaceOptions {
    fn default() -> Self {
        Self { voxel: 0.008, truncation: 0.02, reach: 0.06, model_weight: 0.1 }
    }
}

/// A volume that cannot be created.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum SurfaceError {
    /// An option cannot be used.
    #[error(transparent)]
    Option(#[from] OptionError),
    /// The grid is too large.
    #[error("the surface needs {voxels:.1e} voxels of {voxel_mm} mm, more than {most:.1e}; increase `surface.voxel`")]
    TooLarge {
        /// Number of voxels.
        voxels: f64,
        /// Distance between voxels, in mm.
        voxel_mm: f64,
        /// Largest number.
        most: f64,
    },
}

impl SurfaceOptions {
    /// Largest number of voxels, which take about 1 GB.
    const MOST_VOXELS: f64 = 3e7;

    /// Checks every option.
    ///
    /// # Errors
    /// Names the first option that cannot be used.
    pub fn validate(&self) -> Result<(), OptionError> {
        OptionError::ensure_positive("surface.voxel", self.voxel)?;
        OptionError::ensure_positive("surface.truncation", self.truncation)?;
        OptionError::ensure_positive("surface.model_weight", self.model_weight)?;
        let far = self.reach >= self.truncation && self.reach <= 1.0;
        OptionError::ensure(far, "surface.reach", "a distance from the truncation to 1 m", self.reach)
    }
}

/// Nearby vertices whose motions a voxel follows.
const FOLLOWED: usize = 4;

/// A voxel near the model.
#[derive(Clone, Debug)]
struct Voxel {
    index: usize,
    /// Nearest vertices, with weights that sum to 1.
    vertices: [(u32, f32); FOLLOWED],
    /// Weighted mean of the signed distances from the surface, at most τ; positive outside, in m.
    distance: f64,
    weight: f64,
}

/// A truncated signed distance field around a model at rest, in the model's coordinates.
#[derive(Clone, Debug)]
pub struct SurfaceVolume {
    options: SurfaceOptions,
    grid: Grid,
    /// Voxels within reach of the model, by index.
    voxels: Vec<Voxel>,
    /// Distances of all voxels from the model's surface.
    far: Vec<f32>,
}

impl SurfaceVolume {
    /// Creates the field of a model's own surface.
    ///
    /// # Errors
    /// If an option cannot be used, or the grid is too large.
    pub fn new(model: &DeformationModel, options: SurfaceOptions) -> Result<Self, SurfaceError> {
        options.validate()?;
        let SurfaceOptions { voxel, reach, .. } = options;
        let grid = Grid::enclosing(&model.mesh.vertices, reach + 2.0 * voxel, voxel);
        let (voxels, most) = (grid.count(), SurfaceOptions::MOST_VOXELS);
        if voxels > most {
            return Err(SurfaceError::TooLarge { voxels, voxel_mm: 1e3 * voxel, most });
        }
        let far = model_distances(&grid, &model.mesh, options.truncation);
        let voxel =
            |(index, vertices)| Voxel { index, vertices, distance: far[index].into(), weight: options.model_weight };
        let voxels = near_voxels(&grid, &model.mesh, &options).into_iter().map(voxel).collect();
        Ok(Self { options, grid, voxels, far })
    }

    /// Adds a depth image. `motions` are the motions of the model's vertices in the frame, in the model's coordinates.
    ///
    /// A moved voxel x meets the point u with the normal n, measured in its pixel. Its distance n·(x − u) counts with
    /// the weight cos α/z²: α is the angle between n and the ray, and the information of a depth falls with its square.
    /// Voxels more than τ behind the surface are hidden and stay unchanged. So do voxels whose part of the model does
    /// not face as the measured surface does, unless they lie in free space. Voxels also stay unchanged in front of a
    /// part of the model that is far from them at rest: a hand may pass in front of a thigh.
    pub fn integrate(
        &mut self,
        model: &DeformationModel,
        motions: &[Isometry3<f64>],
        image: &DepthImage,
        rays: &PixelRays,
        normal_reach: usize,
    ) {
        let mut normals = NormalMap::new(image, rays, normal_reach);
        let vertices = model.mesh.vertices.iter().zip(motions);
        let moved_vertices = vertices.map(|(at, motion)| motion.transform_point(&(*at).into()).coords);
        let view = BodyView::new(&model.seen(moved_vertices), rays.camera());
        let SurfaceOptions { truncation, reach, .. } = self.options;
        for voxel in &mut self.voxels {
            let place = self.grid.place(self.grid.voxel(voxel.index));
            let seen = moved(&voxel.vertices, motions, &place) + model.origin;
            let Some(pixel) = rays.camera().pixel(&seen) else { continue };
            let Some(depth) = image.at(pixel) else { continue };
            // Cheaper than a normal, and leaves out all that lies behind: n·(x − u) is at most |x − u|.
            if seen.z - depth > truncation * STEEPEST {
                continue;
            }
            let of_another_part = |triangle: u32| {
                let vertex = model.mesh.triangles[triangle as usize][0] as usize;
                (model.mesh.vertices[vertex] - place).norm() > 2.0 * reach
            };
            if view.triangle(pixel).is_some_and(of_another_part) {
                continue;
            }
            let Some(measured) = normals.at(pixel) else { continue };
            let cosine = -measured.normal.dot(&seen) / seen.norm();
            let distance = measured.normal.dot(&(seen - rays.point(pixel, depth)));
            let faces = measured.normal.dot(&facing(&voxel.vertices, motions, &model.mesh)) * STEEPEST >= 1.0;
            if cosine * STEEPEST < 1.0 || distance < -truncation || (distance < truncation && !faces) {
                continue;
            }
            let weight = cosine / (depth * depth);
            voxel.distance += weight / (voxel.weight + weight) * (distance.min(truncation) - voxel.distance);
            voxel.weight += weight;
        }
    }

    /// Extracts the surface at rest, in the model's coordinates, by surface nets (Gibson 1998).
    #[must_use]
    pub fn mesh(&self) -> Mesh {
        let mut field = self.far.clone();
        self.voxels.iter().for_each(|voxel| field[voxel.index] = voxel.distance as f32);
        let size = self.grid.size.map(|n| n as u32);
        let shape = RuntimeShape::<u32, 3>::new(size);
        let mut buffer = SurfaceNetsBuffer::default();
        surface_nets(&field, &shape, [0; 3], size.map(|n| n - 1), &mut buffer);
        let vertex = |at: &[f32; 3]| self.grid.corner + self.grid.step * Vector3::from(at.map(f64::from));
        let triangles = buffer.indices.chunks_exact(3).map(|corners| [corners[0], corners[1], corners[2]]).collect();
        Mesh::new(buffer.positions.iter().map(vertex).collect(), triangles)
    }

    /// Returns points at rest moved with the model, in the camera's coordinates. `motions` are those of the model's
    /// vertices. Each point follows the vertices of its voxel.
    #[must_use]
    pub fn posed(
        &self,
        model: &DeformationModel,
        motions: &[Isometry3<f64>],
        points: &[Vector3<f64>],
    ) -> Vec<Vector3<f64>> {
        let one = |point: &Vector3<f64>| {
            let at = (point - self.grid.corner) / self.grid.step;
            let nearest: [usize; 3] =
                std::array::from_fn(|axis| (at[axis].round().max(0.0) as usize).min(self.grid.size[axis] - 1));
            let followed = self.voxels.binary_search_by_key(&self.grid.index(nearest), |voxel| voxel.index);
            let at = followed.unwrap_or_else(|next| next.min(self.voxels.len() - 1));
            moved(&self.voxels[at].vertices, motions, point) + model.origin
        };
        points.iter().map(one).collect()
    }
}

/// Inverse cosine of the steepest angle between a measured normal and its ray, or that of the model: 70°.
const STEEPEST: f64 = 2.9;

/// Returns a point moved by the mean motion of vertices.
fn moved(vertices: &[(u32, f32)], motions: &[Isometry3<f64>], point: &Vector3<f64>) -> Vector3<f64> {
    let one = |&(vertex, weight): &(u32, f32)| {
        f64::from(weight) * motions[vertex as usize].transform_point(&(*point).into()).coords
    };
    vertices.iter().map(one).sum()
}

/// Returns the nearest vertices of each voxel that is within reach of one, by index.
fn near_voxels(grid: &Grid, mesh: &Mesh, options: &SurfaceOptions) -> Vec<(usize, [(u32, f32); FOLLOWED])> {
    let none = (f32::INFINITY, u32::MAX);
    let mut nearest = vec![[none; FOLLOWED]; grid.len()];
    for (vertex, place) in mesh.vertices.iter().enumerate() {
        grid.near(place, options.reach, |index, square| {
            let new = (square as f32, vertex as u32);
            let list = &mut nearest[index];
            let at = list.partition_point(|old| old.0 <= new.0);
            if at < FOLLOWED {
                list[at..].rotate_right(1);
                list[at] = new;
            }
        });
    }
    let softening = (options.voxel * options.voxel) as f32;
    let found = nearest.iter().enumerate().filter(|(_, list)| list[0].1 != u32::MAX);
    found.map(|(index, list)| (index, shares(list, softening))).collect()
}

/// Returns the moved normal of the nearest vertex.
fn facing(vertices: &[(u32, f32)], motions: &[Isometry3<f64>], mesh: &Mesh) -> Vector3<f64> {
    let nearest = vertices[0].0 as usize;
    motions[nearest].rotation * mesh.normals[nearest]
}

/// Returns weights 1/(d² + ε²) of the nearest vertices, normalised. Missing ones repeat the first with weight 0.
fn shares(nearest: &[(f32, u32); FOLLOWED], softening: f32) -> [(u32, f32); FOLLOWED] {
    let weight = |square: f32| if square.is_finite() { 1.0 / (square + softening) } else { 0.0 };
    let sum: f32 = nearest.iter().map(|&(square, _)| weight(square)).sum();
    nearest.map(|(square, vertex)| (if vertex == u32::MAX { nearest[0].1 } else { vertex }, weight(square) / sum))
}
