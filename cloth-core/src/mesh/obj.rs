use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use tobj::{LoadError, LoadOptions};

use super::{MeshError, TriangleMesh};
use crate::input_text;

/// The largest size of an OBJ file, in bytes: some ten million vertices.
const LARGEST_FILE: u64 = 1 << 30;

/// An OBJ file that is not a valid mesh.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
pub enum ObjError {
    /// The file cannot be read.
    #[error("cannot read {}", .path.display())]
    Unreadable { path: PathBuf, source: std::io::Error },
    /// A line is malformed.
    #[error("{}:{line}: {reason}: `{text}`", .path.display())]
    Line {
        path: PathBuf,
        /// The line, from 1.
        line: usize,
        reason: String,
        /// The text of the line.
        text: String,
    },
    /// The mesh is invalid.
    #[error("{}{}: {source}", .path.display(), .line.map(|line| format!(":{line}")).unwrap_or_default())]
    Unfit {
        path: PathBuf,
        /// The line of the invalid vertex or triangle, from 1; `None` if no single line is at fault.
        line: Option<usize>,
        source: MeshError,
    },
}

/// Reads a mesh from an OBJ file. Polygons are split into triangle fans; groups, normals, texture coordinates and
/// materials are ignored. Vertices keep the order of the file, with indices from 0.
///
/// # Errors
/// Returns an error if the file cannot be read, a line is malformed, or the mesh is invalid, with the line number if
/// one line is at fault.
pub fn read_obj(path: &Path) -> Result<TriangleMesh, ObjError> {
    let text = input_text::read_regular(path, LARGEST_FILE)
        .and_then(input_text::utf8)
        .map_err(|source| ObjError::Unreadable { path: path.to_owned(), source })?;
    Lines::of(&text).read(path)
}

/// The vertex and face lines of an OBJ file, with line numbers from 1.
struct Lines<'a> {
    vertices: Vec<(usize, &'a str)>,
    faces: Vec<(usize, &'a str)>,
}

impl<'a> Lines<'a> {
    fn of(text: &'a str) -> Self {
        let starting = |keyword: &'static str| {
            let numbered = text.lines().enumerate().map(|(index, line)| (index + 1, line.trim()));
            numbered.filter(move |(_, line)| line.split_whitespace().next() == Some(keyword)).collect()
        };
        Self { vertices: starting("v"), faces: starting("f") }
    }

    fn read(&self, path: &Path) -> Result<TriangleMesh, ObjError> {
        let models = parse(&self.single_object()).map_err(|error| self.locate(path, error))?;
        let mut vertices = Vec::new();
        let mut triangles = Vec::new();
        let mut line_of_triangle = Vec::new();
        for model in &models {
            vertices.extend(model.mesh.positions.chunks_exact(3).map(|p| [p[0], p[1], p[2]]));
            let polygons = self.polygons(&model.mesh);
            for (corners, &(line, _)) in polygons.iter().zip(&self.faces) {
                for next in 2..corners.len() {
                    triangles.push([corners[0], corners[next - 1], corners[next]]);
                    line_of_triangle.push(line);
                }
            }
        }
        TriangleMesh::new(vertices, triangles).map_err(|source| {
            let line = match &source {
                MeshError::NonFiniteVertex { vertex, .. } | MeshError::Unreferenced { vertex, .. } => {
                    Some(self.vertices[*vertex].0)
                }
                MeshError::VertexOutOfRange { triangle, .. } | MeshError::ZeroArea { triangle, .. } => {
                    Some(line_of_triangle[*triangle])
                }
                MeshError::NonManifoldEdge { triangles, .. } => triangles.last().map(|&last| line_of_triangle[last]),
                MeshError::Empty { .. } => None,
            };
            ObjError::Unfit { path: path.to_owned(), line, source }
        })
    }

    /// Returns the shape as a single object. The parser numbers vertices by first use and drops unused ones. Point
    /// elements for all vertices before the faces preserve the numbering of the file, which pins refer to, and keep
    /// unused vertices, which are then reported.
    fn single_object(&self) -> String {
        let mut text = String::new();
        for (_, line) in &self.vertices {
            text.push_str(line);
            text.push('\n');
        }
        for number in 1..=self.vertices.len() {
            writeln!(text, "l {number}").expect("writing to a string succeeds");
        }
        for (_, line) in &self.faces {
            text.push_str(line);
            text.push('\n');
        }
        text
    }

    /// Returns the corners of each face, without the point elements.
    fn polygons(&self, mesh: &tobj::Mesh) -> Vec<Vec<usize>> {
        let mut start = 0;
        let all = mesh.face_arities.iter().map(|&arity| {
            let corners = mesh.indices[start..start + arity as usize].iter().map(|&corner| corner as usize).collect();
            start += arity as usize;
            corners
        });
        all.skip(self.vertices.len()).collect()
    }

    /// Returns an error at the first line that can be the cause of the parser's error.
    fn locate(&self, path: &Path, error: LoadError) -> ObjError {
        let fails_alone = |line: &&(usize, &str)| match parse(line.1) {
            Err(LoadError::FaceVertexOutOfBounds) | Ok(_) => false,
            Err(_) => true,
        };
        let broken = self.vertices.iter().chain(&self.faces).find(fails_alone);
        let cause = broken.or_else(|| self.faces.iter().find(|(_, line)| self.is_out_of_range(line)));
        match cause {
            Some(&(line, text)) => {
                let reason = match (broken, self.vertices.len()) {
                    (None, count) => format!("the face refers to a vertex that is not among the {count} of the file"),
                    (Some(_), _) => error.to_string(),
                };
                ObjError::Line { path: path.to_owned(), line, reason, text: text.to_owned() }
            }
            None => ObjError::Line { path: path.to_owned(), line: 1, reason: error.to_string(), text: String::new() },
        }
    }

    fn is_out_of_range(&self, face: &str) -> bool {
        let count = self.vertices.len() as i64;
        face.split_whitespace().skip(1).any(|corner| {
            let number = corner.split('/').next().and_then(|number| number.parse::<i64>().ok());
            number.is_none_or(|number| number == 0 || number.abs() > count)
        })
    }
}

