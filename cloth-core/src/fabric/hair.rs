use energy_dsl::Vector3;
use schemars::JsonSchema;
use serde::Deserialize;

use crate::bounded::{count, finite_triple, non_negative, nonzero_triple, positive};
use crate::geometry::norm;

/// Strands of hair, straight at rest: springs along their segments and bending at the vertices between.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Hair {
    /// What pins and seams call it. Default `hair` and its number from 0.
    #[serde(default)]
    pub name: Option<String>,
    /// Strands. Their roots are spread evenly from `root` to `last_root`.
    #[serde(deserialize_with = "count::<1, _>")]
    pub count: usize,
    /// Segments of a strand.
    #[serde(deserialize_with = "count::<2, _>")]
    pub segments: usize,
    /// The length of a strand, in m.
    #[serde(deserialize_with = "positive")]
    pub length: f64,
    /// The root of the first strand, in m. Default the origin.
    #[serde(default, deserialize_with = "finite_triple")]
    pub root: [f64; 3],
    /// The root of the last strand, in m. Default that of the first.
    #[serde(default)]
    pub last_root: Option<[f64; 3]>,
    /// Where the strands grow at the start. Default [0, 0, −1].
    #[serde(default = "down", deserialize_with = "nonzero_triple")]
    pub direction: [f64; 3],
    /// Mass per length, in kg/m.
    #[serde(deserialize_with = "positive")]
    pub density: f64,
    /// The tension over the strain, Young's modulus times the cross-section, in N.
    #[serde(deserialize_with = "positive")]
    pub stretch_stiffness: f64,
    /// The bending moment over the curvature, Young's modulus times the second moment of the cross-section, in N m².
    #[serde(deserialize_with = "non_negative")]
    pub bend_stiffness: f64,
    /// Whether roots keep their place and direction. Default true.
    #[serde(default = "yes")]
    pub rooted: bool,
}

fn down() -> [f64; 3] {
    [0.0, 0.0, -1.0]
}

fn yes() -> bool {
    true
}

impl Hair {
    /// The vertices at the start, strand by strand from the root, in m.
    #[must_use]
    pub fn vertices(&self) -> Vec<Vector3<f64>> {
        let last = self.last_root.unwrap_or(self.root);
        let unit = self.direction.map(|component| component / norm(self.direction));
        let mut vertices = Vec::with_capacity(self.count * (self.segments + 1));
        for strand in 0..self.count {
            let across = strand as f64 / (self.count - 1).max(1) as f64;
            for joint in 0..=self.segments {
                let along = self.length * joint as f64 / self.segments as f64;
                vertices.push(std::array::from_fn(|axis| {
                    self.root[axis] + across * (last[axis] - self.root[axis]) + along * unit[axis]
                }));
            }
        }
        vertices
    }

    /// The mass of each vertex, in kg: half of each of its segments.
    #[must_use]
    pub fn masses(&self) -> Vec<f64> {
        let segment = self.density * self.length / self.segments as f64;
        let end = |joint: usize| joint.is_multiple_of(self.segments);
        (0..self.count)
            .flat_map(|_| (0..=self.segments).map(|j| if end(j) { 0.5 * segment } else { segment }))
            .collect()
    }
}
