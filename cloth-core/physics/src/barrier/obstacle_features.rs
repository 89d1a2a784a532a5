//! Selects the pairs of cloth and obstacle that act as a contact.
//!
//! The rules are those of cloth on cloth, with two differences.
//! - Cloth lies flat across the edge of a table: its edges are level with their surroundings there, and still carry it.
//! - Cloth on a ball or a rail is nearest to its core almost everywhere. Which of its features are local minima of the
//!   distance changes with every small motion, so all of them act. Each of them sees a smooth distance.

use super::feasible::{Meeting, are_parallel, falls_away, is_ridge};
use crate::collision::{Closest, Pair};

/// Sine of the angle by which the triangles of an edge of cloth may rise towards an edge of an obstacle.
const LEVEL: f64 = 0.3;

impl Meeting<'_> {
    /// Whether an edge of cloth or hair and an edge of an obstacle become a contact. The edge of the obstacle is the
    /// second.
    pub(super) fn edges_meet_obstacle(&self, pair: &Pair, closest: &Closest) -> bool {
        let Self { mesh, x, .. } = *self;
        let [own, other] = pair.features;
        let [a, b, c, d] = pair.vertices;
        let has_triangles = |edge: u32| !mesh.apexes(edge as usize).is_empty();
        if !has_triangles(other) {
            // Vertices of cloth touch rails, too.
            return !has_triangles(own) || closest.weights.iter().all(|weight| *weight != 0.0);
        }
        let towards = closest.normal.map(|component| -component);
        closest.weights.iter().all(|weight| *weight != 0.0)
            && falls_away(mesh, x, own, towards, LEVEL)
            && is_ridge(mesh, x, other, closest.normal)
            && !are_parallel(x, [a, b], [c, d])
    }
}
