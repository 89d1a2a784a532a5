//! Reads OBJ files as exporters write them.

mod weld;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use energy_dsl::Vector3;

use energy_files::excerpt;
use mesh_obj::{Corner, Face, ObjFile, ObjFileError};

use super::{CornerAttributes, MeshError, TriangleMesh};

/// An OBJ file that is not a valid mesh.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
#[non_exhaustive]
pub enum ObjError {
    /// The file cannot be read, or a line is malformed.
    #[error(transparent)]
    File(#[from] ObjFileError),
    /// The file has no such group.
    #[error(
        "{}: there is no group, object or material called `{name}`; there are {}",
        .path.display(), excerpt(&.known.join(", "))
    )]
    UnknownGroup {
        path: PathBuf,
        name: String,
        /// The names in the file.
        known: Vec<String>,
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

/// The part of an OBJ file to read, and how to read it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct ObjOptions<'a> {
    /// Groups, objects or materials whose faces are read; `None` for all faces.
    pub groups: Option<&'a [String]>,
    /// Merges vertices up to this distance, in m; `None` to keep them apart.
    pub weld: Option<f64>,
}

/// A surface from an OBJ file.
#[derive(Clone, Debug, PartialEq)]
pub struct ObjSurface {
    /// The mesh. Vertices that no face uses are left out; the others keep their order.
    pub mesh: TriangleMesh,
    /// Texture coordinates and normals of the corners.
    pub corners: CornerAttributes,
    /// The vertices of each group, object and material.
    pub groups: BTreeMap<String, Vec<usize>>,
    /// The triangles of each group, object and material.
    pub group_triangles: BTreeMap<String, Vec<usize>>,
    /// For each triangle its index before welding, which closes small ones.
    pub kept: Vec<usize>,
    /// Number of triangles before welding.
    pub unwelded_triangles: usize,
    /// Number of vertices that were merged with another one.
    pub welded: usize,
}

/// Reads a mesh from an OBJ file; see [`read_obj_surface`].
///
/// # Errors
/// Returns an error if the file cannot be read, a line is malformed, or the mesh is invalid.
pub fn read_obj(path: &Path) -> Result<TriangleMesh, ObjError> {
    read_obj_surface(path, ObjOptions::default()).map(|surface| surface.mesh)
}

/// Reads a surface from an OBJ file. Polygons are split into triangle fans. The text is UTF-8 or Latin-1.
///
/// # Errors
/// Returns an error if the file cannot be read, a line is malformed, a group does not exist, or the mesh is invalid,
/// with the line number if one line is at fault.
pub fn read_obj_surface(path: &Path, options: ObjOptions<'_>) -> Result<ObjSurface, ObjError> {
    surface(&ObjFile::read(path)?, path, options)
}

fn surface(file: &ObjFile, path: &Path, options: ObjOptions<'_>) -> Result<ObjSurface, ObjError> {
    let faces = chosen_faces(file, path, options.groups)?;
    Triangulation::new(file, &faces, options.weld).surface(file, path)
}

/// Returns the faces of the groups.
fn chosen_faces(file: &ObjFile, path: &Path, groups: Option<&[String]>) -> Result<Vec<Face>, ObjError> {
    let Some(groups) = groups else { return Ok(file.faces.clone()) };
    let number = |name: &String| {
        let unknown =
            || ObjError::UnknownGroup { path: path.to_owned(), name: name.clone(), known: file.names.clone() };
        file.names.iter().position(|known| known == name).ok_or_else(unknown)
    };
    let wanted: Vec<usize> = groups.iter().map(number).collect::<Result<_, _>>()?;
    let is_wanted = |face: &Face| file.groups(*face).iter().any(|group| wanted.contains(group));
    Ok(file.faces.iter().copied().filter(is_wanted).collect())
}

/// The triangles of faces, with vertices numbered from 0 without unused ones.
struct Triangulation {
    /// The vertex of the file for each vertex.
    sources: Vec<usize>,
    triangles: Vec<[usize; 3]>,
    /// The corners of each triangle in the file, and its face.
    corners: Vec<[Corner; 3]>,
    faces: Vec<Face>,
    /// The index of each triangle before welding.
    kept: Vec<usize>,
    unwelded: usize,
    welded: usize,
}

