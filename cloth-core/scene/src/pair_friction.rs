use cloth_physics::Coulomb;
use cloth_physics::bounded::Pair;
use schemars::JsonSchema;
use serde::Deserialize;

/// Friction of a pair of parts, in place of that of their fabrics, or of the obstacle.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct PairFriction {
    /// Names of two garments, hairs or obstacles. Twice the same name for a garment with itself.
    #[serde(with = "Pair")]
    pub between: [String; 2],
    /// A coefficient, or the table `static`, `kinetic`.
    pub coefficient: Coulomb,
}
