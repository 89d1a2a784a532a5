//! The feature that contact presses the most, for messages.

use energy_dsl::Vector3;
use energy_solve::{Pressed, Presser};

use super::BarrierContact;
use super::law::Order;
use crate::collision::Pair;
use crate::geometry::dot;

/// Two pushes come from opposite sides if the cosine of the angle between them is below this.
const OPPOSITE: f64 = -0.5;

/// The push of one feature on another.
struct Push<'a> {
    /// The pushed feature, which is not an obstacle.
    on: &'a [u32],
    by: &'a [u32],
    direction: Vector3<f64>,
    /// In N.
    force: f64,
}

impl Push<'_> {
    /// Whether it acts on the same feature as another push, from the opposite side.
    fn opposes(&self, other: &Self) -> bool {
        self.on.iter().any(|vertex| other.on.contains(vertex)) && dot(self.direction, other.direction) < OPPOSITE
    }
}

impl BarrierContact {
    /// Returns the feature with the largest push at x, what pushes it, and what pushes against that.
    pub(super) fn find_most_pressed(&self, x: &[Vector3<f64>]) -> Option<Pressed> {
        let active = self.active.evaluate(x, Order::Force, 1, |active| {
            let push = |(pair, closest, barrier): (&Pair, _, &_)| (*pair, closest, *barrier);
            active.iter().map(push).collect::<Vec<_>>()
        });
        let pushes = active.iter().flatten().flat_map(|(pair, closest, barrier)| {
            let (first, second) = pair.vertices.split_at(pair.first());
            let back = closest.normal.map(|component| -component);
            [(first, second, closest.normal), (second, first, back)].map(|(on, by, direction)| Push {
                on,
                by,
                direction,
                force: barrier.force,
            })
        });
        let pushes: Vec<_> = pushes.filter(|push| self.mesh.obstacle(push.on[0]).is_none()).collect();
        let largest = pushes.iter().map(|push| push.force).max_by(f64::total_cmp)?;
        let against = |one: &Push<'_>| {
            pushes.iter().filter(|other| other.opposes(one)).max_by(|a, b| a.force.total_cmp(&b.force))
        };
        // The strongest contact pushes two features apart. The one that is pushed back harder is wedged.
        let both = pushes.iter().filter(|push| push.force == largest).map(|push| (push, against(push)));
        let force = |back: &Option<&Push<'_>>| back.map_or(0.0, |push| push.force);
        let (push, back) = both.max_by(|(_, one), (_, other)| force(one).total_cmp(&force(other)))?;
        let by = [Some(push), back].into_iter().flatten().map(|push| self.presser(push.by)).collect();
        Some(Pressed { vertices: distinct(push.on), by })
    }

    fn presser(&self, feature: &[u32]) -> Presser {
        match self.mesh.obstacle(feature[0]) {
            Some(obstacle) => Presser::Obstacle(self.names[obstacle].clone()),
            None => Presser::Vertices(distinct(feature)),
        }
    }
}

/// Returns the vertices of a feature, once each.
fn distinct(feature: &[u32]) -> Vec<usize> {
    let mut vertices: Vec<usize> = feature.iter().map(|vertex| *vertex as usize).collect();
    vertices.dedup();
    vertices
}
