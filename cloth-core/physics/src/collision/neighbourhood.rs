use energy_dsl::Vector3;

use super::displacement::{mean, mean_displacement};
use super::{CollisionMesh, Pair, Search, Separations};
use crate::geometry::{Bounds, norm, subtract};

/// All pairs that can come within reach of each other while each vertex stays in a ball, measured at the current
/// iterate.
///
/// Distances do not change if all vertices are translated, so balls move with the mean of all vertices. Late iterates
/// of a step move little and need no search. Where a few vertices leave their balls, these grow, and only the pairs of
/// these vertices are searched for.
#[derive(Clone, Debug, Default)]
pub struct Neighbourhood {
    /// The centre of each vertex's ball, relative to the mean of all vertices.
    centres: Vec<Vector3<f64>>,
    /// The radius of each ball, in m. Empty before the first search.
    radii: Vec<f64>,
    pairs: Vec<Pair>,
    separations: Separations,
}

/// Balls that grow do so by this factor beyond the vertex.
const GROWTH: f64 = 2.0;
/// The largest part of all vertices for which balls grow. If more leave their balls, a new search costs less.
const FEW: f64 = 0.2;

impl Neighbourhood {
    /// The pairs, in order.
    pub fn pairs(&self) -> &[Pair] {
        &self.pairs
    }

    /// The pairs at the place where they were last measured.
    pub fn separations(&self) -> &Separations {
        &self.separations
    }

    /// Forgets all pairs, so that the next ones depend on the state alone.
    pub fn clear(&mut self) {
        self.radii.clear();
        self.pairs.clear();
        self.separations.clear();
    }

    /// Measures the pairs at x.
    pub fn visit(&mut self, search: &Search, x: &[Vector3<f64>]) {
        self.separations.measure(&self.pairs, x, search.halves(), search.threads);
    }

    /// Finds the pairs in new balls around `centres`, and measures them at x, which these balls cover.
    pub fn renew(
        &mut self,
        search: &mut Search,
        mesh: &CollisionMesh,
        x: &[Vector3<f64>],
        centres: &[Vector3<f64>],
        radii: Vec<f64>,
    ) {
        let mean = mean(centres);
        self.centres = centres.iter().map(|centre| subtract(*centre, mean)).collect();
        self.radii = radii;
        self.pairs = search.pairs(mesh, self.balls());
        self.keep_near(search, x);
    }

    /// Makes the balls cover x, if they lack few vertices. Balls are convex: if they cover both ends of a straight
    /// move, they cover the whole move. Returns whether x is covered, and how many searches that took.
    pub fn cover(&mut self, search: &mut Search, mesh: &CollisionMesh, x: &[Vector3<f64>]) -> (bool, u64) {
        if self.radii.len() != x.len() {
            return (false, 0);
        }
        let away = self.away(x);
        let is_outside: Vec<bool> = away.iter().zip(&self.radii).map(|(away, radius)| away > radius).collect();
        let outside = is_outside.iter().filter(|outside| **outside).count();
        if outside == 0 {
            return (true, 0);
        }
        if outside as f64 > FEW * x.len() as f64 {
            return (false, 0);
        }
        for vertex in (0..x.len()).filter(|&vertex| is_outside[vertex]) {
            self.radii[vertex] = GROWTH * away[vertex];
        }
        let known = std::mem::take(&mut self.pairs);
        self.pairs = search.pairs_with(&is_outside, mesh, self.balls());
        self.keep_near(search, x);
        self.pairs.extend(known);
        // Two runs in order are merged in linear time.
        self.pairs.sort();
        self.pairs.dedup();
        self.separations.clear();
        (true, 1)
    }

    /// The distance of each vertex from the centre of its ball, in m.
    fn away(&self, x: &[Vector3<f64>]) -> Vec<f64> {
        let mean = mean(x);
        x.iter().zip(&self.centres).map(|(x, centre)| norm(subtract(subtract(*x, mean), *centre))).collect()
    }

    fn balls(&self) -> Vec<Bounds> {
        let ball = |(centre, radius): (&Vector3<f64>, &f64)| Bounds::of(&[*centre]).extended(*radius);
        self.centres.iter().zip(&self.radii).map(ball).collect()
    }

    /// Measures the pairs at x, and drops those that cannot come within reach: boxes of tilted features meet long
    /// before the features do.
    fn keep_near(&mut self, search: &Search, x: &[Vector3<f64>]) {
        self.separations.clear();
        self.visit(search, x);
        let farthest: Vec<f64> = self.away(x).iter().zip(&self.radii).map(|(away, radius)| away + radius).collect();
        let is_near = |(pair, separation): (&Pair, &f64)| separation - pair.approach(&farthest) <= search.reach(pair);
        let is_kept: Vec<bool> = self.pairs.iter().zip(self.separations.all()).map(is_near).collect();
        self.separations.retain(&is_kept);
        let mut kept = is_kept.into_iter();
        self.pairs.retain(|_| kept.next().expect("one for each pair"));
    }
}

/// Returns the boxes that the vertices sweep on a straight move, up to the mean displacement.
pub fn swept(from: &[Vector3<f64>], to: &[Vector3<f64>]) -> Vec<Bounds> {
    let mean = mean_displacement(from, to);
    from.iter().zip(to).map(|(from, to)| Bounds::of(&[*from, subtract(*to, mean)])).collect()
}
