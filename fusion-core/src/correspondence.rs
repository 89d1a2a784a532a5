//! Correspondences by projection: a vertex matches the point measured in the pixel that it projects to.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::depth::NormalMap;
use crate::energy::{Moved, Pair};

/// Criteria for accepting a match.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Gates {
    /// Largest distance of vertex and point, in m.
    pub distance: f64,
    /// Largest angle between their normals, in rad.
    pub angle: f64,
    /// Pixels on each side to which a plane is fitted for the measured normal.
    pub normal_reach: usize,
}

impl Gates {
    /// Largest [`Self::normal_reach`].
    pub const FURTHEST_REACH: usize = 20;
}

impl Default for Gates {
    fn default() -> Self {
        Self { distance: 0.04, angle: 45.0_f64.to_radians(), normal_reach: 2 }
    }
}

/// Number of vertices by the result of their search.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[non_exhaustive]
pub struct MatchCounts {
    /// Matched vertices.
    pub matched: usize,
    /// Facing away from the camera.
    pub back_facing: usize,
    /// Behind another part of the body.
    pub hidden: usize,
    /// Outside the image, or behind the camera.
    pub outside: usize,
    /// Without a measured depth or normal.
    pub no_depth: usize,
    /// Too far from the measured point.
    pub far: usize,
    /// With too large an angle to the measured normal.
    pub turned: usize,
}

/// Matches each vertex with the point measured in its pixel. `origin` is the model's origin in the camera's
/// coordinates. `hidden` vertices have no match; an empty list hides none.
#[must_use]
pub fn correspondences(
    moved: &Moved,
    origin: &Vector3<f64>,
    normals: &mut NormalMap<'_>,
    gates: &Gates,
    hidden: &[bool],
) -> (Vec<Pair>, MatchCounts) {
    let (image, rays) = (normals.image, normals.rays);
    let (mut pairs, mut counts) = (Vec::new(), MatchCounts::default());
    let least_cosine = gates.angle.cos();
    for (vertex, (place, normal)) in moved.vertices.iter().zip(&moved.normals).enumerate() {
        let seen = place + origin;
        if normal.dot(&seen) >= 0.0 {
            counts.back_facing += 1;
            continue;
        }
        if hidden.get(vertex) == Some(&true) {
            counts.hidden += 1;
            continue;
        }
        let Some(pixel) = rays.camera().pixel(&seen) else {
            counts.outside += 1;
            continue;
        };
        let Some(depth) = image.at(pixel) else {
            counts.no_depth += 1;
            continue;
        };
        let point = rays.point(pixel, depth);
        if (seen - point).norm() > gates.distance {
            counts.far += 1;
            continue;
        }
        match normals.at(pixel) {
            None => counts.no_depth += 1,
            Some(measured) if measured.normal.dot(normal) < least_cosine => counts.turned += 1,
            Some(_) => {
                counts.matched += 1;
                pairs.push(Pair { vertex: vertex as u32, point: point - origin });
            }
        }
    }
    (pairs, counts)
}
