//! Thickness and activation gap of each pair.

use energy_dsl::Vector3;

use super::ACTIVATION;
use crate::collision::{Clearance, CollisionMesh, Pair};
use crate::geometry::{norm, subtract};

/// The activation gap over the thickness of cloth.
pub const GAP_PER_THICKNESS: f64 = 2.0;
/// The largest reach of contact over the shortest edge. Features of a flat sheet must not touch their neighbours.
pub const LARGEST_REACH: f64 = 0.4;

/// The largest change of the thickness from vertex to vertex over the length of the edge between them, so that nothing
/// is caught where cloth gets thinner.
const LARGEST_GRADE: f64 = 0.1;

/// Returns the part of their thickness that fabrics keep in contact: coarse fabrics on fine meshes get thinner, with a
/// gap in proportion. Both lengths are in m.
#[must_use]
pub fn thinning(thickest: f64, shortest_edge: f64) -> f64 {
    (LARGEST_REACH * shortest_edge / ((1.0 + GAP_PER_THICKNESS) * thickest)).min(1.0)
}

/// Returns the part of their thickness that fabrics keep at each vertex: short edges make the cloth around them
/// thinner, nothing else. The thickness is in m.
#[must_use]
pub fn local_thinning(mesh: &CollisionMesh, x: &[Vector3<f64>], thickest: f64) -> Vec<f64> {
    let shortest = mesh.shortest_edges(x);
    let mut kept: Vec<f64> = shortest.into_iter().map(|shortest| thinning(thickest, shortest)).collect();
    // Each sweep carries a grade at least one edge on.
    while mesh.own_edges().iter().filter(|edge| smooth(&mut kept, **edge, x, thickest)).count() > 0 {}
    kept
}

