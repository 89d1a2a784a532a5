use schemars::JsonSchema;
use serde::Deserialize;

use crate::bounded::{non_negative, positive};

/// Stitches between two garments: springs without rest length, ½ K ‖x_P − x_Q‖². Either `pairs` or `within` says which vertices.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Seam {
    /// The names of the two; twice the same for a seam of a garment with itself.
    pub garments: [String; 2],
    /// Pairs of vertices, the first of the first garment, both counted from 0 within their garment.
    #[serde(default)]
    pub pairs: Option<Vec<[usize; 2]>>,
    /// Joins each vertex of the first garment's edge to the nearest of the second's, where that lies within this distance at the start, in m.
    #[serde(default)]
    #[schemars(range(min = 0.0))]
    pub within: Option<f64>,
    /// K of a stitch, in N/m.
    #[serde(deserialize_with = "positive")]
    pub stiffness: f64,
    /// k_d of the force −k_d (v_P − v_Q) of a stitch, in N s/m. Default 0.
    #[serde(default, deserialize_with = "non_negative")]
    pub damping: f64,
}
