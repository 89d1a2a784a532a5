use energy_dsl::Vector3;
use energy_solve::threads::{collect, collect_each};

use super::displacement::mean;
use super::{Candidates, CollisionMesh, Move, MovingBalls, Pair, Search};
use crate::geometry::{Bounds, MovingBounds, add_scaled, dot, norm, subtract};

/// All pairs that can come within reach of each other while each vertex stays in a ball, measured at the current
/// iterate.
///
/// Distances do not change if all vertices are translated, so balls move with the mean of all vertices, unless only
/// some vertices may move. Late iterates of a step move little and need no search. If vertices escape from their balls
/// on a move, one search finds the pairs that these vertices come near on the way and at its end. The next iterate then
/// needs no further search.
#[derive(Clone, Debug, Default)]
pub struct Neighbourhood {
    /// The centre of each vertex's ball, relative to the origin of all.
    centres: Vec<Vector3<f64>>,
    /// The radius of each ball, in m. Empty before the first search.
    radii: Vec<f64>,
    candidates: Candidates,
    escape: Escape,
    /// Whether the last search for all pairs was in an earlier step.
    is_old: bool,
    /// The mean of all vertices where balls were last refitted.
    mean: Vector3<f64>,
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
    /// The pairs before the restriction; those without a moving vertex stay valid.
    candidates: Candidates,
}

/// The vertices that escaped from their balls on the last such move, and their pairs.
#[derive(Clone, Debug, Default)]
struct Escape {
    /// All vertices at the start and at the end of the move, relative to the origin of balls. Empty before the first
    /// such move.
    ends: [Vec<Vector3<f64>>; 2],
    has_escaped: Vec<bool>,
    /// The distance from their paths that was searched, in m. The radii of new balls.
    radii: Vec<f64>,
    candidates: Candidates,
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
    pub fn candidates(&self) -> &Candidates {
        &self.candidates
    }

    /// The pairs of the vertices that escaped from their balls on the last such move.
    pub fn escaped(&self) -> &Candidates {
        &self.escape.candidates
    }

    /// Forgets all pairs, so that the next ones depend on the state alone.
    #[cfg(test)]
    pub fn clear(&mut self) {
        *self = Self::default();
    }

    /// Keeps the pairs of the last step until a vertex escapes from its ball. Then a search for all pairs replaces
    /// them, as in a run that resumes from a checkpoint.
    pub fn begin_step(&mut self) {
        self.escape = Escape::default();
        self.is_old = true;
    }

    /// Measures all pairs at x, unless they have been measured there.
    pub fn measure(&mut self, search: &Search, x: &[Vector3<f64>]) {
        self.candidates.measure(search, x);
        self.escape.candidates.measure(search, x);
    }

    /// Finds the pairs of the vertices that escape from their balls on a straight move, up to a radius from their
    /// paths. Returns whether there are such vertices. If there are many, if nothing is near, or if balls are those of
    /// an earlier step, all vertices count as escaped, and no other pairs remain. The search may choose other radii
    /// within the `limits`; see [`Search::pairs_near`].
    pub fn search_along(
        &mut self,
        search: &mut Search,
        mesh: &CollisionMesh,
        step: &Move<'_>,
        radius: impl Fn(usize) -> f64 + Sync,
        limits: [f64; 2],
    ) -> bool {
        let (ends, origins) = ([step.from, step.to], step.means.map(|mean| self.origin(mean)));
        let threads = search.threads;
        let mut has_escaped = self.escaping(ends, origins, threads);
        let count = has_escaped.iter().filter(|has_escaped| **has_escaped).count();
        if count == 0 {
            return false;
        }
        let wanted = collect_each(threads, has_escaped.len(), VERTICES, radius);
        let ends = [0, 1].map(|end| {
            collect_each(threads, has_escaped.len(), VERTICES, |vertex| subtract(ends[end][vertex], origins[end]))
        });
        let paths = MovingBalls { ends: [&ends[0], &ends[1]], radii: &wanted };
        let are_many = count as f64 > FEW * has_escaped.len() as f64 || self.is_clear() || self.is_old;
        let (pairs, radii) = if self.fixed.is_none() && are_many {
            *self = Self { offset: self.offset, ..Self::default() };
            has_escaped.fill(true);
            search.pairs_near(mesh, &paths, limits)
        } else if search.is_unfitted() {
            (self.search_around(search, mesh, &paths, &has_escaped), wanted)
        } else {
            let region = |vertex: usize| {
                let ball = Bounds::of(&[self.centres[vertex]]).extended(self.radii[vertex]);
                // The region of an escaped vertex must cover the old ball and the new one, wherever on the path that
                // will be.
                let [start, end] = paths.bounds(vertex).0;
                MovingBounds::fixed(if has_escaped[vertex] { ball.around(start).around(end) } else { ball })
            };
            (search.pairs_with(&has_escaped, mesh, region), wanted)
        };
        self.escape = Escape { ends, has_escaped, radii, candidates: Candidates::new(pairs) };
        true
    }

