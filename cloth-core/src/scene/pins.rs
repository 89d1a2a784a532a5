use energy_dsl::Vector3;
use schemars::JsonSchema;
use serde::Deserialize;

use crate::bounded::finite_triple;
use crate::motion::Motion;

/// Pinned vertices, fixed or moving.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(try_from = "Keys")]
#[schemars(with = "Keys")]
pub struct Pin {
    /// The pinned vertices, chosen at the start.
    pub choice: PinChoice,
    /// The garment or hair to choose from; `None` for the whole scene.
    pub of: Option<String>,
    /// The motion; `None` if the vertices are fixed.
    pub motion: Option<Motion>,
}

/// A choice of vertices.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PinChoice {
    /// The vertex with this index, from 0.
    Vertex(usize),
    /// Every vertex in an axis-aligned box.
    Box(PinBox),
    /// The vertex nearest to a point, in m.
    Nearest(Vector3<f64>),
    /// Every boundary vertex of the cloth.
    Boundary,
    /// Every vertex.
    All,
}

/// An axis-aligned box.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PinBox {
    /// The corner with the smallest coordinates, in m.
    #[serde(deserialize_with = "finite_triple")]
    pub min: Vector3<f64>,
    /// The corner with the largest coordinates, in m.
    #[serde(deserialize_with = "finite_triple")]
    pub max: Vector3<f64>,
}

/// The keys of a pin: exactly one of `vertex`, `box`, `nearest`, `boundary` and `all`.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Keys {
    /// The vertex with this index, from 0, within `of`.
    vertex: Option<usize>,
    /// Every vertex in an axis-aligned box.
    #[serde(rename = "box")]
    inside: Option<PinBox>,
    /// The vertex nearest to a point, in m.
    nearest: Option<Point>,
    /// `true`: every boundary vertex of the cloth.
    #[serde(default)]
    boundary: bool,
    /// `true`: every vertex.
    #[serde(default)]
    all: bool,
    /// Name of the garment or hair to choose from. Default all.
    of: Option<String>,
    /// Motion over time. Default none.
    motion: Option<Motion>,
}

/// A point, in m.
#[derive(Deserialize, JsonSchema)]
#[serde(transparent)]
struct Point(#[serde(deserialize_with = "finite_triple")] Vector3<f64>);

impl TryFrom<Keys> for Pin {
    type Error = String;

    fn try_from(keys: Keys) -> Result<Self, String> {
        let Keys { vertex, inside, nearest, boundary, all, of, motion } = keys;
        let choices = [
            vertex.map(PinChoice::Vertex),
            inside.map(PinChoice::Box),
            nearest.map(|Point(point)| PinChoice::Nearest(point)),
            boundary.then_some(PinChoice::Boundary),
            all.then_some(PinChoice::All),
        ];
        let given: Vec<PinChoice> = choices.into_iter().flatten().collect();
        match given[..] {
            [choice] => Ok(Self { choice, of, motion }),
            _ => Err("expected exactly one of `vertex`, `box`, `nearest`, `boundary` and `all`".to_owned()),
        }
    }
}

impl Pin {
    /// Creates a fixed pin that chooses from the whole scene.
    #[must_use]
    pub fn fixed(choice: PinChoice) -> Self {
        Self { choice, of: None, motion: None }
    }
}
