//! Depth images: cameras, files, normals, and rendering with sensor noise.

mod camera;
mod distortion;
mod image;
mod intrinsics;
mod normal;
mod pixel_rays;
mod png_file;
mod render;
mod sequence;

pub use camera::{Camera, MOST_PIXELS};
pub use distortion::{Distortion, DistortionCoefficients};
pub use image::DepthImage;
pub use intrinsics::{CameraNameError, GivenCamera, SequenceInfo};
pub use normal::{NormalMap, SurfaceNormal};
pub use pixel_rays::{LensError, PixelRays};
pub use png_file::{DepthFileError, read_depth, read_mask, write_depth};
pub use render::{SensorNoise, render, render_triangles, visible_vertices};
pub use sequence::{DepthSequence, SequenceError};
