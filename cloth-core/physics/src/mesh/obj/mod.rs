//! Reads OBJ files as exporters write them.

mod weld;

use std::borrow::Cow;
use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};

use energy_files::excerpt;
use mesh_io::obj::{Corner, Face, ObjFile, ObjFileError};

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
    /// Too many vertices lie just over the distance of welding apart.
    #[error(
        "{}: welding up to {distance} m takes more than {} comparisons, because too many vertices lie just over that \
         distance apart; choose another distance", .path.display(), weld::most_comparisons(*.vertices)
    )]
    Weld {
        path: PathBuf,
        /// In m.
        distance: f64,
        /// Number of vertices that faces use.
        vertices: usize,
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
    /// Triangles and vertices. Vertices that no face uses are left out; the others keep their order.
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
    let mut triangulation = Triangulation::new(file, faces);
    if let Some(distance) = options.weld {
        let vertices = triangulation.sources.len();
        triangulation.weld(distance).ok_or_else(|| ObjError::Weld { path: path.to_owned(), distance, vertices })?;
    }
    triangulation.surface(path)
}

/// Returns the faces of the groups.
fn chosen_faces<'a>(file: &'a ObjFile, path: &Path, groups: Option<&[String]>) -> Result<Cow<'a, [Face]>, ObjError> {
    let Some(groups) = groups else { return Ok(Cow::Borrowed(&file.faces)) };
    let numbers: HashMap<&String, usize> = file.names.iter().zip(0..).collect();
    let mut wanted = vec![false; file.names.len()];
    for name in groups {
        let unknown =
            || ObjError::UnknownGroup { path: path.to_owned(), name: name.clone(), known: file.names.clone() };
        wanted[*numbers.get(name).ok_or_else(unknown)?] = true;
    }
    let is_wanted = |face: &Face| file.groups(*face).iter().any(|&group| wanted[group as usize]);
    Ok(file.faces.iter().copied().filter(is_wanted).collect())
}

/// The triangles of faces, with vertices numbered from 0 without unused ones. Triangles are formed only when they are
/// visited: a file may have one for every two of its bytes.
struct Triangulation<'a> {
    file: &'a ObjFile,
    faces: Cow<'a, [Face]>,
    /// The vertex of the file for each vertex.
    sources: Vec<u32>,
    /// The vertex for each vertex of the file; [`UNUSED`] for those of no face.
    number: Vec<u32>,
    /// Whether vertices were merged. That closes triangles that are smaller than the distance.
    is_welded: bool,
    /// Number of vertices that were merged with another one.
    welded: usize,
}

/// A triangle of a face.
struct Part {
    /// Its index before welding.
    index: usize,
    face: Face,
    /// Its corners in the file.
    corners: [Corner; 3],
    vertices: [usize; 3],
}

/// Marks unused vertices. Files are too small to have this index.
const UNUSED: u32 = u32::MAX;

impl<'a> Triangulation<'a> {
    fn new(file: &'a ObjFile, faces: Cow<'a, [Face]>) -> Self {
        let mut number = vec![UNUSED; file.vertices.len()];
        faces.iter().flat_map(|face| file.corners(*face)).for_each(|corner| number[corner.vertex()] = 0);
        let sources: Vec<u32> = (0..number.len() as u32).filter(|&v| number[v as usize] != UNUSED).collect();
        sources.iter().enumerate().for_each(|(place, &vertex)| number[vertex as usize] = place as u32);
        Self { file, faces, sources, number, is_welded: false, welded: 0 }
    }

    /// Merges vertices up to a distance, in m. Returns `None` if that takes too many comparisons.
    fn weld(&mut self, distance: f64) -> Option<()> {
        let positions: Vec<_> = self.sources.iter().map(|&vertex| self.file.vertices[vertex as usize]).collect();
        let first = weld::welded(&positions, distance)?;
        let all = std::mem::take(&mut self.sources);
        // The first of the merged vertices comes before the others, and has its number by then.
        for (place, &vertex) in all.iter().enumerate() {
            self.number[vertex as usize] = self.number[all[first[place]] as usize];
            if first[place] == place {
                self.number[vertex as usize] = self.sources.len() as u32;
                self.sources.push(vertex);
            }
        }
        self.is_welded = true;
        self.welded = all.len() - self.sources.len();
        Some(())
    }

