//! The files of single frames, OBJ and PLY.

use std::fs::OpenOptions;
use std::io::{Read, Seek, SeekFrom};
use std::path::Path;

use energy_dsl::Vector3;
use mesh_io::obj::{ObjMesh, last_obj_line, obj_text};

use super::frame_store::Vectors;
use super::{Run, RunError};
use crate::output::{ply_bytes, vertex_normals};

impl Run {
    /// Writes the files of a frame. A resumed run writes only those that are missing or truncated.
    pub(super) fn write_frame_files(
        &self,
        number: usize,
        x: &[Vector3<f64>],
        vectors: &Vectors,
        only_broken: bool,
    ) -> Result<usize, RunError> {
        let (simulation, wanted) = (&self.simulation, &self.scene.output);
        let mut written = 0;
        if wanted.obj && !(only_broken && self.has_whole_obj(number)) {
            let (triangles, strands) = (simulation.triangles(), simulation.strands());
            let normals = vertex_normals(x, triangles);
            let text = obj_text(&ObjMesh { positions: x, digits: 9, normals: Some(&normals), triangles, strands });
            self.folder.write_frame(number, "obj", text.as_bytes())?;
            written += 1;
        }
        let ply = || ply_bytes(x, &vectors.velocities, &vectors.forces, simulation.triangles());
        if wanted.ply && !(only_broken && has_contents(&self.folder.frame_path(number, "ply"), &ply())) {
            self.folder.write_frame(number, "ply", &ply())?;
            written += 1;
        }
        Ok(written)
    }

    /// Whether the OBJ file of a frame exists and ends as it should. Formatting all frames again would take long.
    fn has_whole_obj(&self, number: usize) -> bool {
        let end = last_obj_line(self.simulation.triangles(), self.simulation.strands(), true);
        ends_with(&self.folder.frame_path(number, "obj"), end.as_bytes()).unwrap_or(false)
    }
}

fn has_contents(path: &Path, contents: &[u8]) -> bool {
    energy_files::read_state(path, contents.len() as u64).is_ok_and(|found| found == contents)
}

fn ends_with(path: &Path, end: &[u8]) -> std::io::Result<bool> {
    let mut file = energy_files::open_state(path, u64::MAX, OpenOptions::new().read(true))?;
    if file.metadata()?.len() < end.len() as u64 {
        return Ok(false);
    }
    file.seek(SeekFrom::End(-(end.len() as i64)))?;
    let mut found = Vec::new();
    file.read_to_end(&mut found)?;
    Ok(found == end)
}
