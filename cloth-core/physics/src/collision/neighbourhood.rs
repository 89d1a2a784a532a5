use energy_dsl::Vector3;
use energy_solve::threads::{collect, collect_each};

use super::displacement::mean;
use super::{CollisionMesh, Move, MovingBalls, Nearby, Pair, Search};
use crate::geometry::{Bounds, MovingBounds, add_scaled, dot, norm, subtract};

/// All pairs that can come within reach of each other while each vertex stays in a ball, measured at the current
/// iterate.
///
/// Distances do not change if all vertices are translated, so balls move with the mean of all vertices, unless only
/// some vertices may move. Late iterates of a step move little and need no search. If a move takes vertices out of
/// their balls, one search finds the pairs that these vertices meet on the way and near its end. The next iterate then
/// needs no further search.
#[derive(Clone, Debug, Default)]
pub struct Neighbourhood {
    /// The centre of each vertex's ball, relative to the origin of all.
    centres: Vec<Vector3<f64>>,
    /// The radius of each ball, in m. Empty before the first search.
    radii: Vec<f64>,
    nearby: Nearby,
    strays: Strays,
    /// Whether the last search for all pairs was in an earlier step.
    is_old: bool,
    /// The mean of all vertices where balls were last settled.
    settled: Vector3<f64>,
    /// The origin of all balls, relative to the mean of all vertices.
    offset: Vector3<f64>,
    fixed: Option<Fixed>,
}

/// The neighbourhood of all vertices, while only some of them move.
#[derive(Clone, Debug)]
struct Fixed {
    /// The origin of all balls: those of other vertices must not move either.
    origin: Vector3<f64>,
    /// Whether each vertex moves.
    moving: Vec<bool>,
    /// The pairs before. Where no vertex moves, they stay as they are.
    nearby: Nearby,
}

/// The vertices that left their balls on the last such move, and their pairs.
#[derive(Clone, Debug, Default)]
struct Strays {
    /// All vertices at the start and at the end of the move, relative to the origin of balls. Empty before the first
    /// such move.
    ends: [Vec<Vector3<f64>>; 2],
    is_stray: Vec<bool>,
    /// The distance from their paths that was searched, in m. The radii of new balls.
    radii: Vec<f64>,
    nearby: Nearby,
}

