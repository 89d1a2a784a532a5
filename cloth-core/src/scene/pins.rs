use energy_dsl::Vector3;
use schemars::JsonSchema;
use serde::Deserialize;

use crate::bounded::finite_triple;
use crate::motion::Motion;

/// Vertices that do not move, or move as they are told.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(try_from = "Keys")]
#[schemars(with = "Keys")]
pub struct Pin {
    /// Which vertices, chosen at the start.
    pub choice: PinChoice,
    /// The garment or hair that they are chosen from; `None` for all.
    pub of: Option<String>,
    /// How they move.
    pub motion: Option<Motion>,
}

/// Which vertices are pinned.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PinChoice {
    /// The vertex of this number, from 0.
    Vertex(usize),
    /// Every vertex in an axis-aligned box.
    Box(PinBox),
    /// The vertex nearest to a point, in m.
    Nearest(Vector3<f64>),
    /// Every vertex on the edge of the cloth.
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

/// What a scene file says: exactly one of `vertex`, `box`, `nearest`, `boundary` and `all`.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
struct Keys {
    /// The vertex of this number, from 0, within `of`.
    vertex: Option<usize>,
    /// Every vertex in an axis-aligned box.
    #[serde(rename = "box")]
    inside: Option<PinBox>,
    /// The vertex nearest to a point, in m.
    nearest: Option<Point>,
    /// `true`: every vertex on the edge of the cloth.
    #[serde(default)]
    boundary: bool,
    /// `true`: every vertex.
    #[serde(default)]
    all: bool,
    /// The name of the garment or hair that the vertices are chosen from. Default all.
    of: Option<String>,
    /// How they move. Default not at all.
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
            _ => Err("a pin is exactly one of `vertex`, `box`, `nearest`, `boundary` and `all`".to_owned()),
        }
    }
}

impl Pin {
    /// A pin that does not move, on vertices of all parts.
    #[must_use]
    pub fn fixed(choice: PinChoice) -> Self {
        Self { choice, of: None, motion: None }
    }
}
