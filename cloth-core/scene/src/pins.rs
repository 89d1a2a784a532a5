use energy_dsl::Vector3;
use schemars::JsonSchema;
use serde::Deserialize;

use cloth_physics::bounded::{
    MaybeCount, MaybeReal, MaybeRealList, MaybeReals, MaybeVertices, NonNegative, Number, Positive, Reals,
};
use cloth_physics::motion::Motion;

/// Pinned vertices, fixed or moving, held exactly or by springs.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(try_from = "Keys")]
#[schemars(with = "Keys")]
pub struct Pin {
    /// The pinned vertices, chosen at the start.
    pub choice: PinChoice,
    /// The name in measurements; `None` for `pin` and the index. Pins with one name form a group.
    pub name: Option<String>,
    /// The garment or hair to choose from; `None` for the whole scene.
    pub of: Option<String>,
    /// The motion; `None` if the vertices are fixed, or follow an obstacle.
    pub motion: Option<Motion>,
    /// The name of the obstacle that the vertices follow; `None` if they follow none.
    pub obstacle: Option<String>,
    /// Springs that hold the vertices; `None` if they are held exactly.
    pub soft: Option<SoftPin>,
    /// The time at which the vertices become free, in s; `None` if they never do.
    pub release: Option<f64>,
}

/// Springs of rest length 0 that pull vertices to their places.
#[derive(Clone, Debug, PartialEq)]
pub struct SoftPin {
    /// Stiffness of each spring, in N/m.
    pub stiffness: f64,
    /// Factors of the stiffness, one per chosen vertex; empty if all are 1.
    pub weights: Vec<f64>,
}

/// A choice of vertices.
#[derive(Clone, Debug, PartialEq)]
pub enum PinChoice {
    /// The vertex with this index, from 0.
    Vertex(usize),
    /// The vertices with these indices, from 0.
    Vertices(Vec<usize>),
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

/// The keys of a pin: exactly one of `vertex`, `vertices`, `box`, `nearest`, `group`, `boundary` and `all`.
#[derive(Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("oneOf" = [
    { "required": ["vertex"] },
    { "required": ["vertices"] },
    { "required": ["box"] },
    { "required": ["nearest"] },
    { "required": ["group"] },
    { "required": ["boundary"], "properties": { "boundary": { "const": true } } },
    { "required": ["all"], "properties": { "all": { "const": true } } },
]))]
#[schemars(extend("dependentRequired" = { "weights": ["vertices", "stiffness"] }))]
#[schemars(extend("not" = { "required": ["motion", "obstacle"] }))]
struct Keys {
    /// The vertex with this index, from 0, within `of`.
    #[serde(default, with = "MaybeCount::<0, 4_294_967_295>")]
    vertex: Option<usize>,
    /// The vertices with these indices, from 0, within `of`.
    #[serde(default, with = "MaybeVertices")]
    vertices: Option<Vec<usize>>,
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
    /// Name in measurements. Pins with the same name form a group, whose forces are added. Default none.
    name: Option<String>,
    /// Name of the garment or hair to choose from. Default all.
    of: Option<String>,
    /// Motion over time. Default none.
    motion: Option<Motion>,
    /// Name of an obstacle whose motion the vertices follow, in place of `motion`. Default none.
    obstacle: Option<String>,
    /// Holds each vertex by a spring of this stiffness, in N/m, in place of exactly. Default exactly.
    #[serde(default, with = "MaybeReal::<Positive>")]
    stiffness: Option<f64>,
    /// Factors of `stiffness`, one for each of `vertices`. Default 1.
    #[serde(default, with = "MaybeRealList::<NonNegative>")]
    weights: Option<Vec<f64>>,
    /// Time at which the vertices become free, in s. Default never.
    #[serde(default, with = "MaybeReal::<NonNegative>")]
    release: Option<f64>,
}

impl TryFrom<Keys> for Pin {
    type Error = String;

    fn try_from(keys: Keys) -> Result<Self, String> {
        let soft = keys.soft()?;
        let Keys { vertex, vertices, inside, nearest, group, boundary, all, name, .. } = keys;
        let Keys { of, motion, obstacle, release, .. } = keys;
        if let Some(PinBox { min, max }) = inside
            && let Some(axis) = (0..3).find(|&axis| min[axis] > max[axis])
        {
            let (low, high, name) = (min[axis], max[axis], ["x", "y", "z"][axis]);
            return Err(format!(
                "the box is empty: its `min` exceeds its `max` along {name}, {low} > {high}; exchange the two"
            ));
        }
        if motion.is_some() && obstacle.is_some() {
            return Err("expected `motion` or `obstacle`, not both: pins on an obstacle follow its motion".to_owned());
        }
        let choices = [
            vertex.map(PinChoice::Vertex),
            vertices.map(PinChoice::Vertices),
            inside.map(PinChoice::Box),
            nearest.map(PinChoice::Nearest),
            group.map(PinChoice::Group),
            boundary.then_some(PinChoice::Boundary),
            all.then_some(PinChoice::All),
        ];
        let mut given = choices.into_iter().flatten();
        match (given.next(), given.next()) {
            (Some(choice), None) => Ok(Self { choice, name, of, motion, obstacle, soft, release }),
            _ => {
                let expected = "`vertex`, `vertices`, `box`, `nearest`, `group`, `boundary` and `all`";
                Err(format!("expected exactly one of {expected}"))
            }
        }
    }
}

impl Keys {
    /// Returns the springs of a soft pin; `None` if the vertices are held exactly.
    fn soft(&self) -> Result<Option<SoftPin>, String> {
        match (&self.weights, self.stiffness, &self.vertices) {
            (None, stiffness, _) => Ok(stiffness.map(|stiffness| SoftPin { stiffness, weights: Vec::new() })),
            (Some(_), None, _) => Err("`weights` are factors of `stiffness`, which is missing".to_owned()),
            (Some(_), _, None) => Err("`weights` belong to the vertices of a list; give `vertices`".to_owned()),
            (Some(weights), Some(stiffness), Some(vertices)) if weights.len() == vertices.len() => {
                Ok(Some(SoftPin { stiffness, weights: weights.clone() }))
            }
            (Some(weights), _, Some(vertices)) => {
                let (found, expected) = (weights.len(), vertices.len());
                Err(format!("expected one weight per vertex: {expected}, got {found}"))
            }
        }
    }
}

impl Pin {
    /// Creates a fixed pin that chooses from the whole scene.
    #[must_use]
    pub fn fixed(choice: PinChoice) -> Self {
        Self { choice, name: None, of: None, motion: None, obstacle: None, soft: None, release: None }
    }
}
