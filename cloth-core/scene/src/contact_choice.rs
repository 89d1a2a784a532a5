use schemars::JsonSchema;
use serde::Deserialize;

use cloth_physics::integrator::Scheme;

/// The parts of a scene that collide.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum ContactChoice {
    /// Cloth and hair collide with themselves, with each other, and with obstacles. Needs the integrator `newton`.
    On,
    /// Cloth and hair collide with obstacles, but pass through themselves.
    Obstacles,
    /// Nothing collides.
    Off,
}

impl ContactChoice {
    /// The parts that collide if the scene does not say so. Only `newton` can keep cloth from passing through itself.
    /// Contact couples everything: nothing could sleep on its own, and hair would lose its direct solution, strand by
    /// strand.
    pub(super) fn usual(scheme: Scheme, sleeps: bool, has_cloth: bool) -> Self {
        if scheme == Scheme::Newton && !sleeps && has_cloth { Self::On } else { Self::Obstacles }
    }
}
