//! Fabrics made of elements that a file declares, read at run time.

#[cfg(feature = "formulas")]
mod terms;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::Deserialize;

use super::Bending;
use crate::bounded::{RealMap, Signed};
use crate::mesh::{MaterialTriangle, TriangleMesh};

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
///
/// Elements may have memory: states with values at rest, which `next` advances after each step. The parameter that
/// `#[time_step(h)]` names is the size of the step, in s.
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
    /// A state does not say where it begins.
    #[error(
        "{}: the state `{state}` of {element} has no value at rest; a material needs one, as in `state {state}: Scalar = 0`",
        .path.display()
    )]
    NoStateAtRest { path: PathBuf, element: String, state: String },
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
    /// The feature `formulas` is off.
    #[error("{}: this program was built without the compiler of formulas, the feature `formulas` of cloth-physics",
        .path.display())]
    NoCompiler { path: PathBuf },
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
#[cfg_attr(not(feature = "formulas"), expect(dead_code, reason = "only formulas read it"))]
pub(super) struct TargetMesh<'a> {
    pub mesh: &'a TriangleMesh,
    pub triangles: &'a [MaterialTriangle],
    pub density: f64,
    /// Offset of its vertices in the system.
    pub first: usize,
    pub prefix: &'a str,
}

#[cfg(not(feature = "formulas"))]
impl Declared {
    pub(super) fn terms(&self, _: &TargetMesh<'_>) -> Result<Vec<energy_solve::TapeTerm>, DeclaredError> {
        Err(DeclaredError::NoCompiler { path: self.path.clone() })
    }
}

impl Declared {
    /// Resolves the path of the file relative to a folder.
    pub fn resolve_path(&mut self, folder: &Path) {
        self.path = folder.join(&self.path);
    }
}
