//! Fabrics made of elements that a file declares, read at run time.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use energy_compiler::{BindError, Interpreted, canonical_name};
use energy_dsl::tape::Column;
use energy_dsl::{Declaration, Field, Kind, Vector3};
use energy_solve::TapeTerm;
use schemars::JsonSchema;
use serde::Deserialize;

use super::Bending;
use crate::bounded::{RealMap, Signed};
use crate::geometry::{norm, subtract};
use crate::mesh::{MaterialTriangle, Topology, TriangleMesh, lumped_masses, rest_angle};

/// The largest size of an `.energy` file, in bytes.
const LARGEST_FILE: u64 = 16 << 20;

/// Elements declared in your own `.energy` file. Each energy acts on every vertex, edge, triangle or hinge, depending
/// on whether it has one, two, three or four points. The points of a hinge are its two apexes, then the shared edge.
/// The elements are interpreted, a block of them at a time, with the bits of generated code.
///
/// A rest shape consists of the rest position of each point (`Vec3`), or, for a triangle, of the corners in its plane
/// with the first axis along the warp (`Vec2`).
///
/// Parameters come from `parameters`. A parameter that is not given there has a default if its name is one of these:
/// `L`, the rest length of an edge; `A`, the rest area of a triangle; `θ0`, the rest angle of a hinge; `m`, the mass of
/// a vertex.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Declared {
    /// Path, relative to the scene file's folder.
    pub path: PathBuf,
    /// Names of the declarations to use. Default all in the file.
    #[serde(default)]
    pub elements: Option<Vec<String>>,
    /// Parameters by name, in the units of the declaration. `θ0`, `θ₀` and `theta0` are equivalent.
    #[serde(default, with = "RealMap::<Signed>")]
    pub parameters: BTreeMap<String, f64>,
    /// Additional bending resistance. Default none.
    #[serde(default)]
    pub bending: Bending,
}

/// A file that cannot serve as a fabric.
#[derive(Debug, thiserror::Error)]
#[expect(missing_docs, reason = "the messages name the fields")]
#[non_exhaustive]
pub enum DeclaredError {
    /// The file cannot be read.
    #[error("cannot read {}", .path.display())]
    Unreadable { path: PathBuf, source: std::io::Error },
    /// The file does not compile.
    #[error("{diagnostics}")]
    Text {
        /// The compiler's errors, with their places.
        diagnostics: String,
    },
    /// The file declares no element of this name.
    #[error("{} declares no element called `{name}`; it declares {}", .path.display(), .known.join(", "))]
    NoSuchElement {
        path: PathBuf,
        name: String,
        /// The names that it declares.
        known: Vec<String>,
    },
    /// The file declares no element.
    #[error("{} declares nothing", .path.display())]
    Empty { path: PathBuf },
    /// An element is not an energy of one to four points.
    #[error("{}: {element} is {what}; a material consists of energies of one to four points", .path.display())]
    Unfit {
        path: PathBuf,
        element: String,
        /// A description of the element.
        what: String,
    },
    /// A parameter is not given and has no default.
    #[error(
        "{}: {element} needs the parameter `{parameter}`{unit}; give it as `parameters.{parameter}`",
        .path.display()
    )]
    Missing {
        path: PathBuf,
        element: String,
        parameter: String,
        /// Its unit, in brackets.
        unit: String,
    },
    /// No element has a parameter of this name.
    #[error("{}: no element has a parameter `{parameter}`; expected {}", .path.display(), one_of(.known))]
    Unused {
        path: PathBuf,
        parameter: String,
        /// The parameters of all elements.
        known: Vec<String>,
    },
    /// An element rejects a rest shape.
    #[error("{}: on vertices {vertices:?}: {source}", .path.display())]
    Rest { path: PathBuf, vertices: Vec<usize>, source: energy_dsl::RestError },
}

/// Returns a list of names for a message.
fn one_of(names: &[String]) -> String {
    match names {
        [] => "none".into(),
        names => format!("`{}`", names.join("`, `")),
    }
}

