use schemars::JsonSchema;
use serde::Deserialize;

/// The files that a run writes. Keys that are not given keep their defaults.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct OutputChoice {
    /// `cloth.png`, the last frame. Default true.
    pub picture: bool,
    /// `cloth.glb`, animated glTF. Default true.
    pub gltf: bool,
    /// `cloth.usda`, animated USD. Default true.
    pub usd: bool,
    /// `frames/cloth_0000.obj`, …. Default true.
    pub obj: bool,
    /// `frames/cloth_0000.ply`, …: binary, with velocities. Default false.
    pub ply: bool,
    /// `frames/cloth_0000.png`, …. Default false.
    pub png: bool,
    /// `ledger.csv` and `ledger.svg`: energies, work and momenta at each step. Default true.
    pub ledger: bool,
}

impl Default for OutputChoice {
    fn default() -> Self {
        Self { picture: true, gltf: true, usd: true, obj: true, ply: false, png: false, ledger: true }
    }
}
