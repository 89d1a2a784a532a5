use std::collections::BTreeMap;

use crate::Coulomb;
use crate::collision::{CollisionMesh, Pair};

/// Friction of chosen pairs of parts, in place of that of their fabrics or obstacles.
///
/// Parts are numbered: those of cloth and hair first, then the obstacles in their order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PairFriction {
    part_of: Vec<u32>,
    first_obstacle: u32,
    chosen: BTreeMap<[u32; 2], Coulomb>,
}

impl PairFriction {
    /// Creates the friction of chosen pairs. `part_of` holds the part of each vertex of cloth and hair; obstacle i has
    /// the number `first_obstacle` + i.
    #[must_use]
    pub fn new(part_of: Vec<u32>, first_obstacle: u32, chosen: &[([u32; 2], Coulomb)]) -> Self {
        let sorted = |[a, b]: [u32; 2]| [a.min(b), a.max(b)];
        let chosen = chosen.iter().map(|(pair, coefficients)| (sorted(*pair), *coefficients)).collect();
        Self { part_of, first_obstacle, chosen }
    }

    /// Whether a chosen pair has friction.
    pub(super) fn has_friction(&self) -> bool {
        self.chosen.values().any(|coefficients| !coefficients.is_zero())
    }

    /// Returns the friction of a pair of features; `None` if their parts are not chosen.
    pub(super) fn of(&self, mesh: &CollisionMesh, pair: &Pair) -> Option<Coulomb> {
        if self.chosen.is_empty() {
            return None;
        }
        let part = |vertex: u32| match mesh.obstacle(vertex) {
            Some(obstacle) => Some(self.first_obstacle + energy_solve::index(obstacle)),
            None => self.part_of.get(vertex as usize).copied(),
        };
        let (a, b) = (part(pair.vertices[0])?, part(pair.vertices[pair.first()])?);
        self.chosen.get(&[a.min(b), a.max(b)]).copied()
    }
}
