use schemars::JsonSchema;
use serde::Deserialize;

use cloth_physics::bounded::{MaybePair, MaybeReal, Positive};

/// Parts that do not collide with each other.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(try_from = "Keys")]
#[schemars(with = "Keys")]
pub enum Exclusion {
    /// Two garments, hairs, obstacles or groups, by name.
    Between([String; 2]),
    /// Parts of cloth and hair that start closer than this, in m.
    CloserThan(f64),
    /// Parts of cloth that start within this distance of the same seam, in m.
    NearSeams(f64),
}

/// Parts that do not collide with each other: exactly one of `between`, `closer_than` and `near_seams`.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("oneOf" = [
    { "required": ["between"] },
    { "required": ["closer_than"] },
    { "required": ["near_seams"] },
]))]
struct Keys {
    /// Names of two garments, hairs or obstacles, or of groups in a garment's OBJ file, such as `shirt/collar`. Twice
    /// the same name for a part that may pass through itself.
    #[serde(default, with = "MaybePair")]
    between: Option<[String; 2]>,
    /// Parts of cloth and hair that start closer than this, in m, such as layers that are sewn flat onto each other.
    #[serde(default, with = "MaybeReal::<Positive>")]
    closer_than: Option<f64>,
    /// Parts of cloth that start within this distance of the same seam, in m.
    #[serde(default, with = "MaybeReal::<Positive>")]
    near_seams: Option<f64>,
}

impl TryFrom<Keys> for Exclusion {
    type Error = &'static str;

    fn try_from(keys: Keys) -> Result<Self, Self::Error> {
        match (keys.between, keys.closer_than, keys.near_seams) {
            (Some(names), None, None) => Ok(Self::Between(names)),
            (None, Some(distance), None) => Ok(Self::CloserThan(distance)),
            (None, None, Some(distance)) => Ok(Self::NearSeams(distance)),
            _ => Err("expected exactly one of `between`, `closer_than` and `near_seams`"),
        }
    }
}
