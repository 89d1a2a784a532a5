use schemars::JsonSchema;
use serde::Deserialize;

use cloth_physics::bounded::{MaybeReal, NonNegative, Pair, Pairs, Positive, Real};

/// Stitches between two garments: springs with rest length 0, energy ½ K ‖x_P − x_Q‖². Exactly one of `pairs` and
/// `within` chooses the vertices.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
#[schemars(extend("oneOf" = [{ "required": ["pairs"] }, { "required": ["within"] }]))]
pub struct Seam {
    /// Names of the two garments; twice the same name for a seam within one garment.
    #[serde(with = "Pair")]
    pub garments: [String; 2],
    /// Pairs of vertices, one of each garment, both with indices from 0 within their garment.
    #[serde(default, with = "Pairs")]
    pub pairs: Option<Vec<[usize; 2]>>,
    /// Joins each boundary vertex of the first garment to the nearest one of the second, if they are at most this far
    /// apart at the start, in m.
    #[serde(default, with = "MaybeReal::<NonNegative>")]
    pub within: Option<f64>,
    /// Stiffness K of a stitch, in N/m.
    #[serde(with = "Real::<Positive>")]
    pub stiffness: f64,
    /// Damping k_d of a stitch, in N s/m: the force −k_d (v_P − v_Q). Default 0.
    #[serde(default, with = "Real::<NonNegative>")]
    pub damping: f64,
    /// Closes the seam over time: the rest length of each stitch shrinks linearly from its length at the start to 0.
    /// Default: the rest length is 0 from the start on.
    #[serde(default)]
    pub close: Option<Closing>,
}

/// When a seam closes.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Closing {
    /// Time at which the seam begins to close, in s. Default 0.
    #[serde(default, with = "Real::<NonNegative>")]
    pub start: f64,
    /// Time that the seam takes to close, in s.
    #[serde(with = "Real::<Positive>")]
    pub duration: f64,
}

impl Closing {
    /// Returns the open part of the seam at a time in s: 1 before it begins to close, 0 once it is closed.
    #[must_use]
    pub fn open_part(&self, time: f64) -> f64 {
        (1.0 - (time - self.start) / self.duration).clamp(0.0, 1.0)
    }
}
