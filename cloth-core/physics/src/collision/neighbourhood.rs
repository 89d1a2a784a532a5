use energy_dsl::Vector3;

use super::displacement::mean;
use super::{CollisionMesh, Nearby, Search};
use crate::geometry::{Bounds, norm, subtract};

/// All pairs that can come within reach of each other while each vertex stays in a ball, measured at the current
/// iterate.
///
/// Distances do not change if all vertices are translated, so balls move with the mean of all vertices. Late iterates
/// of a step move little and need no search. If a move takes vertices out of their balls, one search finds the pairs
/// that these vertices meet on the way and near its end: the new balls of the next iterate need no other.
#[derive(Clone, Debug, Default)]
pub struct Neighbourhood {
    /// The centre of each vertex's ball, relative to the mean of all vertices.
    centres: Vec<Vector3<f64>>,
    /// The radius of each ball, in m. Empty before the first search.
    radii: Vec<f64>,
    nearby: Nearby,
    strays: Strays,
}

/// The vertices that left their balls on the last such move, and their pairs.
#[derive(Clone, Debug, Default)]
struct Strays {
    /// The box around the path of each stray vertex, relative to the mean of all vertices; empty for the others.
    paths: Vec<Bounds>,
    /// Distance from their paths that was searched, in m. The radii of new balls.
    radii: Vec<f64>,
    nearby: Nearby,
}

/// The largest part of all vertices whose pairs are searched for alone. If more leave their balls, a search for all
/// pairs costs less.
const FEW: f64 = 0.2;
/// Bound of the distance of a vertex from its path by rounding, relative to the distance that is searched.
const ROUNDING: f64 = 1e-6;

impl Neighbourhood {
    /// The pairs of vertices in their balls.
    pub fn nearby(&self) -> &Nearby {
        &self.nearby
    }

    /// The pairs of the vertices that left their balls on the last such move.
    pub fn strays(&self) -> &Nearby {
        &self.strays.nearby
    }

    /// Forgets all pairs, so that the next ones depend on the state alone.
    pub fn clear(&mut self) {
        *self = Self::default();
    }

    /// Measures all pairs at x, unless they have been measured there.
    pub fn visit(&mut self, search: &Search, x: &[Vector3<f64>]) {
        self.nearby.visit(search, x);
        self.strays.nearby.visit(search, x);
    }

    /// Finds the pairs of the vertices that leave their balls on a straight move, up to a distance from their paths.
    /// Returns whether there are such vertices. If they are many, all vertices count as strays, and no others are known.
    pub fn follow(
        &mut self,
        search: &mut Search,
        mesh: &CollisionMesh,
        ends: [&[Vector3<f64>]; 2],
        radii: impl Fn() -> Vec<f64>,
    ) -> bool {
        // Balls are convex: if they cover both ends of a straight move, they cover the whole move.
        let [from, to] = ends.map(|x| self.lacks(x));
        let is_stray: Vec<bool> = from.iter().zip(to).map(|(from, to)| from | to).collect();
        let count = is_stray.iter().filter(|stray| **stray).count();
        if count == 0 {
            return false;
        }
        let radii = radii();
        let means = ends.map(mean);
        let path = |vertex: usize| Bounds::of(&[0, 1].map(|end| subtract(ends[end][vertex], means[end])));
        let vertices = 0..is_stray.len();
        if count as f64 > FEW * vertices.len() as f64 {
            self.clear();
            let paths: Vec<Bounds> = vertices.map(path).collect();
            let regions = paths.iter().zip(&radii).map(|(path, radius)| path.extended(*radius)).collect();
            self.strays = Strays { paths, radii, nearby: Nearby::new(search.pairs(mesh, regions)) };
        } else {
            let (mut paths, mut regions) = (vec![Bounds::EMPTY; vertices.len()], self.balls());
            for vertex in vertices.filter(|&vertex| is_stray[vertex]) {
                paths[vertex] = path(vertex);
                regions[vertex] = regions[vertex].around(paths[vertex].extended(radii[vertex]));
            }
            self.strays = Strays { paths, radii, nearby: Nearby::new(search.pairs_with(&is_stray, mesh, &regions)) };
        }
        true
    }

    /// Whether all pairs near x are known: each vertex is in its ball, or on its path on the last move that left balls.
    pub fn knows(&self, x: &[Vector3<f64>]) -> bool {
        let (lacks, mean) = (self.lacks(x), mean(x));
        let Strays { paths, radii, .. } = &self.strays;
        // Rounding takes points off their paths.
        let is_on_path = |vertex: usize| {
            let square = paths[vertex].distance_squared(subtract(x[vertex], mean));
            square <= (ROUNDING * radii[vertex]).powi(2)
        };
        (0..x.len()).all(|vertex| !lacks[vertex] || !paths.is_empty() && is_on_path(vertex))
    }

    /// Puts new balls around the vertices that are outside of theirs at x, a place whose pairs are known.
    pub fn settle(&mut self, search: &Search, x: &[Vector3<f64>]) {
        let lacks = self.lacks(x);
        if !lacks.contains(&true) {
            return;
        }
        let mean = mean(x);
        self.centres.resize(x.len(), [0.0; 3]);
        self.radii.resize(x.len(), 0.0);
        for vertex in (0..x.len()).filter(|&vertex| lacks[vertex]) {
            self.centres[vertex] = subtract(x[vertex], mean);
            self.radii[vertex] = self.strays.radii[vertex];
        }
        let farthest: Vec<f64> = self.away(x).iter().zip(&self.radii).map(|(away, radius)| away + radius).collect();
        let Strays { nearby: mut found, .. } = std::mem::take(&mut self.strays);
        found.keep_near(search, x, &farthest);
        self.nearby = found.joined_with(std::mem::take(&mut self.nearby));
    }

    /// Whether each vertex is outside of its ball.
    fn lacks(&self, x: &[Vector3<f64>]) -> Vec<bool> {
        if self.radii.is_empty() {
            return vec![true; x.len()];
        }
        self.away(x).iter().zip(&self.radii).map(|(away, radius)| away > radius).collect()
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
}
