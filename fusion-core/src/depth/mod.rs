//! Depth images: cameras, files, normals, and rendering with sensor noise.

mod camera;
mod image;
mod normal;
mod png_file;
mod render;
mod sequence;

pub use camera::Camera;
pub use image::DepthImage;
pub use normal::{NormalMap, SurfaceNormal};
pub use png_file::{DepthFileError, read_depth, read_mask, write_depth};
pub use render::{SensorNoise, hidden_vertices, render, visible_vertices};
pub use sequence::{DepthSequence, SequenceError, SequenceInfo};