/// The mesh that the elements act on.
pub(super) struct TargetMesh<'a> {
    pub mesh: &'a TriangleMesh,
    pub triangles: &'a [MaterialTriangle],
    pub density: f64,
    /// Offset of its vertices in the system.
    pub first: usize,
    pub prefix: &'a str,
}

impl Declared {
    /// Returns a term for each element used.
    pub(super) fn terms(&self, target: &TargetMesh<'_>) -> Result<Vec<TapeTerm>, DeclaredError> {
        let elements = self.read()?;
        let known: BTreeSet<String> = elements
            .iter()
            .flat_map(|element| &*element.declaration().parameters)
            .map(|parameter| canonical_name(&parameter.name))
            .collect();
        if let Some(unused) = self.parameters.keys().find(|name| !known.contains(&canonical_name(name))) {
            let known = known.into_iter().collect();
            return Err(DeclaredError::Unused { path: self.path.clone(), parameter: unused.clone(), known });
        }
        elements.into_iter().map(|element| self.term(element, target)).collect()
    }

    fn read(&self) -> Result<Vec<Interpreted>, DeclaredError> {
        let path = || self.path.clone();
        let text = energy_files::read_text(&self.path, LARGEST_FILE)
            .map_err(|source| DeclaredError::Unreadable { path: path(), source })?;
        let all = Interpreted::from_file(&text, &self.path.display().to_string())
            .map_err(|errors| DeclaredError::Text { diagnostics: errors.to_string() })?;
        let known: Vec<String> = all.iter().map(|element| element.declaration().name.to_string()).collect();
        if known.is_empty() {
            return Err(DeclaredError::Empty { path: path() });
        }
        let Some(wanted) = &self.elements else { return Ok(all) };
        let find = |name: &String| {
            let found = all.iter().find(|element| element.declaration().name == **name).cloned();
            found.ok_or_else(|| DeclaredError::NoSuchElement { path: path(), name: name.clone(), known: known.clone() })
        };
        wanted.iter().map(find).collect()
    }

    fn term(&self, element: Interpreted, target: &TargetMesh<'_>) -> Result<TapeTerm, DeclaredError> {
        let declaration = element.declaration();
        let unfit = |what: String| DeclaredError::Unfit {
            path: self.path.clone(),
            element: declaration.name.to_string(),
            what,
        };
        if declaration.kind != Kind::Energy {
            return Err(unfit(format!("a {}", declaration.kind.keyword())));
        }
        let sites = sites(declaration.points.len(), target)
            .ok_or_else(|| unfit(format!("an energy of {} points", declaration.points.len())))?;
        let has_points_at_rest = declaration.rest.iter().any(|field| field.size == 3);
        if target.mesh.has_patterns() && (has_points_at_rest || declaration.points.len() == 2) {
            let lacking = "which a garment with `rest` or `rest_scale` does not have";
            return Err(unfit(format!("an energy that depends on vertices at rest, {lacking}")));
        }
        let inputs = sites.iter().map(|site| self.inputs(declaration, site, target, &unfit));
        let inputs: Vec<(Vec<f64>, Vec<f64>)> = inputs.collect::<Result<_, _>>()?;
        let parameters = columns(&declaration.parameters, inputs.iter().map(|(parameters, _)| &parameters[..]));
        let rest = columns(&declaration.rest, inputs.iter().map(|(_, rest)| &rest[..]));
        let [rest, parameters] =
            [&rest, &parameters].map(|all| all.iter().map(|c| Column::Each(c)).collect::<Vec<_>>());
        let elements = element.elements(sites.len(), &rest, &parameters).map_err(|error| match error {
            BindError::Rest { index, error: source } => {
                DeclaredError::Rest { path: self.path.clone(), vertices: sites[index].vertices.clone(), source }
            }
            other => unfit(format!("an energy with other inputs than its declaration has ({other})")),
        })?;
        let stencils = sites.iter().flat_map(|site| site.vertices.iter().map(|vertex| target.first + vertex));
        let name = format!("{}{}", target.prefix, declaration.name);
        Ok(TapeTerm::new(name, declaration, elements.tape().clone(), stencils))
    }

