use serde::{Deserialize, Serialize};

use crate::twist::AngleConvention;

/// λ of each term, in 1/m² if the energy is to be a number.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TermWeights {
    /// λ_n, vertices to measured points along normals.
    pub nonrigid: f64,
    /// λ_s, the same for the skinned skeleton. With known bones it is reported only.
    pub skeleton: f64,
    /// λ_g, neighbouring nodes alike.
    pub graph: f64,
    /// λ_b, nodes with their bones.
    pub binding: f64,
    /// Unknown bones: near to what the body tracker says.
    pub prior: f64,
    /// Unknown bones: together at their joints.
    pub joints: f64,
}

impl Default for TermWeights {
    fn default() -> Self {
        Self { nonrigid: 1.0, skeleton: 1.0, graph: 2.0, binding: 5.0, prior: 3.0, joints: 1000.0 }
    }
}

/// ψ of an edge, by s = |H_i − H_j|².
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum EdgeWeight {
    /// min(1, δ/s): nodes of one part hold together, those of different parts less.
    #[default]
    Decreasing,
    /// min(1, δ/√s).
    DecreasingByNorm,
    /// Huber's loss ρ(s) itself, as the paper prints it: none inside a part, most across joints.
    Printed,
    /// 1.
    Uniform,
}

impl EdgeWeight {
    /// δ, as the paper has it.
    pub const DELTA: f64 = 0.2;

    /// ψ(s).
    #[must_use]
    pub fn of(self, s: f64, delta: f64) -> f64 {
        match self {
            Self::Decreasing if s <= delta => 1.0,
            Self::Decreasing => delta / s,
            Self::DecreasingByNorm if s.sqrt() <= delta => 1.0,
            Self::DecreasingByNorm => delta / s.sqrt(),
            Self::Printed if s <= delta => s * s / 2.0,
            Self::Printed => delta * (s - delta / 2.0),
            Self::Uniform => 1.0,
        }
    }
}

/// What the normal does in the derivative of the data term.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum NormalDerivative {
    /// It moves with the nodes.
    #[default]
    Full,
    /// It is held, as many systems do.
    Frozen,
}

/// Whether bones are known.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum BoneMode {
    /// As the body tracker says.
    #[default]
    Known,
    /// Six unknowns each, near to what the body tracker says.
    Unknown,
}

/// Which energy.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct EnergyOptions {
    /// λ.
    pub weights: TermWeights,
    /// ψ.
    pub edges: EdgeWeight,
    /// What ‖θ‖ means.
    pub angle: AngleConvention,
    /// Which Jacobian the data term has.
    pub normal: NormalDerivative,
    /// Whether bones are unknowns.
    pub bones: BoneMode,
    /// Tukey's limit of the data term, m; none for least squares.
    pub data_tukey: Option<f64>,
    /// Huber's limit of the graph, m; none for least squares.
    pub graph_huber: Option<f64>,
}
