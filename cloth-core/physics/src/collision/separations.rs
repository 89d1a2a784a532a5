use energy_dsl::{Kernel, Lane, Level, Mask, Number, Vector3, dispatch};
use energy_solve::threads::for_each;

use super::closest::corners;
use super::{Closest, Pair, PairKind};

/// Pairs that one thread takes at a time. A multiple of the number of lanes.
pub const PART: usize = 4096;

/// How far many pairs are apart at one place, with the closest points of those within reach. Most pairs are not, so
/// little memory is moved.
#[derive(Clone, Debug, Default)]
pub struct Separations {
    /// The place; empty if nothing has been measured.
    place: Vec<Vector3<f64>>,
    separations: Vec<f64>,
    near: Vec<Near>,
}

/// A pair within reach.
#[derive(Clone, Copy, Debug)]
pub struct Near {
    /// Its number among all pairs.
    pub number: usize,
    /// Its closest points.
    pub closest: Closest,
}

impl Separations {
    /// Measures pairs at x, unless they have been measured there. Pairs are in order, so those of one kind are
    /// consecutive. `halves` has half the reach at each vertex, in m.
    pub fn measure(&mut self, pairs: &[Pair], x: &[Vector3<f64>], halves: &[f64], threads: usize) {
        if self.separations.len() == pairs.len() && self.place == x {
            return;
        }
        x.clone_into(&mut self.place);
        self.separations.resize(pairs.len(), 0.0);
        let points = pairs.partition_point(|pair| pair.kind == PairKind::PointTriangle);
        let (on_triangles, of_edges) = pairs.split_at(points);
        let (apart_on_triangles, apart_of_edges) = self.separations.split_at_mut(points);
        let all = parts(PairKind::PointTriangle, 0, on_triangles, apart_on_triangles).chain(parts(
            PairKind::EdgeEdge,
            points,
            of_edges,
            apart_of_edges,
        ));
        self.near = for_each(threads, all.collect(), |part| dispatch(Measure { part, x, halves })).concat();
    }

    /// Discards everything. Required if pairs change.
    pub fn clear(&mut self) {
        self.place.clear();
        self.separations.clear();
        self.near.clear();
    }

    /// A lower bound of the distance of each pair; see [`Closest::separation`].
    pub fn all(&self) -> &[f64] {
        &self.separations
    }

    /// The pairs within reach, in order.
    pub fn near(&self) -> &[Near] {
        &self.near
    }

    /// Keeps some of the pairs.
    pub fn retain(&mut self, is_kept: &[bool]) {
        let mut kept = is_kept.iter();
        self.separations.retain(|_| *kept.next().expect("one for each pair"));
        let (mut passed, mut place) = (0, 0);
        self.near.retain_mut(|near| {
            place += is_kept[passed..near.number].iter().filter(|kept| **kept).count();
            passed = near.number;
            near.number = place;
            is_kept[passed]
        });
    }
}

/// Consecutive pairs of one kind.
struct Part<'a> {
    kind: PairKind,
    /// The number of the first.
    first: usize,
    pairs: &'a [Pair],
    separations: &'a mut [f64],
}

fn parts<'a>(
    kind: PairKind,
    first: usize,
    pairs: &'a [Pair],
    separations: &'a mut [f64],
) -> impl Iterator<Item = Part<'a>> {
    let parts = pairs.chunks(PART).zip(separations.chunks_mut(PART)).enumerate();
    parts.map(move |(number, (pairs, separations))| Part { kind, first: first + number * PART, pairs, separations })
}

struct Measure<'a> {
    part: Part<'a>,
    x: &'a [Vector3<f64>],
    halves: &'a [f64],
}

impl Kernel for Measure<'_> {
    type Output = Vec<Near>;

    #[inline(always)]
    fn run<L: Level>(self) -> Vec<Near> {
        let Self { part: Part { kind, first, pairs, separations }, x, halves } = self;
        let lanes = L::F64::LANES;
        let mut near = Vec::with_capacity(pairs.len() / 4);
        let chunks = pairs.chunks(lanes).zip(separations.chunks_mut(lanes));
        for (start, (pairs, separations)) in chunks.enumerate().map(|(chunk, parts)| (first + chunk * lanes, parts)) {
            let (mut vertices, mut reach) = ([[0; 16]; 4], [0.0; 16]);
            for lane in 0..lanes {
                // Lanes beyond the end repeat the last pair.
                let pair = &pairs[lane.min(pairs.len() - 1)];
                for corner in 0..4 {
                    vertices[corner][lane] = pair.vertices[corner];
                }
                reach[lane] = halves[pair.vertices[0] as usize] + halves[pair.vertices[kind.first()] as usize];
            }
            let closest = Closest::between(kind, &corners::<L>(x, &vertices));
            closest.separation.store_ragged(separations);
            let mut within = closest.separation.less_or_equal(L::F64::load(&reach)).bits();
            within &= u32::MAX >> (32 - pairs.len());
            if within == 0 {
                continue;
            }
            let Closest { weights: [a, b, c, d], normal: [nx, ny, nz], distance, .. } = closest;
            let mut rows = [[0.0; 8]; 16];
            let numbers = [a, b, c, d, nx, ny, nz, distance];
            L::F64::store_transposed(&numbers, pairs.len(), rows.as_flattened_mut(), 8);
            while within != 0 {
                let lane = within.trailing_zeros() as usize;
                within &= within - 1;
                let [a, b, c, d, nx, ny, nz, distance] = rows[lane];
                let (weights, normal, separation) = ([a, b, c, d], [nx, ny, nz], separations[lane]);
                near.push(Near { number: start + lane, closest: Closest { weights, normal, distance, separation } });
            }
        }
        near
    }
}
