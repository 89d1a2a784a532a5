//! Fabrics whose elements a file declares, read at run time.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use energy_compiler::{Interpreted, canonical_name};
use energy_dsl::{Declaration, Kind, Vector3};
use schemars::JsonSchema;
use serde::Deserialize;

use super::Bending;
use super::interpreted_term::InterpretedTerm;
use crate::geometry::{norm, subtract};
use crate::mesh::{MaterialTriangle, Topology, TriangleMesh, lumped_masses, rest_angle};

/// Elements declared in a `.energy` file of the user's own. Each energy in it acts on every vertex, edge, triangle or hinge, as it has one, two, three
/// or four points; of a hinge the first two are the apexes and the others the shared edge. They are interpreted, which is slower than
/// generated code by a factor of some ten to a hundred.
///
/// The rest shape is the place of each point at rest (`Vec3`), or of a triangle's corners in its plane, the first axis along the warp
/// (`Vec2`). Parameters are those given, and where the declaration has them and they are not given: `L`, the length of an edge at rest; `A`, the area of a
/// triangle at rest; `θ0`, the angle of a hinge at rest; `m`, the mass of a vertex.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Declared {
    /// The file, from the scene file's folder.
    pub path: PathBuf,
    /// The declarations that are used. Default all of the file.
    #[serde(default)]
    pub elements: Option<Vec<String>>,
    /// Parameters by name, in the units of the declaration. `θ0`, `θ₀` and `theta0` are the same.
    #[serde(default)]
    pub parameters: BTreeMap<String, f64>,
    /// What resists bending besides. Default nothing.
    #[serde(default)]
    pub bending: Bending,
}

/// A file that makes no fabric.
#[derive(Debug, thiserror::Error)]
pub enum DeclaredError {
    /// The file cannot be read.
    #[error("cannot read {}", .path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// It cannot be compiled.
    #[error("{diagnostics}")]
    Text {
        /// What is wrong, where.
        diagnostics: String,
    },
    /// It declares nothing of use.
    #[error("{} declares no element called `{name}`; it declares {}", .path.display(), .known.join(", "))]
    NoSuchElement {
        /// The file.
        path: PathBuf,
        /// The name.
        name: String,
        /// What it declares.
        known: Vec<String>,
    },
    /// It declares nothing.
    #[error("{} declares nothing", .path.display())]
    Empty {
        /// The file.
        path: PathBuf,
    },
    /// Not an energy of one to four points.
    #[error("{}: {element} is {what}; a material is made of energies of one to four points", .path.display())]
    Unfit {
        /// The file.
        path: PathBuf,
        /// The element.
        element: String,
        /// What it is.
        what: String,
    },
    /// A parameter that is neither given nor known.
    #[error("{}: {element} needs the parameter `{parameter}`{unit}; give it as `parameters.{parameter}`", .path.display())]
    Missing {
        /// The file.
        path: PathBuf,
        /// The element.
        element: String,
        /// The parameter.
        parameter: String,
        /// Its unit, in brackets.
        unit: String,
    },
    /// A parameter that no element has.
    #[error("{}: no element has a parameter `{parameter}`", .path.display())]
    Unused {
        /// The file.
        path: PathBuf,
        /// The parameter.
        parameter: String,
    },
    /// A rest shape that is refused.
    #[error("{}: on vertices {vertices:?}: {source}", .path.display())]
    Rest {
        /// The file.
        path: PathBuf,
        /// The vertices.
        vertices: Vec<usize>,
        /// What is wrong.
        source: energy_dsl::RestError,
    },
}

/// A mesh on which declared elements are laid.
pub(super) struct Ground<'a> {
    pub mesh: &'a TriangleMesh,
    pub triangles: &'a [MaterialTriangle],
    pub density: f64,
    /// The number of its first vertex.
    pub first: usize,
    pub prefix: &'a str,
}

impl Declared {
    /// The terms of the declared elements.
    pub(super) fn terms(&self, ground: &Ground<'_>) -> Result<Vec<InterpretedTerm>, DeclaredError> {
        let elements = self.read()?;
        let known: BTreeSet<String> = elements
            .iter()
            .flat_map(|element| element.declaration().parameters)
            .map(|parameter| canonical_name(parameter.name))
            .collect();
        if let Some(unused) = self.parameters.keys().find(|name| !known.contains(&canonical_name(name))) {
            return Err(DeclaredError::Unused { path: self.path.clone(), parameter: unused.clone() });
        }
        elements.into_iter().map(|element| self.term(element, ground)).collect()
    }

    fn read(&self) -> Result<Vec<Interpreted>, DeclaredError> {
        let path = || self.path.clone();
        let text =
            std::fs::read_to_string(&self.path).map_err(|source| DeclaredError::Unreadable { path: path(), source })?;
        let all = Interpreted::from_file(&text, &self.path.display().to_string())
            .map_err(|errors| DeclaredError::Text { diagnostics: errors.to_string() })?;
        let known: Vec<String> = all.iter().map(|element| element.declaration().name.to_owned()).collect();
        if known.is_empty() {
            return Err(DeclaredError::Empty { path: path() });
        }
        let Some(wanted) = &self.elements else { return Ok(all) };
        let find = |name: &String| {
            let found = all.iter().find(|element| element.declaration().name == name).cloned();
            found.ok_or_else(|| DeclaredError::NoSuchElement { path: path(), name: name.clone(), known: known.clone() })
        };
        wanted.iter().map(find).collect()
    }

