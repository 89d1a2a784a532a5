//! Which measured point belongs to which vertex: the one in the pixel where the vertex is seen.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::depth::{Camera, DepthImage};
use crate::energy::{Moved, Pair};

/// When a match is believed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Gates {
    /// The largest distance of vertex and point, m.
    pub distance: f64,
    /// The largest angle between their normals, rad.
    pub angle: f64,
    /// Pixels to each side that the measured normal is taken from.
    pub normal_reach: usize,
}

impl Default for Gates {
    fn default() -> Self {
        Self { distance: 0.04, angle: 45.0_f64.to_radians(), normal_reach: 2 }
    }
}

/// What became of the vertices.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct MatchCounts {
    /// Matched.
    pub matched: usize,
    /// Seen from behind.
    pub back_facing: usize,
    /// Outside of the image, or behind the camera.
    pub outside: usize,
    /// Nothing measured there, or no normal.
    pub no_depth: usize,
    /// Beyond the gate of distance.
    pub far: usize,
    /// Beyond the gate of the angle.
    pub turned: usize,
}

/// Matches each vertex with the point measured where it is seen. `origin` is that of the model in the camera's coordinates.
#[must_use]
pub fn correspondences(
    moved: &Moved,
    origin: &Vector3<f64>,
    image: &DepthImage,
    camera: &Camera,
    gates: &Gates,
) -> (Vec<Pair>, MatchCounts) {
    let (mut pairs, mut counts) = (Vec::new(), MatchCounts::default());
    let least_cosine = gates.angle.cos();
    for (vertex, (place, normal)) in moved.vertices.iter().zip(&moved.normals).enumerate() {
        let seen = place + origin;
        if normal.dot(&seen) >= 0.0 {
            counts.back_facing += 1;
            continue;
        }
        let Some(pixel) = camera.pixel(&seen) else {
            counts.outside += 1;
            continue;
        };
        let Some(depth) = image.at(pixel) else {
            counts.no_depth += 1;
            continue;
        };
        let point = camera.unproject(pixel, depth);
        if (seen - point).norm() > gates.distance {
            counts.far += 1;
            continue;
        }
        match image.normal(camera, pixel, gates.normal_reach) {
            None => counts.no_depth += 1,
            Some(measured) if measured.dot(normal) < least_cosine => counts.turned += 1,
            Some(_) => {
                counts.matched += 1;
                pairs.push(Pair { vertex: vertex as u32, point: point - origin });
            }
        }
    }
    (pairs, counts)
}
