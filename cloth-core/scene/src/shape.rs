//! Builds the shape of a garment from its description.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use energy_dsl::Vector3;

use super::garment::{Garment, Mesh, Placement};
use super::rest_shape::{RestFile, RestScale, RestShape, RestTexture};
use cloth_physics::geometry::{cross, subtract};
use cloth_physics::mesh::{
    CornerAttributes, MeshError, ObjError, ObjOptions, PleatsError, ScaleError, SpringNetwork, Topology, TriangleMesh,
    read_obj_surface,
};

/// A mesh that cannot be built.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
#[non_exhaustive]
pub enum MeshSourceError {
    /// The OBJ file is invalid.
    #[error(transparent)]
    Obj(#[from] ObjError),
    /// A built-in or scaled mesh is invalid.
    #[error("mesh: {0}")]
    Built(#[from] MeshError),
    /// The pleats of a sheet are too deep.
    #[error("mesh.sheet.pleats: {0}")]
    Pleats(#[from] PleatsError),
    /// The rest shape has other faces than the mesh.
    #[error(
        "rest.obj: {} has {found} triangles, the mesh has {expected}; export both from one model, with the same faces \
         in the same order", .path.display()
    )]
    OtherFaces { path: PathBuf, expected: usize, found: usize },
    /// The mesh has no texture coordinates.
    #[error("rest.uv: the mesh has no texture coordinates; expected an OBJ file in which every corner has some")]
    NoUvs,
    /// A triangle of the rest shape is invalid.
    #[error("rest: {0}")]
    Rest(MeshError),
    /// The mesh has no such group.
    #[error(
        "rest_scale[{entry}]: there is no group `{name}`; {}",
        if .known.is_empty() { "the mesh has no groups".to_owned() } else { format!("there are {}", .known.join(", ")) }
    )]
    NoSuchGroup {
        /// Index of the entry, from 0.
        entry: usize,
        name: String,
        known: Vec<String>,
    },
    /// The rest shape cannot be scaled.
    #[error("rest_scale: {0}")]
    Scale(#[from] ScaleError),
}

/// The shape of a garment.
#[derive(Clone, Debug, PartialEq)]
pub struct Shape {
    /// The rest mesh.
    pub mesh: TriangleMesh,
    /// Initial positions, in m.
    pub start: Vec<Vector3<f64>>,
    /// Initial velocities, in m/s.
    pub velocities: Vec<Vector3<f64>>,
    /// The vertex pairs that a mass–spring fabric joins.
    pub springs: SpringNetwork,
    /// Attributes of the corners, from an OBJ file.
    pub corners: CornerAttributes,
    /// The vertices of each group of an OBJ file.
    pub groups: BTreeMap<String, Vec<usize>>,
    /// Number of vertices that were merged with another one; `None` unless the garment comes from an OBJ file.
    pub welded: Option<usize>,
}

/// A mesh before its placement, with the attributes in its file.
struct Source {
    mesh: TriangleMesh,
    corners: CornerAttributes,
    groups: BTreeMap<String, Vec<usize>>,
    group_triangles: BTreeMap<String, Vec<usize>>,
    /// For each triangle its index before welding.
    kept: Vec<usize>,
    /// Number of triangles before welding.
    unwelded: usize,
    welded: Option<usize>,
}

impl Source {
    fn built(mesh: TriangleMesh) -> Self {
        let count = mesh.triangles().len();
        let (corners, groups, group_triangles) = (CornerAttributes::default(), BTreeMap::new(), BTreeMap::new());
        Self { mesh, corners, groups, group_triangles, kept: (0..count).collect(), unwelded: count, welded: None }
    }
}

impl Mesh {
    fn source(&self, folder: &Path) -> Result<Source, MeshSourceError> {
        Ok(match self {
            Self::Sheet(sheet) => Source::built(sheet.mesh()?),
            Self::Strip(strip) => Source::built(strip.sheet().mesh()?),
            Self::Disc(disc) => Source::built(disc.mesh()?),
            Self::Obj { path, groups, weld } => {
                let mut options = ObjOptions::default();
                (options.groups, options.weld) = (groups.as_deref(), *weld);
                let surface = read_obj_surface(&folder.join(path), options)?;
                Source {
                    mesh: surface.mesh,
                    corners: surface.corners,
                    groups: surface.groups,
                    group_triangles: surface.group_triangles,
                    kept: surface.kept,
                    unwelded: surface.unwelded_triangles,
                    welded: Some(surface.welded),
                }
            }
        })
    }
}

