//! Compiles a file's declarations, and binds their elements to the parts of a mesh.

use std::collections::{BTreeMap, BTreeSet};

use energy_compiler::{BindError, Interpreted, canonical_name};
use energy_dsl::tape::Column;
use energy_dsl::{Declaration, Field, FieldKind, Kind, Vector3};
use energy_solve::TapeTerm;

use super::{Declared, DeclaredError, TargetMesh};
use crate::geometry::{norm, subtract};
use crate::mesh::{MaterialTriangle, Topology, lumped_masses, rest_angle};

/// The largest size of an `.energy` file, in bytes.
const LARGEST_FILE: u64 = 16 << 20;

impl Declared {
    /// Returns a term for each element used.
    pub(in super::super) fn terms(&self, target: &TargetMesh<'_>) -> Result<Vec<TapeTerm>, DeclaredError> {
        let elements = self.read()?;
        let known: BTreeSet<String> = elements
            .iter()
            .flat_map(|element| &*element.declaration().parameters)
            .filter(|parameter| parameter.kind != FieldKind::TimeStep)
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
        if declaration.is_mixed() {
            return Err(unfit("an energy with unknowns that are not points of each element".to_owned()));
        }
        let sites = sites(declaration.points.len(), target)
            .ok_or_else(|| unfit(format!("an energy of {} points", declaration.points.len())))?;
        let has_points_at_rest = declaration.rest.iter().any(|field| field.entry_size() == 3);
        if target.mesh.has_patterns() && (has_points_at_rest || declaration.points.len() == 2) {
            let lacking = "which a garment with `rest` or `rest_scale` does not have";
            return Err(unfit(format!("an energy that depends on vertices at rest, {lacking}")));
        }
        let inputs = sites.iter().map(|site| self.inputs(declaration, site, target, &unfit));
        let inputs: Vec<(Vec<f64>, Vec<f64>)> = inputs.collect::<Result<_, _>>()?;
        let parameters = columns(&declaration.parameters, inputs.iter().map(|(parameters, _)| &parameters[..]));
        let rest = columns(&declaration.rest, inputs.iter().map(|(_, rest)| &rest[..]));
        let misfit = |error: BindError| match error {
            BindError::Rest { index, error: source } => {
                DeclaredError::Rest { path: self.path.clone(), vertices: sites[index].vertices.clone(), source }
            }
            other => unfit(format!("an energy with other inputs than its declaration has ({other})")),
        };
        let states = element.states_at_rest(sites.len(), &each(&rest), &each(&parameters)).map_err(misfit)?;
        if let Some(state) = declaration.state.first().filter(|_| states.is_none()) {
            return Err(DeclaredError::NoStateAtRest {
                path: self.path.clone(),
                element: declaration.name.to_string(),
                state: state.name.to_string(),
            });
        }
        let size = declaration.state.iter().map(|field| field.size).sum::<usize>().max(1);
        let states = columns(&declaration.state, states.as_deref().unwrap_or(&[]).chunks_exact(size));
        let elements =
            element.elements(sites.len(), &each(&rest), &each(&[parameters, states].concat())).map_err(misfit)?;
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
            if field.kind == FieldKind::TimeStep {
                // The integrator sets it.
                return Ok(1.0);
            }
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
        let rest = match (&site.corners_in_plane, declaration.rest_points()) {
            (_, None) if declaration.rest.is_empty() => Vec::new(),
            (Some(corners_in_plane), Some((2, 3))) => corners_in_plane.as_flattened().to_vec(),
            (_, Some((3, count))) if count == at_rest.len() => at_rest.concat(),
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

/// Binds the numbers of each element.
fn each(columns: &[Vec<f64>]) -> Vec<Column<'_, f64>> {
    columns.iter().map(|column| Column::Each(column)).collect()
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
                ..site(corners, ("A", crate::fabric::terms::area(*corners_in_plane)))
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
