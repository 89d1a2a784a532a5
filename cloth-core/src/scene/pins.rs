use energy_dsl::Vector3;
use schemars::JsonSchema;
use serde::Deserialize;

use crate::bounded::{MaybeCount, MaybeReals, Number, Reals};
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
#[derive(Clone, Debug, PartialEq)]
pub enum PinChoice {
    /// The vertex with this index, from 0.
    Vertex(usize),
    /// Every vertex in an axis-aligned box.
    Box(PinBox),
    /// The vertex nearest to a point, in m.
    Nearest(Vector3<f64>),
    /// Every vertex of a group, object or material of the OBJ files.
    Group(String),
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
    #[serde(with = "Reals::<Number, 3>")]
    pub min: Vector3<f64>,
    /// The corner with the largest coordinates, in m.
    #[serde(with = "Reals::<Number, 3>")]
    pub max: Vector3<f64>,
}

/// The keys of a pin: exactly one of `vertex`, `box`, `nearest`, `group`, `boundary` and `all`.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("oneOf" = [
    { "required": ["vertex"] },
    { "required": ["box"] },
    { "required": ["nearest"] },
    { "required": ["group"] },
    { "required": ["boundary"], "properties": { "boundary": { "const": true } } },
    { "required": ["all"], "properties": { "all": { "const": true } } },
]))]
struct Keys {
    /// The vertex with this index, from 0, within `of`.
    #[serde(default, with = "MaybeCount::<0, 4_294_967_295>")]
    vertex: Option<usize>,
    /// Every vertex in an axis-aligned box.
    #[serde(rename = "box")]
    inside: Option<PinBox>,
    /// The vertex nearest to a point, in m.
    #[serde(default, with = "MaybeReals::<Number, 3>")]
    nearest: Option<Vector3<f64>>,
    /// Every vertex of this group, object or material of an OBJ file.
    group: Option<String>,
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

impl TryFrom<Keys> for Pin {
    type Error = String;

    fn try_from(keys: Keys) -> Result<Self, String> {
        let Keys { vertex, inside, nearest, group, boundary, all, of, motion } = keys;
        if let Some(PinBox { min, max }) = inside
            && let Some(axis) = (0..3).find(|&axis| min[axis] > max[axis])
        {
            let (low, high, name) = (min[axis], max[axis], ["x", "y", "z"][axis]);
            return Err(format!(
                "the box is empty: its `min` exceeds its `max` along {name}, {low} > {high}; exchange the two"
            ));
        }
        let choices = [
            vertex.map(PinChoice::Vertex),
            inside.map(PinChoice::Box),
            nearest.map(PinChoice::Nearest),
            group.map(PinChoice::Group),
            boundary.then_some(PinChoice::Boundary),
            all.then_some(PinChoice::All),
        ];
        let mut given = choices.into_iter().flatten();
        match (given.next(), given.next()) {
            (Some(choice), None) => Ok(Self { choice, of, motion }),
            _ => Err("expected exactly one of `vertex`, `box`, `nearest`, `group`, `boundary` and `all`".to_owned()),
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