/// Limits the difference of the thickness along an edge. Returns whether that changed it.
fn smooth(kept: &mut [f64], [a, b]: [u32; 2], x: &[Vector3<f64>], thickest: f64) -> bool {
    let (a, b) = (a as usize, b as usize);
    let rise = LARGEST_GRADE * norm(subtract(x[a], x[b])) / thickest;
    let (thin, thick) = if kept[a] < kept[b] { (a, b) } else { (b, a) };
    let most = kept[thin] + rise;
    let is_steep = kept[thick] > most;
    if is_steep {
        kept[thick] = most;
    }
    is_steep
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
    /// The activation gap between parts of cloth and hair at each vertex, in m.
    pub gaps: Vec<f64>,
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
    /// Returns the spacing of a pair: that of the thinnest vertex of each feature, and the least gap. Contact with an
    /// obstacle measures from the middle of the cloth.
    #[inline]
    pub fn of(&self, mesh: &CollisionMesh, pair: &Pair) -> Spacing {
        if let Some(obstacle) = mesh.obstacle_of(pair) {
            let skin = &self.skins[obstacle];
            return Spacing { thickness: skin.radius + skin.thickness, gap: skin.gap };
        }
        let least = |all: &[f64], corners: &[u32]| {
            corners.iter().map(|&vertex| all[vertex as usize]).fold(f64::INFINITY, f64::min)
        };
        let (first, second) = pair.vertices.split_at(pair.first());
        let thickness = least(&self.radii, first) + least(&self.radii, second);
        Spacing { thickness, gap: least(&self.gaps, &pair.vertices) }
    }

    /// The largest distance at which contact begins, in m.
    pub fn largest_reach(&self) -> f64 {
        self.skins.iter().map(Skin::reach).fold(self.own_reach(), f64::max)
    }

    /// The largest distance at which contact of cloth and hair with themselves begins, in m.
    fn own_reach(&self) -> f64 {
        let largest = |all: &[f64]| all.iter().copied().fold(0.0, f64::max);
        2.0 * largest(&self.radii) + largest(&self.gaps)
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
        let own = 0.5 * ACTIVATION * self.own_reach();
        let skin = |skin: &Skin| (skin.radius + ACTIVATION * (skin.reach() - skin.radius) - own).max(0.0);
        let half = |vertex: u32| mesh.obstacle(vertex).map_or(own, |obstacle| skin(&self.skins[obstacle]));
        (0..energy_solve::index(mesh.vertices())).map(half).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A strip along x of cells of 10 mm, with one row of 0.1 mm.
    fn strip() -> (CollisionMesh, Vec<Vector3<f64>>) {
        let mut places = vec![0.0];
        for cell in 0..40 {
            places.push(places[cell] + if cell == 20 { 1e-4 } else { 1e-2 });
        }
        let x: Vec<Vector3<f64>> = places.iter().flat_map(|&x| [[x, 0.0, 0.0], [x, 1e-2, 0.0]]).collect();
        let cell = |first: usize| [[first, first + 2, first + 3], [first, first + 3, first + 1]];
        let triangles: Vec<[usize; 3]> = (0..40).flat_map(|number| cell(2 * number)).collect();
        (CollisionMesh::new(x.len(), &triangles, &[], &[]), x)
    }

    #[test]
    fn a_short_edge_thins_the_cloth_around_it_and_nothing_else() {
        let (mesh, x) = strip();
        let thickest = 1e-3;
        let kept = local_thinning(&mesh, &x, thickest);
        assert!((kept[40] - thinning(thickest, 1e-4)).abs() < 1e-12, "{}", kept[40]);
        assert!(kept[..36].iter().chain(&kept[48..]).all(|&part| part == 1.0), "{kept:?}");
        for &[a, b] in mesh.own_edges() {
            let (a, b) = (a as usize, b as usize);
            let rise = thickest * (kept[a] - kept[b]).abs() / norm(subtract(x[a], x[b]));
            assert!(rise < LARGEST_GRADE * (1.0 + 1e-9), "{rise}");
        }
    }

    /// A vertex 1.2 mm from an edge of 100 mm, with long edges only.
    #[test]
    fn a_low_triangle_thins_the_cloth_around_it() {
        let x = vec![[0.0; 3], [0.1, 0.0, 0.0], [0.05, 1.2e-3, 0.0], [0.05, -0.1, 0.0], [0.3, -0.4, 0.0]];
        let mesh = CollisionMesh::new(5, &[[0, 1, 2], [1, 0, 3], [1, 3, 4]], &[], &[]);
        let thickest = 1e-3;
        let kept = local_thinning(&mesh, &x, thickest);
        for (vertex, part) in kept.iter().enumerate() {
            let reach = 3.0 * thickest * part;
            assert!(if vertex < 3 { reach < 0.61 * 1.2e-3 } else { reach > 2e-3 }, "{vertex}: {reach}");
        }
        // The triangles of a grid are as high as their edges ask for.
        let grid = CollisionMesh::new(4, &[[0, 1, 3], [0, 3, 2]], &[], &[]);
        let square = [[0.0; 3], [1e-3, 0.0, 0.0], [0.0, 1e-3, 0.0], [1e-3, 1e-3, 0.0]];
        assert_eq!(local_thinning(&grid, &square, thickest), [thinning(thickest, 1e-3); 4]);
    }

    #[test]
    fn a_pair_is_as_thick_as_the_thinnest_vertices_of_its_features() {
        use crate::collision::PairKind;
        let (mesh, _) = strip();
        let all = |values: [f64; 4]| (0..mesh.vertices()).map(|vertex| values[vertex % 4]).collect();
        let spacings =
            Spacings { radii: all([4.0, 3.0, 2.0, 1.0]), gaps: all([9.0, 8.0, 6.0, 7.0]), skins: Vec::new() };
        for (kind, thickness) in [(PairKind::PointTriangle, 4.0 + 1.0), (PairKind::EdgeEdge, 3.0 + 1.0)] {
            let pair = Pair { kind, features: [0, 0], vertices: [0, 1, 2, 3] };
            assert_eq!(spacings.of(&mesh, &pair), Spacing { thickness, gap: 6.0 }, "{kind:?}");
        }
    }
}
