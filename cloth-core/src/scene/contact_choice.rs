use schemars::JsonSchema;
use serde::Deserialize;

/// What collides in a scene.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum ContactChoice {
    /// Cloth and hair collide with themselves, with each other, and with obstacles. Needs the integrator `newton`.
    On,
    /// Cloth and hair collide with obstacles, but pass through themselves.
    #[default]
    Obstacles,
    /// Nothing collides.
    Off,
}
