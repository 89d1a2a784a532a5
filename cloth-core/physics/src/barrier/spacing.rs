//! Thickness and activation gap of each pair.

use super::ACTIVATION;
use crate::collision::{Clearance, CollisionMesh, Pair};

/// The activation gap over the thickness of cloth.
pub const GAP_PER_THICKNESS: f64 = 2.0;
/// The largest reach of contact over the shortest edge. Features of a flat sheet must not touch their neighbours.
pub const LARGEST_REACH: f64 = 0.4;

/// Returns the part of their thickness that fabrics keep in contact: coarse fabrics on fine meshes get thinner, with a
/// gap in proportion. Both lengths are in m.
#[must_use]
pub fn thinning(thickest: f64, shortest_edge: f64) -> f64 {
    (LARGEST_REACH * shortest_edge / ((1.0 + GAP_PER_THICKNESS) * thickest)).min(1.0)
}

/// The skin of an obstacle: the barrier acts between it and the surface of contact.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Skin {
    /// The radius of the solid about its core, in m.
    pub radius: f64,
    /// The distance from the solid that nothing goes below, in m.
    pub thickness: f64,
    /// The distance beyond the thickness at which contact begins, in m.
    pub gap: f64,
}

/// Thickness and activation gap of a pair.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Spacing {
    /// The distance ξ at which the pair touches, in m.
    pub thickness: f64,
    /// The activation gap g, in m.
    pub gap: f64,
}

/// The spacing of all pairs.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Spacings {
    /// Half of the thickness of cloth and hair at each vertex, in m.
    pub radii: Vec<f64>,
    /// The activation gap between parts of cloth and hair, in m.
    pub gap: f64,
    /// The skin of each obstacle.
    pub skins: Vec<Skin>,
}

impl Spacing {
    /// The distances that the pair must keep. `is_plane` if its triangle stands for a plane.
    pub fn clearance(self, is_plane: bool) -> Clearance {
        Clearance { thickness: self.thickness, reach: self.thickness + self.gap, is_plane }
    }
}

impl Skin {
    /// The distance from the core at which contact begins, in m.
    fn reach(&self) -> f64 {
        self.radius + self.thickness + self.gap
    }
}

impl Spacings {
    /// Returns the spacing of a pair. Contact with an obstacle measures from the middle of the cloth.
    #[inline]
    pub fn of(&self, mesh: &CollisionMesh, pair: &Pair) -> Spacing {
        if let Some(obstacle) = mesh.obstacle_of(pair) {
            let skin = &self.skins[obstacle];
            return Spacing { thickness: skin.radius + skin.thickness, gap: skin.gap };
        }
        let [first, second] = [pair.vertices[0] as usize, pair.vertices[pair.first()] as usize];
        Spacing { thickness: self.radii[first] + self.radii[second], gap: self.gap }
    }

    /// The largest distance at which contact begins, in m.
    pub fn largest_reach(&self) -> f64 {
        let thickest = self.radii.iter().copied().fold(0.0, f64::max);
        self.skins.iter().map(Skin::reach).fold(2.0 * thickest + self.gap, f64::max)
    }

    /// The distance within which a pair becomes active, in m: beyond the reach by a part of it.
    #[inline]
    pub fn activation(&self, mesh: &CollisionMesh, pair: &Pair) -> f64 {
        let Spacing { thickness, gap } = self.of(mesh, pair);
        let solid = mesh.obstacle_of(pair).map_or(0.0, |obstacle| self.skins[obstacle].radius);
        solid + ACTIVATION * (thickness + gap - solid)
    }

    /// Returns half the distance within which pairs are searched for, at each vertex.
    pub fn halves(&self, mesh: &CollisionMesh) -> Vec<f64> {
        let own = 0.5 * ACTIVATION * (self.gap + 2.0 * self.radii.iter().copied().fold(0.0, f64::max));
        let skin = |skin: &Skin| (skin.radius + ACTIVATION * (skin.reach() - skin.radius) - own).max(0.0);
        let half = |vertex: u32| mesh.obstacle(vertex).map_or(own, |obstacle| skin(&self.skins[obstacle]));
        (0..energy_solve::index(mesh.vertices())).map(half).collect()
    }
}