    /// Returns the parameters and the rest shape of an element, flattened.
    fn inputs(
        &self,
        declaration: &Declaration,
        site: &Site,
        target: &TargetMesh<'_>,
        unfit: &impl Fn(String) -> DeclaredError,
    ) -> Result<(Vec<f64>, Vec<f64>), DeclaredError> {
        let given: BTreeMap<String, f64> =
            self.parameters.iter().map(|(name, value)| (canonical_name(name), *value)).collect();
        let parameter = |field: &Field| {
            let name = canonical_name(&field.name);
            let value = given.get(&name).copied().or_else(|| site.default_of(&name)).filter(|_| field.size == 1);
            value.ok_or_else(|| DeclaredError::Missing {
                path: self.path.clone(),
                element: declaration.name.to_string(),
                parameter: field.name.to_string(),
                unit: if field.unit.is_empty() { String::new() } else { format!(" [{}]", field.unit) },
            })
        };
        let parameters = declaration.parameters.iter().map(parameter).collect::<Result<Vec<f64>, _>>()?;
        let at_rest: Vec<Vector3<f64>> = site.vertices.iter().map(|&vertex| target.mesh.vertices()[vertex]).collect();
        let sizes: Vec<usize> = declaration.rest.iter().map(|field| field.size).collect();
        let rest = match (&site.corners_in_plane, &sizes[..]) {
            (_, []) => Vec::new(),
            (Some(corners_in_plane), [2, 2, 2]) => corners_in_plane.as_flattened().to_vec(),
            (_, sizes) if sizes.len() == at_rest.len() && sizes.iter().all(|&size| size == 3) => at_rest.concat(),
            _ => return Err(unfit("an energy whose rest shape is not one point for each of its points".to_owned())),
        };
        Ok((parameters, rest))
    }
}

/// Returns the numbers of each field for all elements, one element after the other.
fn columns<'a>(fields: &[Field], elements: impl Iterator<Item = &'a [f64]> + Clone) -> Vec<Vec<f64>> {
    let mut first = 0;
    let column = |field: &Field| {
        first += field.size;
        elements.clone().flat_map(|numbers| numbers[first - field.size..first].to_vec()).collect()
    };
    fields.iter().map(column).collect()
}

/// The vertices that one element acts on.
struct Site {
    vertices: Vec<usize>,
    /// For a triangle, its corners in its plane.
    corners_in_plane: Option<MaterialTriangle>,
    /// The name and value of the parameter with a default.
    default: (&'static str, f64),
}

impl Site {
    fn default_of(&self, name: &str) -> Option<f64> {
        (self.default.0 == name).then_some(self.default.1)
    }
}

/// Returns all vertices, edges, triangles or hinges, by the number of points; `None` for other numbers.
fn sites(points: usize, target: &TargetMesh<'_>) -> Option<Vec<Site>> {
    let mesh = target.mesh;
    let site = |vertices: &[usize], default| Site { vertices: vertices.to_vec(), corners_in_plane: None, default };
    Some(match points {
        1 => {
            let masses = lumped_masses(mesh, target.density);
            masses.iter().enumerate().map(|(vertex, &mass)| site(&[vertex], ("m", mass))).collect()
        }
        2 => {
            let length = |[p, q]: [usize; 2]| norm(subtract(mesh.vertices()[p], mesh.vertices()[q]));
            Topology::of(mesh).edges.iter().map(|edge| site(edge, ("L", length(*edge)))).collect()
        }
        3 => {
            let triangles = mesh.triangles().iter().zip(target.triangles);
            let triangle = |(corners, corners_in_plane): (&[usize; 3], &MaterialTriangle)| Site {
                corners_in_plane: Some(*corners_in_plane),
                ..site(corners, ("A", super::terms::area(*corners_in_plane)))
            };
            triangles.map(triangle).collect()
        }
        4 => {
            let hinges = Topology::of(mesh).hinges;
            hinges.iter().map(|hinge| site(&hinge.vertices, ("theta0", rest_angle(mesh, hinge)))).collect()
        }
        _ => return None,
    })
}

impl Declared {
    /// Resolves the path of the file relative to a folder.
    pub fn resolve_path(&mut self, folder: &Path) {
        self.path = folder.join(&self.path);
    }
}