    fn term(&self, element: Interpreted, ground: &Ground<'_>) -> Result<InterpretedTerm, DeclaredError> {
        let declaration = element.declaration();
        let unfit =
            |what: String| DeclaredError::Unfit { path: self.path.clone(), element: declaration.name.to_owned(), what };
        if declaration.kind != Kind::Energy {
            return Err(unfit(format!("a {}", declaration.kind.keyword())));
        }
        let places = places(declaration.points.len(), ground)
            .ok_or_else(|| unfit(format!("an energy of {} points", declaration.points.len())))?;
        let inputs = places.iter().map(|place| self.inputs(declaration, place, ground, &unfit));
        let inputs = inputs.collect::<Result<Vec<_>, _>>()?;
        let stencils = places.iter().flat_map(|place| place.vertices.iter().map(|vertex| ground.first + vertex));
        let name = format!("{}{}", ground.prefix, declaration.name);
        InterpretedTerm::new(name, element, stencils.collect(), inputs).map_err(|(number, source)| {
            DeclaredError::Rest { path: self.path.clone(), vertices: places[number].vertices.clone(), source }
        })
    }

    /// The parameters and the rest shape of an element, flattened.
    fn inputs(
        &self,
        declaration: &Declaration,
        place: &Place,
        ground: &Ground<'_>,
        unfit: &impl Fn(String) -> DeclaredError,
    ) -> Result<(Vec<f64>, Vec<f64>), DeclaredError> {
        let given: BTreeMap<String, f64> =
            self.parameters.iter().map(|(name, value)| (canonical_name(name), *value)).collect();
        let parameter = |field: &energy_dsl::Field| {
            let name = canonical_name(field.name);
            let value = given.get(&name).copied().or_else(|| place.known(&name)).filter(|_| field.size == 1);
            value.ok_or_else(|| DeclaredError::Missing {
                path: self.path.clone(),
                element: declaration.name.to_owned(),
                parameter: field.name.to_owned(),
                unit: if field.unit.is_empty() { String::new() } else { format!(" [{}]", field.unit) },
            })
        };
        let parameters = declaration.parameters.iter().map(parameter).collect::<Result<Vec<f64>, _>>()?;
        let at_rest: Vec<Vector3<f64>> = place.vertices.iter().map(|&vertex| ground.mesh.vertices()[vertex]).collect();
        let sizes: Vec<usize> = declaration.rest.iter().map(|field| field.size).collect();
        let rest = match (&place.laid, &sizes[..]) {
            (_, []) => Vec::new(),
            (Some(laid), [2, 2, 2]) => laid.as_flattened().to_vec(),
            (_, sizes) if sizes.len() == at_rest.len() && sizes.iter().all(|&size| size == 3) => at_rest.concat(),
            _ => return Err(unfit("of another rest shape than one point for each of its points".to_owned())),
        };
        Ok((parameters, rest))
    }
}

/// Where an element acts.
struct Place {
    vertices: Vec<usize>,
    /// Of a triangle, its corners in its plane.
    laid: Option<MaterialTriangle>,
    /// The parameter that it knows by itself.
    own: (&'static str, f64),
}

impl Place {
    fn known(&self, name: &str) -> Option<f64> {
        (self.own.0 == name).then_some(self.own.1)
    }
}

/// All vertices, edges, triangles or hinges.
fn places(points: usize, ground: &Ground<'_>) -> Option<Vec<Place>> {
    let mesh = ground.mesh;
    let place = |vertices: &[usize], own| Place { vertices: vertices.to_vec(), laid: None, own };
    Some(match points {
        1 => {
            let masses = lumped_masses(mesh, ground.density);
            masses.iter().enumerate().map(|(vertex, &mass)| place(&[vertex], ("m", mass))).collect()
        }
        2 => {
            let length = |[p, q]: [usize; 2]| norm(subtract(mesh.vertices()[p], mesh.vertices()[q]));
            Topology::of(mesh).edges.iter().map(|edge| place(edge, ("L", length(*edge)))).collect()
        }
        3 => {
            let triangles = mesh.triangles().iter().zip(ground.triangles);
            let triangle = |(corners, laid): (&[usize; 3], &MaterialTriangle)| Place {
                laid: Some(*laid),
                ..place(corners, ("A", super::terms::area(*laid)))
            };
            triangles.map(triangle).collect()
        }
        4 => {
            let hinges = Topology::of(mesh).hinges;
            hinges.iter().map(|hinge| place(&hinge.vertices, ("theta0", rest_angle(mesh, hinge)))).collect()
        }
        _ => return None,
    })
}

impl Declared {
    /// The same with its file sought from a folder.
    pub(crate) fn seek_in(&mut self, folder: &Path) {
        self.path = folder.join(&self.path);
    }
}
