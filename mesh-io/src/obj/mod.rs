//! Wavefront OBJ files, as exporters write them.
//!
//! [`ObjFile`] has the vertices, texture coordinates and faces of a file with their lines and groups. It makes no mesh:
//! readers decide which faces they need and whether a mesh is valid.
//!
//! A file may come from a stranger. It is a regular file of at most [`LARGEST_FILE`] bytes. A face has at most
//! [`MOST_CORNERS`] corners and [`MOST_NAMES`] groups, a file [`MOST_FILE_NAMES`] names. A file of n bytes has at most
//! 1,000,000 + n/16 triangles; counted in each of their groups, 2,000,000 + n/4.

mod file;
mod lines;
mod write;

pub use file::{
    Corner, Face, LARGEST_FILE, LARGEST_UV, MOST_CORNERS, MOST_FILE_NAMES, MOST_NAMES, ObjFile, ObjFileError,
};
pub use write::{ObjMesh, last_obj_line, obj_text};
