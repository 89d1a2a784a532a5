//! Fusion of depth images into a surface at rest (Curless and Levoy, *A Volumetric Method for Building Complex Models
//! from Range Images*, 1996; Newcombe et al., *DynamicFusion*, 2015).
//!
//! A truncated signed distance field fills a grid around the model at rest. In each frame, its voxels move with the
//! model and are compared with the depth image. The mean over the frames has a zero surface with the details that the
//! images show and the model lacks. Where no image shows the body, the surface remains that of the model.

mod grid;
mod model_distance;
mod volume;

pub use volume::{SurfaceError, SurfaceOptions, SurfaceVolume};