impl Garment {
    /// Builds the shape. Relative paths refer to `folder`.
    ///
    /// # Errors
    /// Returns an error if a file cannot be read, or the mesh or its rest shape is invalid.
    pub fn shape(&self, folder: &Path) -> Result<Shape, MeshSourceError> {
        let sheet = match &self.mesh {
            Mesh::Sheet(sheet) => Some(*sheet),
            Mesh::Strip(strip) => Some(strip.sheet()),
            Mesh::Disc(_) | Mesh::Obj { .. } => None,
        };
        let mut source = self.mesh.source(folder)?;
        let initial = sheet.map_or_else(|| Ok(source.mesh.vertices().to_vec()), |sheet| sheet.start())?;
        let springs = match &sheet {
            Some(sheet) => SpringNetwork::of_sheet(sheet),
            None => SpringNetwork::of_mesh(&Topology::of(&source.mesh)),
        };
        let Placement { scale, translate, .. } = self.placement;
        if scale != 1.0 {
            source.mesh = source.mesh.scaled(scale)?;
        }
        let mesh = self.at_rest(&source, folder)?;
        let pose = self.placement.pose();
        let start: Vec<Vector3<f64>> = initial.iter().map(|p| pose.transform(p.map(|c| scale * c))).collect();
        let velocity = |p: &Vector3<f64>| -> Vector3<f64> {
            let turning = cross(self.spin, subtract(*p, translate));
            std::array::from_fn(|axis| self.velocity[axis] + turning[axis])
        };
        let velocities = start.iter().map(velocity).collect();
        let Source { corners, groups, welded, .. } = source;
        Ok(Shape { mesh, start, velocities, springs, corners, groups, welded })
    }

    /// Returns the mesh with its rest shape.
    fn at_rest(&self, source: &Source, folder: &Path) -> Result<TriangleMesh, MeshSourceError> {
        let mesh = source.mesh.clone();
        let patterns = match &self.rest {
            None => return self.scaled_by_groups(mesh, source),
            Some(RestShape::Obj(RestFile { path })) => self.patterns_from(&folder.join(path), source)?,
            Some(RestShape::Uv(RestTexture { scale })) => {
                let uvs = source.corners.uvs.as_ref().ok_or(MeshSourceError::NoUvs)?;
                uvs.iter().map(|corners| corners.map(|[u, v]| [scale * u, scale * v, 0.0])).collect()
            }
        };
        let mesh = mesh.with_patterns(patterns).map_err(MeshSourceError::Rest)?;
        let warps = source.corners.uvs.as_ref().map(|uvs| mesh.warps_of(uvs));
        self.scaled_by_groups(mesh.with_warps(warps), source)
    }

    /// Reads the rest shape of each triangle from a file.
    fn patterns_from(&self, path: &Path, source: &Source) -> Result<Vec<[Vector3<f64>; 3]>, MeshSourceError> {
        let groups = if let Mesh::Obj { groups, .. } = &self.mesh { groups.as_deref() } else { None };
        let mut options = ObjOptions::default();
        options.groups = groups;
        let rest = read_obj_surface(path, options)?.mesh;
        let (expected, found) = (source.unwelded, rest.triangles().len());
        if expected != found {
            return Err(MeshSourceError::OtherFaces { path: path.to_owned(), expected, found });
        }
        let rest = rest.scaled(self.placement.scale)?;
        Ok(source.kept.iter().map(|&triangle| rest.corners(triangle)).collect())
    }