    /// Whether nothing is near anything.
    fn is_clear(&self) -> bool {
        self.candidates.pairs().is_empty()
    }

    /// Returns the pairs of escaped vertices while these are in their old balls or within their radius from their
    /// paths.
    fn search_around(
        &self,
        search: &mut Search,
        mesh: &CollisionMesh,
        paths: &MovingBalls<'_>,
        has_escaped: &[bool],
    ) -> Vec<Pair> {
        let mut ends = [self.centres.clone(), self.centres.clone()];
        let mut radii = self.radii.clone();
        for vertex in (0..has_escaped.len()).filter(|&vertex| has_escaped[vertex]) {
            for (end, path) in ends.iter_mut().zip(paths.ends) {
                end[vertex] = path[vertex];
                let old = self.radii[vertex] + norm(subtract(path[vertex], self.centres[vertex]));
                radii[vertex] = old.max(paths.radii[vertex]).max(radii[vertex]);
            }
        }
        search.pairs_around(mesh, &MovingBalls { ends: [&ends[0], &ends[1]], radii: &radii }, has_escaped)
    }

    /// Whether the candidates include all pairs near x: each vertex is in its ball or has escaped, and all escaped ones
    /// are at one instant of the move.
    pub fn covers(&self, x: &[Vector3<f64>]) -> bool {
        let origin = self.origin(mean(x));
        self.covers_escaped(x, origin, &self.outside(x, origin, 1))
    }

    /// Whether the candidates include all pairs near x if these vertices are outside of their balls.
    fn covers_escaped(&self, x: &[Vector3<f64>], origin: Vector3<f64>, outside: &[usize]) -> bool {
        let Escape { ends: [start, end], has_escaped, radii, .. } = &self.escape;
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
            has_escaped[vertex] && away <= ROUNDING * radii[vertex]
        })
    }

    /// Refits the balls of vertices that escaped from theirs to x, and drops the move that led there. Returns `false`,
    /// and does nothing, if the candidates do not include all pairs near x.
    pub fn refit(&mut self, search: &Search, x: &[Vector3<f64>]) -> bool {
        let mean = mean(x);
        let origin = self.origin(mean);
        let outside = self.outside(x, origin, search.threads);
        if !self.covers_escaped(x, origin, &outside) {
            return false;
        }
        self.mean = mean;
        let Escape { radii, candidates: mut found, .. } = std::mem::take(&mut self.escape);
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
        self.candidates.measure(search, x);
        self.candidates = found.joined_with(&self.candidates, search.threads);
        true
    }

    /// Lets only some vertices move, from where balls were last refitted, and puts the pairs of others aside.
    pub fn restrict(&mut self, moving: &[bool], threads: usize) {
        let chosen = self.candidates.with_any(moving, threads);
        let candidates = std::mem::replace(&mut self.candidates, chosen);
        self.fixed = Some(Fixed { origin: self.origin(self.mean), moving: moving.to_vec(), candidates });
    }

    /// Whether only some vertices move.
    pub fn is_restricted(&self) -> bool {
        self.fixed.is_some()
    }

    /// Lets all vertices move again, from where balls were last refitted. Balls stay where they are, relative to their
    /// origin too: searches that look at some vertices only rely on the regions of the others.
    pub fn release(&mut self, threads: usize) {
        let Some(Fixed { origin, moving, candidates }) = self.fixed.take() else { return };
        self.offset = subtract(origin, self.mean);
        self.escape = Escape::default();
        self.candidates = std::mem::take(&mut self.candidates).joined_with_others(&candidates, &moving, threads);
    }

    /// Whether each vertex is outside of its ball at an end of a move. Balls are convex: if they cover both ends of a
    /// straight move, they cover the whole move.
    fn escaping(&self, [from, to]: [&[Vector3<f64>]; 2], origins: [Vector3<f64>; 2], threads: usize) -> Vec<bool> {
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

    /// The origin from which balls see positions, if this is the mean of all vertices.
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