impl Triangulation {
    fn new(file: &ObjFile, faces: &[Face], weld: Option<f64>) -> Self {
        let mut used = vec![false; file.vertices.len()];
        faces.iter().flat_map(|face| file.corners(*face)).for_each(|corner| used[corner.vertex()] = true);
        let used: Vec<usize> = (0..used.len()).filter(|&vertex| used[vertex]).collect();
        // The vertex of the file that stands for each.
        let mut merged: Vec<usize> = (0..file.vertices.len()).collect();
        if let Some(distance) = weld {
            let positions: Vec<Vector3<f64>> = used.iter().map(|&vertex| file.vertices[vertex]).collect();
            let first = weld::welded(&positions, distance);
            used.iter().zip(first).for_each(|(&vertex, first)| merged[vertex] = used[first]);
        }
        let sources: Vec<usize> = used.iter().copied().filter(|&vertex| merged[vertex] == vertex).collect();
        let mut number = vec![usize::MAX; file.vertices.len()];
        sources.iter().enumerate().for_each(|(new, &vertex)| number[vertex] = new);
        let welded = used.len() - sources.len();
        let count = faces.iter().map(|face| file.corners(*face).len() - 2).sum();
        let (triangles, corners) = (Vec::with_capacity(count), Vec::with_capacity(count));
        let (owners, kept, unwelded) = (Vec::with_capacity(count), Vec::with_capacity(count), 0);
        let mut all = Self { sources, triangles, corners, faces: owners, kept, unwelded, welded };
        for face in faces {
            let polygon = file.corners(*face);
            for end in 2..polygon.len() {
                let corners = [polygon[0], polygon[end - 1], polygon[end]];
                let triangle = corners.map(|corner| number[merged[corner.vertex()]]);
                let [a, b, c] = triangle;
                // Welding closes triangles that are smaller than its distance.
                if weld.is_none() || a != b && b != c && c != a {
                    all.triangles.push(triangle);
                    all.corners.push(corners);
                    all.faces.push(*face);
                    all.kept.push(all.unwelded);
                }
                all.unwelded += 1;
            }
        }
        all
    }

    fn surface(self, file: &ObjFile, path: &Path) -> Result<ObjSurface, ObjError> {
        let vertices = self.sources.iter().map(|&vertex| file.vertices[vertex]).collect();
        let corners = self.attributes(file);
        let mut groups: BTreeMap<String, Vec<usize>> = BTreeMap::new();
        let mut group_triangles: BTreeMap<String, Vec<usize>> = BTreeMap::new();
        for (number, (triangle, face)) in self.triangles.iter().zip(&self.faces).enumerate() {
            for name in file.groups(*face).iter().map(|&name| &file.names[name]) {
                groups.entry(name.clone()).or_default().extend(triangle);
                group_triangles.entry(name.clone()).or_default().push(number);
            }
        }
        for vertices in groups.values_mut() {
            vertices.sort_unstable();
            vertices.dedup();
        }
        let mesh = TriangleMesh::new(vertices, self.triangles.clone());
        let mesh = mesh.map_err(|source| self.unfit(file, path, source))?;
        let warps = corners.uvs.as_ref().map(|uvs| mesh.warps_of(uvs));
        let Self { kept, unwelded, welded, .. } = self;
        let mesh = mesh.with_warps(warps);
        Ok(ObjSurface { mesh, corners, groups, group_triangles, kept, unwelded_triangles: unwelded, welded })
    }

    /// Texture coordinates and normals, each only if all corners have them.
    fn attributes(&self, file: &ObjFile) -> CornerAttributes {
        let of = |pick: fn(Corner) -> Option<usize>| -> Option<Vec<[usize; 3]>> {
            let triangle = |corners: &[Corner; 3]| -> Option<[usize; 3]> {
                let [a, b, c] = corners.map(pick);
                Some([a?, b?, c?])
            };
            self.corners.iter().map(triangle).collect()
        };
        let uvs = of(Corner::uv);
        let uvs = uvs.map(|uvs| uvs.into_iter().map(|corners| corners.map(|corner| file.uvs[corner])).collect());
        CornerAttributes { uvs, normals: of(Corner::normal) }
    }