    /// Shrinks or stretches the rest shape by groups. A triangle of several entries takes the product of their factors.
    fn scaled_by_groups(&self, mesh: TriangleMesh, source: &Source) -> Result<TriangleMesh, MeshSourceError> {
        if self.rest_scale.is_empty() {
            return Ok(mesh);
        }
        let mut factors = vec![[1.0; 2]; mesh.triangles().len()];
        for (entry, RestScale { group, warp, weft }) in self.rest_scale.iter().enumerate() {
            let scale = |factor: &mut [f64; 2]| *factor = [factor[0] * warp, factor[1] * weft];
            let Some(name) = group else {
                factors.iter_mut().for_each(scale);
                continue;
            };
            let triangles = source.group_triangles.get(name).ok_or_else(|| MeshSourceError::NoSuchGroup {
                entry,
                name: name.clone(),
                known: source.group_triangles.keys().cloned().collect(),
            })?;
            triangles.iter().for_each(|&triangle| scale(&mut factors[triangle]));
        }
        Ok(mesh.with_scaled_patterns(&factors, self.fabric.warp)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Scene;
    use cloth_physics::mesh::lumped_masses;

    /// A square of two triangles with a doubled diagonal, drawn 1 m wide; its texture is half as wide as high.
    const SQUARE: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 0 0\nv 1 1 0\nv 0 1 0\n\
                          vt 0 0\nvt 0.5 0\nvt 0.5 1\nvt 0 1\ng low\nf 1/1 2/2 3/3\ng high\nf 4/1 5/3 6/4\n";
    /// The same faces as patterns that lie apart, twice as large.
    const PATTERNS: &str = "v 0 0 0\nv 2 0 0\nv 2 2 0\nv 5 0 0\nv 7 2 0\nv 5 2 0\ng low\nf 1 2 3\ng high\nf 4 5 6\n";

    fn shape(keys: &str) -> Result<Shape, String> {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("square.obj"), SQUARE).unwrap();
        std::fs::write(folder.path().join("patterns.obj"), PATTERNS).unwrap();
        std::fs::write(folder.path().join("one.obj"), "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
        let text = format!(
            "dt = 0.01\nduration = 0.1\n[[garment]]\nmesh.obj = {{ path = \"square.obj\", weld = 1e-6 }}\n\
             fabric.density = 1.0\nfabric.material.stvk = {{ stretch_stiffness = 1.0, poisson_ratio = 0.0 }}\n{keys}\n"
        );
        let scene = Scene::parse(&text, &folder.path().join("s.toml")).unwrap_or_else(|error| panic!("{error}"));
        scene.garments[0].shape(folder.path()).map_err(|error| error.to_string())
    }

    fn area(keys: &str) -> f64 {
        lumped_masses(&shape(keys).unwrap().mesh, 1.0).iter().sum()
    }

    #[test]
    fn rest_shapes_come_from_patterns_or_texture_coordinates_and_scale_by_group() {
        for (keys, expected) in [
            ("", 1.0),
            ("rest.obj.path = \"patterns.obj\"", 4.0),
            ("rest.uv.scale = 2.0", 2.0),
            ("rest_scale = [{ warp = 0.5, weft = 0.5 }]", 0.25),
            ("rest_scale = [{ group = \"low\", warp = 0.5 }]", 0.75),
            ("rest.obj.path = \"patterns.obj\"\nrest_scale = [{ group = \"low\", weft = 0.5 }]", 3.0),
            // The file's unit scales its rest shape, not that in metres.
            ("rest.obj.path = \"patterns.obj\"\nplacement.scale = 0.5", 1.0),
            ("rest.uv.scale = 2.0\nplacement.scale = 0.5", 2.0),
        ] {
            assert!((area(keys) - expected).abs() < 1e-12, "{keys}: {}", area(keys));
        }
        let sewn = shape("rest.obj.path = \"patterns.obj\"").unwrap();
        assert_eq!((sewn.welded, sewn.start.len(), sewn.start[2]), (Some(2), 4, [1.0, 1.0, 0.0]));
    }

    #[test]
    fn rest_shapes_that_do_not_fit_are_refused_with_a_remedy() {
        let message = |keys: &str| shape(keys).unwrap_err();
        let other = message("rest.obj.path = \"one.obj\"");
        assert!(other.contains("has 1 triangles, the mesh has 2; export both from one model"), "{other}");
        let group = message("rest_scale = [{ group = \"cuff\" }]");
        assert_eq!(group, "rest_scale[0]: there is no group `cuff`; there are high, low");
        let across = message("warp = [0.0, 0.0, 1.0]\nrest_scale = [{ warp = 0.5 }]");
        assert!(across.starts_with("rest_scale: triangle 0 has no warp direction"), "{across}");
    }
}
