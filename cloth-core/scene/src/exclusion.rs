use schemars::JsonSchema;
use serde::Deserialize;

use cloth_physics::bounded::{MaybePair, MaybeReal, Positive};

/// Parts that do not collide with each other: exactly one of `between`, `closer_than` and `near_seams`.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("oneOf" = [
    { "required": ["between"] },
    { "required": ["closer_than"] },
    { "required": ["near_seams"] },
]))]
pub struct Exclusion {
    /// Names of two garments, hairs or obstacles, or of groups in a garment's OBJ file, such as `shirt/collar`. Twice
    /// the same name for a part that may pass through itself.
    #[serde(default, with = "MaybePair")]
    pub between: Option<[String; 2]>,
    /// Parts of cloth and hair that start closer than this, in m, such as layers that are sewn flat onto each other.
    #[serde(default, with = "MaybeReal::<Positive>")]
    pub closer_than: Option<f64>,
    /// Parts of cloth that start within this distance of the same seam, in m.
    #[serde(default, with = "MaybeReal::<Positive>")]
    pub near_seams: Option<f64>,
}

impl Exclusion {
    /// Whether exactly one of the keys is given.
    pub(super) fn is_one_choice(&self) -> bool {
        let choices = [self.between.is_some(), self.closer_than.is_some(), self.near_seams.is_some()];
        choices.into_iter().filter(|&given| given).count() == 1
    }
}
