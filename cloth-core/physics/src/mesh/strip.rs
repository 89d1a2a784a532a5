use schemars::JsonSchema;
use serde::Deserialize;

use super::{Diagonals, Plane, Sheet};
use crate::bounded::{Count, Positive, Real};

/// A built-in strip along the first axis, with nearly square cells and alternating diagonals.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Strip {
    /// Length along the first axis, in m.
    #[serde(with = "Real::<Positive>")]
    pub length: f64,
    /// Width, in m.
    #[serde(with = "Real::<Positive>")]
    pub width: f64,
    /// Cells along the length.
    #[serde(with = "Count::<1, 4096>")]
    pub segments: usize,
    /// `horizontal` (the default) or `vertical`.
    #[serde(default)]
    pub plane: Plane,
}

impl Strip {
    /// Returns the strip as a sheet.
    ///
    /// ```
    /// let strip = cloth_physics::mesh::Strip { length: 1.0, width: 0.1, segments: 40, plane: Default::default() };
    /// assert_eq!(strip.sheet().cells, [40, 4]);
    /// ```
    #[must_use]
    pub fn sheet(&self) -> Sheet {
        let across = (self.segments as f64 * self.width / self.length).round().clamp(1.0, 4096.0) as usize;
        Sheet {
            cells: [self.segments, across],
            size: [self.length, self.width],
            diagonals: Diagonals::Alternating,
            plane: self.plane,
            pleats: None,
        }
    }
}