/// The largest part of all vertices whose pairs are searched for alone. If more leave their balls, a search for all
/// pairs costs less.
const FEW: f64 = 0.2;
/// Vertices that a thread takes at a time.
const VERTICES: usize = 2048;
/// Bound of the distance by which rounding takes a vertex off its path, relative to the distance that is searched.
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
    #[cfg(test)]
    pub fn clear(&mut self) {
        *self = Self::default();
    }

    /// Keeps the pairs of the last step until a vertex leaves its ball. Then a search for all pairs replaces them, as
    /// in a run that resumes from a checkpoint.
    pub fn begin_step(&mut self) {
        self.strays = Strays::default();
        self.is_old = true;
    }

    /// Measures all pairs at x, unless they have been measured there.
    pub fn visit(&mut self, search: &Search, x: &[Vector3<f64>]) {
        self.nearby.visit(search, x);
        self.strays.nearby.visit(search, x);
    }

    /// Finds the pairs of the vertices that leave their balls on a straight move, up to a radius from their paths.
    /// Returns whether there are such vertices. If there are many, if nothing is near, or if balls are those of an
    /// earlier step, all vertices count as strays, and no other pairs are known. The search may choose other radii
    /// within the `limits`; see [`Search::pairs_near`].
    pub fn follow(
        &mut self,
        search: &mut Search,
        mesh: &CollisionMesh,
        step: &Move<'_>,
        radius: impl Fn(usize) -> f64 + Sync,
        limits: [f64; 2],
    ) -> bool {
        let (ends, origins) = ([step.from(), step.to()], step.means().map(|mean| self.origin(mean)));
        let threads = search.threads;
        let mut is_stray = self.leaving(ends, origins, threads);
        let count = is_stray.iter().filter(|stray| **stray).count();
        if count == 0 {
            return false;
        }
        let wanted = collect_each(threads, is_stray.len(), VERTICES, radius);
        let ends = [0, 1].map(|end| {
            collect_each(threads, is_stray.len(), VERTICES, |vertex| subtract(ends[end][vertex], origins[end]))
        });
        let paths = MovingBalls { ends: [&ends[0], &ends[1]], radii: &wanted };
        let are_many = count as f64 > FEW * is_stray.len() as f64 || self.is_clear() || self.is_old;
        let (pairs, radii) = if self.fixed.is_none() && are_many {
            *self = Self { offset: self.offset, ..Self::default() };
            is_stray.fill(true);
            search.pairs_near(mesh, &paths, limits)
        } else if search.is_unfitted() {
            (self.search_around(search, mesh, &paths, &is_stray), wanted)
        } else {
            let region = |vertex: usize| {
                let ball = Bounds::of(&[self.centres[vertex]]).extended(self.radii[vertex]);
                // The region of a stray must cover the old ball and the new one, wherever on the path that will be.
                let [start, end] = paths.bounds(vertex).0;
                MovingBounds::fixed(if is_stray[vertex] { ball.around(start).around(end) } else { ball })
            };
            (search.pairs_with(&is_stray, mesh, region), wanted)
        };
        self.strays = Strays { ends, is_stray, radii, nearby: Nearby::new(pairs) };
        true
    }

    /// Whether nothing is near anything.
    fn is_clear(&self) -> bool {
        self.nearby.pairs().is_empty()
    }

    /// Returns the pairs of strays while these are in their old balls or within their radius from their paths.
    fn search_around(
        &self,
        search: &mut Search,
        mesh: &CollisionMesh,
        paths: &MovingBalls<'_>,
        is_stray: &[bool],
    ) -> Vec<Pair> {
        let mut ends = [self.centres.clone(), self.centres.clone()];
        let mut radii = self.radii.clone();
        for vertex in (0..is_stray.len()).filter(|&vertex| is_stray[vertex]) {
            for (end, path) in ends.iter_mut().zip(paths.ends) {
                end[vertex] = path[vertex];
                let old = self.radii[vertex] + norm(subtract(path[vertex], self.centres[vertex]));
                radii[vertex] = old.max(paths.radii[vertex]).max(radii[vertex]);
            }
        }
        search.pairs_around(mesh, &MovingBalls { ends: [&ends[0], &ends[1]], radii: &radii }, is_stray)
    }

    /// Whether all pairs near x are known: each vertex is in its ball or a stray, and all strays are at one instant of
    /// the move.
    pub fn knows(&self, x: &[Vector3<f64>]) -> bool {
        let origin = self.origin(mean(x));
        self.knows_strays(x, origin, &self.outside(x, origin, 1))
    }

    /// Whether all pairs near x are known if these vertices are outside of their balls.
    fn knows_strays(&self, x: &[Vector3<f64>], origin: Vector3<f64>, outside: &[usize]) -> bool {
        let Strays { ends: [start, end], is_stray, radii, .. } = &self.strays;
        if outside.is_empty() || start.is_empty() {
            return outside.is_empty();
        }
        let path = |vertex: usize| subtract(end[vertex], start[vertex]);
        let gone = |vertex: usize| subtract(subtract(x[vertex], origin), start[vertex]);
        let farthest = outside.iter().copied().max_by(|a, b| norm(path(*a)).total_cmp(&norm(path(*b))));
        let part = farthest.map_or(0.0, |vertex| {
            let (path, gone) = (path(vertex), gone(vertex));
            if path == [0.0; 3] { 0.0 } else { (dot(gone, path) / dot(path, path)).clamp(0.0, 1.0) }
        });
        outside.iter().all(|&vertex| {
            let away = norm(add_scaled(gone(vertex), -part, path(vertex)));
            is_stray[vertex] && away <= ROUNDING * radii[vertex]
        })
    }

    /// Puts new balls around the vertices that are outside of theirs at x, and forgets the move that led there. Returns
    /// `false`, and does nothing, if some pairs near x are not known.
    pub fn settle(&mut self, search: &Search, x: &[Vector3<f64>]) -> bool {
        let mean = mean(x);
        let origin = self.origin(mean);
        let outside = self.outside(x, origin, search.threads);
        if !self.knows_strays(x, origin, &outside) {
            return false;
        }
        self.settled = mean;
        let Strays { radii, nearby: mut found, .. } = std::mem::take(&mut self.strays);
        if outside.is_empty() {
            return true;
        }
        self.centres.resize(x.len(), [0.0; 3]);
        self.radii.resize(x.len(), 0.0);
        for vertex in outside {
            (self.centres[vertex], self.radii[vertex]) = (subtract(x[vertex], origin), radii[vertex]);
        }
        let farthest = collect_each(search.threads, x.len(), VERTICES, |vertex| {
            norm(subtract(subtract(x[vertex], origin), self.centres[vertex])) + self.radii[vertex]
        });
        found.keep_near(search, x, &farthest);
        self.nearby.visit(search, x);
        self.nearby = found.joined_with(&self.nearby, search.threads);
        true
    }

    /// Lets only some vertices move, from where balls were last settled, and puts the pairs of others aside.
    pub fn restrict(&mut self, moving: &[bool], threads: usize) {
        let chosen = self.nearby.with_any(moving, threads);
        let nearby = std::mem::replace(&mut self.nearby, chosen);
        self.fixed = Some(Fixed { origin: self.origin(self.settled), moving: moving.to_vec(), nearby });
    }

    /// Whether only some vertices move.
    pub fn is_restricted(&self) -> bool {
        self.fixed.is_some()
    }

    /// Lets all vertices move again, from where balls were last settled. Balls stay where they are, relative to their
    /// origin too: searches that look at some vertices only rely on the regions of the others.
    pub fn release(&mut self, threads: usize) {
        let Some(Fixed { origin, moving, nearby }) = self.fixed.take() else { return };
        self.offset = subtract(origin, self.settled);
        self.strays = Strays::default();
        self.nearby = std::mem::take(&mut self.nearby).joined_with_others(&nearby, &moving, threads);
    }

    /// Whether each vertex is outside of its ball at an end of a move. Balls are convex: if they cover both ends of a
    /// straight move, they cover the whole move.
    fn leaving(&self, [from, to]: [&[Vector3<f64>]; 2], origins: [Vector3<f64>; 2], threads: usize) -> Vec<bool> {
        if self.radii.is_empty() {
            return vec![true; from.len()];
        }
        collect_each(threads, from.len(), VERTICES, |vertex| {
            self.is_outside(vertex, from, origins[0]) | self.is_outside(vertex, to, origins[1])
        })
    }

    /// The vertices outside of their balls.
    fn outside(&self, x: &[Vector3<f64>], origin: Vector3<f64>, threads: usize) -> Vec<usize> {
        if self.radii.is_empty() {
            return (0..x.len()).collect();
        }
        collect(threads, x.len(), VERTICES, |range| {
            range.filter(|vertex| self.is_outside(*vertex, x, origin)).collect()
        })
    }

    /// The place from which balls see positions, if this is the mean of all vertices.
    fn origin(&self, mean: Vector3<f64>) -> Vector3<f64> {
        self.fixed.as_ref().map_or_else(|| add_scaled(mean, 1.0, self.offset), |fixed| fixed.origin)
    }

    /// Whether a vertex is outside of its ball at some positions.
    #[inline]
    fn is_outside(&self, vertex: usize, x: &[Vector3<f64>], origin: Vector3<f64>) -> bool {
        let away = subtract(subtract(x[vertex], origin), self.centres[vertex]);
        dot(away, away) > self.radii[vertex] * self.radii[vertex]
    }
}
