//! Reads frames that a run wrote.

use std::io::{Error, ErrorKind};
use std::path::{Path, PathBuf};

use energy_dsl::Vector3;

use crate::output::OutputFolder;

/// A frame that cannot be read.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
#[non_exhaustive]
pub enum FrameError {
    /// The file cannot be read.
    #[error(
        "cannot read {}; frames are shown from OBJ or PLY files: was the run made with `output.obj = false`?",
        .path.display()
    )]
    Unreadable { path: PathBuf, source: Error },
    /// The frame does not fit the scene.
    #[error("{} is damaged: it has {found} vertices, the scene {expected}", .path.display())]
    Damaged {
        path: PathBuf,
        /// Number of vertices in the file.
        found: usize,
        /// Vertices of the scene.
        expected: usize,
    },
}

/// The largest file of a frame, in bytes.
const LARGEST_FRAME: u64 = 1 << 30;

/// Reads the positions of a frame that `cloth run` wrote, in m: from its OBJ file or, without one, from its PLY file in
/// single precision. `expected` is the number of vertices of the scene.
///
/// # Errors
/// Returns an error if neither file can be read, or the number of vertices is another one.
pub fn read_frame(folder: &Path, number: usize, expected: usize) -> Result<Vec<Vector3<f64>>, FrameError> {
    let [obj, ply] = ["obj", "ply"]
        .map(|extension| folder.join(OutputFolder::FRAMES).join(format!("cloth_{number:04}.{extension}")));
    let (path, vertices) = match read(&obj).and_then(energy_files::utf8) {
        Ok(text) => (obj, text.lines().filter_map(obj_vertex).collect::<Vec<_>>()),
        Err(source) if source.kind() == ErrorKind::NotFound && ply.symlink_metadata().is_ok() => {
            let bytes = read(&ply).map_err(|source| FrameError::Unreadable { path: ply.clone(), source })?;
            (ply, ply_vertices(&bytes))
        }
        Err(source) => return Err(FrameError::Unreadable { path: obj, source }),
    };
    let found = vertices.len();
    if found == expected { Ok(vertices) } else { Err(FrameError::Damaged { path, found, expected }) }
}

fn read(path: &Path) -> Result<Vec<u8>, Error> {
    energy_files::read_state(path, LARGEST_FRAME)
}

fn obj_vertex(line: &str) -> Option<Vector3<f64>> {
    let mut numbers =
        line.strip_prefix("v ")?.split(' ').map_while(|word| word.parse().ok().filter(|x: &f64| x.is_finite()));
    Some([numbers.next()?, numbers.next()?, numbers.next()?])
}

/// Returns the positions in a PLY file as [`crate::output::ply_bytes`] writes it; those before the first that is cut
/// off or not finite.
fn ply_vertices(file: &[u8]) -> Vec<Vector3<f64>> {
    const END: &[u8] = b"end_header\n";
    let Some(end) = file.windows(END.len()).position(|window| window == END) else { return Vec::new() };
    let head = String::from_utf8_lossy(&file[..end]);
    let count = head.lines().find_map(|line| line.strip_prefix("element vertex ")?.parse().ok()).unwrap_or(0);
    let stride = 4 * head.lines().filter(|line| line.starts_with("property float ")).count();
    let number = |bytes: &[u8]| bytes.first_chunk().map_or(f64::NAN, |bytes| f64::from(f32::from_le_bytes(*bytes)));
    let vertices = file[end + END.len()..].chunks_exact(stride.max(12)).take(count);
    let vertices = vertices.map(|row| [number(row), number(&row[4..]), number(&row[8..])]);
    vertices.take_while(|x: &Vector3<f64>| x.iter().all(|number| number.is_finite())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::ply_bytes;

    #[test]
    fn positions_come_from_obj_or_ply_files_and_damage_is_told() {
        let folder = tempfile::tempdir().unwrap();
        let frames = folder.path().join("frames");
        std::fs::create_dir(&frames).unwrap();
        let message = read_frame(folder.path(), 3, 2).unwrap_err().to_string();
        assert!(message.contains("cloth_0003.obj; frames are shown from OBJ or PLY files"), "{message}");
        let x = [[0.5, -1.0, 2.0], [0.25, 8.0, 0.0]];
        for forces in [&[][..], &x] {
            let file = ply_bytes(&x, &[[3.0; 3]; 2], forces, &[]);
            std::fs::write(frames.join("cloth_0003.ply"), &file).unwrap();
            assert_eq!(read_frame(folder.path(), 3, 2).unwrap(), x);
            std::fs::write(frames.join("cloth_0003.ply"), &file[..file.len() - 1]).unwrap();
            assert!(matches!(read_frame(folder.path(), 3, 2), Err(FrameError::Damaged { found: 1, .. })));
        }
        std::fs::write(frames.join("cloth_0003.obj"), "v 1 2 3\nv 4 5 6\nvn 0 0 1\nf 1 2 1\n").unwrap();
        assert_eq!(read_frame(folder.path(), 3, 2).unwrap(), [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]]);
    }
}