    fn unfit(&self, file: &ObjFile, path: &Path, source: MeshError) -> ObjError {
        let line = match &source {
            MeshError::NonFiniteVertex { vertex, .. } | MeshError::Unreferenced { vertex, .. } => {
                self.sources.get(*vertex).map(|&vertex| file.vertex_lines[vertex] as usize)
            }
            MeshError::VertexOutOfRange { triangle, .. } | MeshError::ZeroArea { triangle, .. } => {
                Some(self.faces[*triangle].line())
            }
            MeshError::NonManifoldEdge { triangles, .. } => triangles.last().map(|&last| self.faces[last].line()),
            MeshError::Empty { .. } => None,
        };
        ObjError::Unfit { path: path.to_owned(), line, source }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read_with(text: &str, options: ObjOptions<'_>) -> Result<ObjSurface, String> {
        let path = Path::new("sheet.obj");
        let file = ObjFile::parse(text, path).map_err(|error| error.to_string())?;
        surface(&file, path, options).map_err(|error| error.to_string())
    }

    fn read(text: &str) -> Result<TriangleMesh, String> {
        read_with(text, ObjOptions::default()).map(|surface| surface.mesh)
    }

    const VERTICES: &str = "# a square\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

    #[test]
    fn vertices_keep_the_order_of_the_file() {
        let text = format!("{VERTICES}vt 0 0\nvn 0 0 1\no part\nf 3/1/1 4//1 1\ng other\nusemtl red\nf -4 -3 -2\n");
        let mesh = read(&text).unwrap();
        assert_eq!(mesh.triangles(), [[2, 3, 0], [0, 1, 2]]);
        assert_eq!(mesh.vertices()[3], [0.0, 1.0, 0.0]);
        assert_eq!(read(&format!("{VERTICES}f 1 2 3 4\n")).unwrap().triangles(), [[0, 1, 2], [0, 2, 3]]);
        // Relative numbers count from the line of the face; unused vertices are left out.
        let mesh = read(&format!("v 9 9 9\n{VERTICES}f -4 -3 -2\nv 2 2 2\nf -4 -3 -2\n")).unwrap();
        assert_eq!(mesh.triangles(), [[0, 1, 2], [1, 2, 3]]);
        assert_eq!((mesh.vertices().len(), mesh.vertices()[0]), (4, [0.0; 3]));
    }

    #[test]
    fn groups_choose_faces_and_doubled_vertices_are_welded() {
        let doubled = format!("{VERTICES}v 0 0 1e-9\nv 1 1 0\ng left\nf 1 2 3\ng right top\nf 5 6 4\n");
        let all = read_with(&doubled, ObjOptions::default()).unwrap();
        assert_eq!((all.mesh.pieces(1).len(), all.welded), (2, 0));
        assert_eq!(all.groups["right"], [3, 4, 5]);
        let welded = read_with(&doubled, ObjOptions { weld: Some(1e-6), ..ObjOptions::default() }).unwrap();
        assert_eq!((welded.mesh.pieces(1).len(), welded.welded), (1, 2));
        assert_eq!(welded.mesh.triangles(), [[0, 1, 2], [0, 2, 3]]);
        assert_eq!(welded.groups["top"], [0, 2, 3]);
        let names = ["right".to_owned()];
        let right = read_with(&doubled, ObjOptions { groups: Some(&names), ..ObjOptions::default() }).unwrap();
        assert_eq!((right.mesh.vertices().len(), right.mesh.triangles()), (3, &[[1, 2, 0]][..]));
        let names = ["rihgt".to_owned()];
        let message = read_with(&doubled, ObjOptions { groups: Some(&names), ..ObjOptions::default() }).unwrap_err();
        assert_eq!(
            message,
            "sheet.obj: there is no group, object or material called `rihgt`; there are left, right, top"
        );
    }

    #[test]
    fn errors_name_the_line() {
        let message = |more: &str| read(&format!("{VERTICES}{more}")).unwrap_err();
        assert!(read("").unwrap_err().starts_with("sheet.obj: the mesh has 0 vertices"));
        assert!(message("f 1 2 3\nf 1 3 9\n").starts_with("sheet.obj:7: the face refers to a vertex"));
        assert!(message("f 1 2 3\nf 1 0 4\n").starts_with("sheet.obj:7: "));
        assert!(message("f 1 2 3\nf 1 x 4\n").starts_with("sheet.obj:7: expected a whole number, got `x`"));
        assert!(message("f 1 2 3\nf 1 4\n").starts_with("sheet.obj:7: a face needs at least three corners, got 2"));
        assert!(message("f 1/1 2/1 3/1\n").starts_with("sheet.obj:6: the face refers to a texture coordinate"));
        assert!(message("v 1 2 z\nf 1 2 3\n").starts_with("sheet.obj:6: expected a number, got `z`"));
        assert!(message("v 1 2\nf 1 2 3\n").starts_with("sheet.obj:6: expected 3 numbers, got 2"));
        assert!(message("v 1 NaN 0\nf 1 2 3\nf 3 4 5\n").starts_with("sheet.obj:6: vertex 4 is not finite"));
        assert!(message("f 1 2 3\nf 1 3 4\nf 1 3 2\n").starts_with("sheet.obj:8: edge 0–2 is shared by 3"));
        assert!(message("f 1 2 3\nf 1 1 4\n").starts_with("sheet.obj:7: triangle 1"));
    }
}