    /// Returns the triangles that welding has not closed.
    fn parts(&self) -> impl Iterator<Item = Part> {
        let fan = |face: &Face| {
            let (face, polygon) = (*face, self.file.corners(*face));
            (2..polygon.len()).map(move |end| (face, [polygon[0], polygon[end - 1], polygon[end]]))
        };
        let parts = self.faces.iter().flat_map(fan).enumerate().map(|(index, (face, corners))| {
            let vertices = corners.map(|corner| self.number[corner.vertex()] as usize);
            Part { index, face, corners, vertices }
        });
        parts.filter(|part| {
            let [a, b, c] = part.vertices;
            !self.is_welded || a != b && b != c && c != a
        })
    }

    fn surface(&self, path: &Path) -> Result<ObjSurface, ObjError> {
        let file = self.file;
        let unwelded_triangles = self.faces.iter().map(|face| file.corners(*face).len() - 2).sum();
        let mut triangles = Vec::with_capacity(unwelded_triangles);
        triangles.extend(self.parts().map(|part| part.vertices));
        let mut kept = Vec::with_capacity(unwelded_triangles);
        kept.extend(self.parts().map(|part| part.index));
        let vertices = self.sources.iter().map(|&vertex| file.vertices[vertex as usize]).collect();
        let mesh = TriangleMesh::new(vertices, triangles).map_err(|source| self.unfit(path, source))?;
        let uvs = self.attribute(kept.len(), |corner| corner.uv().map(|uv| file.uvs[uv]));
        let corners = CornerAttributes { uvs, normals: self.attribute(kept.len(), Corner::normal) };
        let group_triangles = self.group_triangles();
        let groups = group_triangles.iter().map(|(name, triangles)| {
            let mut vertices: Vec<usize> = triangles.iter().flat_map(|&number| mesh.triangles()[number]).collect();
            vertices.sort_unstable();
            vertices.dedup();
            vertices.shrink_to_fit();
            (name.clone(), vertices)
        });
        let groups = groups.collect();
        let warps = corners.uvs.as_ref().map(|uvs| mesh.warps_of(uvs));
        let (mesh, welded) = (mesh.with_warps(warps), self.welded);
        Ok(ObjSurface { mesh, corners, groups, group_triangles, kept, unwelded_triangles, welded })
    }

    /// Returns an attribute of the corners; `None` unless all of them have it.
    fn attribute<T>(&self, triangles: usize, of: impl Fn(Corner) -> Option<T>) -> Option<Vec<[T; 3]>> {
        let mut all = Vec::with_capacity(triangles);
        for Part { corners: [a, b, c], .. } in self.parts() {
            all.push([of(a)?, of(b)?, of(c)?]);
        }
        Some(all)
    }

    /// Returns the triangles of each group, object and material.
    fn group_triangles(&self) -> BTreeMap<String, Vec<usize>> {
        let names = &self.file.names;
        let mut counts = vec![0; names.len()];
        let all = || {
            self.parts()
                .enumerate()
                .flat_map(|(at, part)| self.file.groups(part.face).iter().map(move |&name| (name as usize, at)))
        };
        all().for_each(|(name, _)| counts[name] += 1);
        let mut triangles: Vec<Vec<usize>> = counts.into_iter().map(Vec::with_capacity).collect();
        all().for_each(|(name, triangle)| triangles[name].push(triangle));
        let named = names.iter().cloned().zip(triangles);
        named.filter(|(_, triangles)| !triangles.is_empty()).collect()
    }

    fn unfit(&self, path: &Path, source: MeshError) -> ObjError {
        let line_of = |triangle: usize| self.parts().nth(triangle).map(|part| part.face.line());
        let line = match &source {
            MeshError::NonFiniteVertex { vertex, .. } | MeshError::Unreferenced { vertex, .. } => {
                self.sources.get(*vertex).map(|&vertex| self.file.vertex_lines[vertex as usize] as usize)
            }
            MeshError::VertexOutOfRange { triangle, .. } | MeshError::ZeroArea { triangle, .. } => line_of(*triangle),
            MeshError::NonManifoldEdge { triangles, .. } => triangles.last().and_then(|&last| line_of(last)),
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