fn parse(text: &str) -> Result<Vec<tobj::Model>, LoadError> {
    let options = LoadOptions::default();
    let no_materials = |_: &Path| Err(LoadError::GenericFailure);
    tobj::load_obj_buf(&mut text.as_bytes(), &options, no_materials).map(|(models, _)| models)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<TriangleMesh, String> {
        Lines::of(text).read(Path::new("sheet.obj")).map_err(|error| error.to_string())
    }

    const VERTICES: &str = "# a square\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

    #[test]
    fn vertices_keep_the_numbers_of_the_file() {
        let mesh = read(&format!("{VERTICES}o part\nf 3/1/1 4//2 1\ng other\nusemtl red\nf -4 -3 -2\n")).unwrap();
        assert_eq!(mesh.triangles(), [[2, 3, 0], [0, 1, 2]]);
        assert_eq!(mesh.vertices()[3], [0.0, 1.0, 0.0]);
        assert_eq!(read(&format!("{VERTICES}f 1 2 3 4\n")).unwrap().triangles(), [[0, 1, 2], [0, 2, 3]]);
    }

    #[test]
    fn errors_name_the_line() {
        let message = |more: &str| read(&format!("{VERTICES}{more}")).unwrap_err();
        assert!(read("").unwrap_err().starts_with("sheet.obj: the mesh has 0 vertices"));
        assert!(
            message("f 1 2 3\nf 1 3 9\n").starts_with("sheet.obj:7: the face refers to a vertex"),
            "{}",
            message("f 1 3 9\n")
        );
        assert!(message("f 1 2 3\nf 1 0 4\n").starts_with("sheet.obj:7: "));
        assert!(message("f 1 2 3\nf 1 x 4\n").starts_with("sheet.obj:7: "), "{}", message("f 1 2 3\nf 1 x 4\n"));
        assert!(message("v 1 2 z\nf 1 2 3\n").starts_with("sheet.obj:6: position parse error"));
        assert!(message("v 1 NaN 0\nf 1 2 3\nf 3 4 5\n").starts_with("sheet.obj:6: vertex 4 is not finite"));
        assert!(message("f 1 2 3\n").starts_with("sheet.obj:5: vertex 3 belongs to no triangle"));
        assert!(message("f 1 2 3\nf 1 3 4\nf 1 3 2\n").starts_with("sheet.obj:8: edge 0–2 is shared by 3"));
        assert!(message("f 1 2 3\nf 1 1 4\n").starts_with("sheet.obj:7: triangle 1"));
    }
}
