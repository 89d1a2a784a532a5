//! Crossings of cloth and obstacles.

use energy_dsl::Vector3;

use super::Simulation;
use crate::collision::{Closest, Crossing, Rules, Search, crossings};

/// Penetration of a rounded solid that counts as a crossing, over its radius. Below it is a rounding error.
const ROUNDING: f64 = 1e-12;

impl Simulation {
    /// Returns the number of places where cloth or hair crosses an obstacle now: an edge and a triangle that cross, by
    /// an exact test, or a part that is nearer to the core of a rounded solid than its radius. Parts that are pinned in
    /// an obstacle do not count.
    #[must_use]
    pub fn obstacle_crossings(&self) -> usize {
        if self.obstacles.is_empty() {
            return 0;
        }
        let own = self.x.len() as f64;
        let about = self.x.iter().fold([0.0; 3], |sum, x| crate::geometry::add_scaled(sum, 1.0 / own, *x));
        let [obstacles] = self.prescribed.positions([self.time()], about);
        let x = [&self.x[..], &obstacles].concat();
        self.exact_obstacle_crossings(&x) + self.parts_in_rounded_solids(&x)
    }

    fn exact_obstacle_crossings(&self, x: &[Vector3<f64>]) -> usize {
        let mesh = &self.obstacle_mesh;
        let counts = |Crossing { edge, triangle }: &Crossing| {
            let (edge, triangle) = (edge.map(energy_solve::index), triangle.map(energy_solve::index));
            let is_mixed = mesh.obstacle(edge[0]).is_some() || mesh.obstacle(triangle[0]).is_some();
            is_mixed && !self.exclusions.exclude(mesh, &edge, &triangle)
        };
        crossings(mesh, x).iter().filter(|crossing| counts(crossing)).count()
    }

    fn parts_in_rounded_solids(&self, x: &[Vector3<f64>]) -> usize {
        let mesh = &self.obstacle_mesh;
        let cores = self.prescribed.cores();
        let radius = |vertex: u32| mesh.obstacle(vertex).map_or(0.0, |obstacle| cores[obstacle].radius);
        let halves = (0..energy_solve::index(mesh.vertices())).map(radius).collect();
        let is_free = (0..mesh.vertices()).map(|vertex| vertex < self.x.len()).collect();
        let rules = Rules { halves, is_free, exclusions: self.exclusions.clone(), with_itself: false };
        let pairs = Search::new(mesh, x, rules).pairs_at(mesh, x);
        let is_inside = |pair: &&crate::collision::Pair| {
            let radius = mesh.obstacle_of(pair).map_or(0.0, |obstacle| cores[obstacle].radius);
            Closest::of(pair, &pair.corners(x)).distance < (1.0 - ROUNDING) * radius
        };
        pairs.iter().filter(is_inside).count()
    }
}
