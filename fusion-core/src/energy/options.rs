use serde::{Deserialize, Serialize};

use crate::option_error::OptionError;
use crate::twist::AngleConvention;

/// Weights λ of the terms, in 1/m² for a dimensionless energy.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TermWeights {
    /// λ_n, distances of vertices from measured points along normals.
    pub nonrigid: f64,
    /// λ_s, the same for the skinned skeleton. With known bones it is only reported.
    pub skeleton: f64,
    /// λ_g, differences between neighbouring nodes.
    pub graph: f64,
    /// λ_b, distances of nodes from their bones.
    pub binding: f64,
    /// Distances of unknown bones from the reported ones.
    pub prior: f64,
    /// Distances of unknown bones from the motions predicted from the last frames.
    pub motion: f64,
    /// Gaps between unknown bones at their joints.
    pub joints: f64,
}

impl Default for TermWeights {
    fn default() -> Self {
        Self { nonrigid: 1.0, skeleton: 1.0, graph: 0.25, binding: 5.0, prior: 0.5, motion: 0.1, joints: 1000.0 }
    }
}

/// The weight ψ of an edge as a function of s = |H_i − H_j|².
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum EdgeWeight {
    /// min(1, δ/s): edges within a part are stiffer than edges between parts.
    #[default]
    Decreasing,
    /// min(1, δ/√s).
    DecreasingByNorm,
    /// Huber's loss ρ(s) itself, as printed in the paper: zero within a part, largest across joints.
    Printed,
    /// 1 for every edge.
    Uniform,
}

impl EdgeWeight {
    /// δ of the paper.
    pub const DELTA: f64 = 0.2;

    /// Returns ψ(s).
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

/// The treatment of the normal in the derivative of the data term.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum NormalDerivative {
    /// The normal moves with the nodes.
    #[default]
    Full,
    /// The normal is held fixed, as in many systems.
    Frozen,
}

/// Whether the motions of bones are known.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum BoneMode {
    /// Bones move as the body tracker reports.
    #[default]
    Known,
    /// Each bone has six unknowns, near the reported motion.
    Unknown,
}

/// Options of the energy.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
#[non_exhaustive]
pub struct EnergyOptions {
    /// Weights λ of the terms.
    pub weights: TermWeights,
    /// Weights ψ of the edges.
    pub edges: EdgeWeight,
    /// Convention of the angle ‖θ‖.
    pub angle: AngleConvention,
    /// Jacobian of the data term.
    pub normal: NormalDerivative,
    /// Whether bones are unknowns.
    pub bones: BoneMode,
    /// Distance in m from a bone's joint at which unknown bones are compared with reported and predicted ones. Errors
    /// of position and errors of rotation times this distance weigh the same.
    pub prior_reach: f64,
    /// Tukey's limit of the data term, in m; `None` for least squares.
    pub data_tukey: Option<f64>,
    /// Huber's limit of the graph, in m; `None` for least squares.
    pub graph_huber: Option<f64>,
    /// Part κ of a node's distance from known bones, along its normal, that E_binding does not resist; at least 0 and
    /// below 1. Depth determines the motion along normals, and hardly the motion along the surface. Without effect on
    /// unknown bones.
    pub normal_slack: f64,
}

impl Default for EnergyOptions {
    fn default() -> Self {
        Self {
            weights: TermWeights::default(),
            edges: EdgeWeight::default(),
            angle: AngleConvention::default(),
            normal: NormalDerivative::default(),
            bones: BoneMode::default(),
            prior_reach: 0.4,
            data_tukey: None,
            graph_huber: None,
            normal_slack: 0.9,
        }
    }
}

impl EnergyOptions {
    /// Checks every option.
    ///
    /// # Errors
    /// Names the first option that cannot be used.
    pub fn validate(&self) -> Result<(), OptionError> {
        let TermWeights { nonrigid, skeleton, graph, binding, prior, motion, joints } = self.weights;
        // Without these terms, data or bones would have no influence, or nodes without data would not be determined.
        OptionError::ensure_positive("tracker.energy.weights.nonrigid", nonrigid)?;
        OptionError::ensure_positive("tracker.energy.weights.graph", graph)?;
        OptionError::ensure_positive("tracker.energy.weights.binding", binding)?;
        OptionError::ensure_not_negative("tracker.energy.weights.skeleton", skeleton)?;
        OptionError::ensure_not_negative("tracker.energy.weights.motion", motion)?;
        OptionError::ensure_not_negative("tracker.energy.weights.joints", joints)?;
        match self.bones {
            BoneMode::Known => OptionError::ensure_not_negative("tracker.energy.weights.prior", prior)?,
            // The motion alone drifts.
            BoneMode::Unknown => OptionError::ensure_positive("tracker.energy.weights.prior", prior)?,
        }
        OptionError::ensure_positive("tracker.energy.prior_reach", self.prior_reach)?;
        let slack = (0.0..1.0).contains(&self.normal_slack);
        let range = "a number from 0 to less than 1";
        OptionError::ensure(slack, "tracker.energy.normal_slack", range, self.normal_slack)?;
        for (name, limit) in
            [("tracker.energy.data_tukey", self.data_tukey), ("tracker.energy.graph_huber", self.graph_huber)]
        {
            limit.map_or(Ok(()), |limit| OptionError::ensure_positive(name, limit))?;
        }
        Ok(())
    }
}
