use energy_dsl::{Kernel, Lane, Level, Mask, Number, Vector3, dispatch};
use energy_solve::threads::{concatenated, for_each};

use super::closest::corners;
use super::{Closest, Move, Pair, PairKind};

/// Pairs that one thread takes at a time. A multiple of the number of lanes.
pub const PART: usize = 4096;

/// The part of its distance beyond reach that a pair may lose before it is measured again.
const LOST: f64 = 0.25;

/// How far many pairs are apart at one state, with the closest points of those within reach. Most pairs are not, so
/// little memory is moved.
#[derive(Clone, Debug, Default)]
pub struct Separations {
    /// The positions where pairs were measured; empty before that.
    pub x: Vec<Vector3<f64>>,
    /// A lower bound of the distance of each pair; see [`Closest::separation`].
    pub all: Vec<f64>,
    /// The pairs within reach, in order.
    pub near: Vec<Near>,
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
    /// Measures pairs at x, unless they have been measured there. Pairs that certainly stayed out of reach since then
    /// keep a lower bound. Pairs are in order, so those of one kind are consecutive. `halves` has half the reach at
    /// each vertex, in m.
    pub fn measure(&mut self, pairs: &[Pair], x: &[Vector3<f64>], halves: &[f64], threads: usize) {
        if pairs.is_empty() {
            *self = Self::default();
            return;
        }
        let is_known = self.all.len() == pairs.len() && self.x.len() == x.len();
        if is_known && self.x == x {
            return;
        }
        let before = std::mem::replace(&mut self.x, x.to_vec());
        // A look at the whole move costs more than a few pairs do.
        let step = (is_known && pairs.len() > x.len() / 4).then(|| Move::new(&before, x));
        self.all.resize(pairs.len(), 0.0);
        let points = pairs.partition_point(|pair| pair.kind == PairKind::PointTriangle);
        let (on_triangles, of_edges) = pairs.split_at(points);
        let (apart_on_triangles, apart_of_edges) = self.all.split_at_mut(points);
        // One thread need not concatenate what it finds.
        let length = if threads <= 1 { pairs.len() } else { PART };
        let all = parts(PairKind::PointTriangle, 0, on_triangles, apart_on_triangles, length).chain(parts(
            PairKind::EdgeEdge,
            points,
            of_edges,
            apart_of_edges,
            length,
        ));
        let near = for_each(threads, all.collect(), |mut part| {
            let numbers = part.uncertain(step.as_ref(), halves);
            dispatch(Measure { part, numbers: &numbers, x, halves })
        });
        self.near = concatenated(near);
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

/// Divides pairs into parts of a length.
fn parts<'a>(
    kind: PairKind,
    first: usize,
    pairs: &'a [Pair],
    separations: &'a mut [f64],
    length: usize,
) -> impl Iterator<Item = Part<'a>> {
    let parts = pairs.chunks(length).zip(separations.chunks_mut(length)).enumerate();
    parts.map(move |(number, (pairs, separations))| Part { kind, first: first + number * length, pairs, separations })
}

impl Part<'_> {
    /// Returns the numbers, within the part, of the pairs that may have come within reach or close to it on a move.
    /// Others get a new lower bound. Without a move, all are uncertain.
    fn uncertain(&mut self, step: Option<&Move<'_>>, halves: &[f64]) -> Vec<usize> {
        let Some(step) = step else { return (0..self.pairs.len()).collect() };
        let mut uncertain = Vec::with_capacity(self.pairs.len());
        for (number, (pair, separation)) in self.pairs.iter().zip(&mut *self.separations).enumerate() {
            let (reach, least) = (pair.reach(halves), step.least_separation(pair, *separation));
            // False for NaN.
            if least - reach >= (1.0 - LOST) * (*separation - reach) {
                *separation = least;
            } else {
                uncertain.push(number);
            }
        }
        uncertain
    }
}

struct Measure<'a> {
    part: Part<'a>,
    /// The pairs to measure, by their numbers within the part.
    numbers: &'a [usize],
    x: &'a [Vector3<f64>],
    halves: &'a [f64],
}

impl Kernel for Measure<'_> {
    type Output = Vec<Near>;

    #[inline(always)]
    fn run<L: Level>(self) -> Vec<Near> {
        let Self { part: Part { kind, first, pairs, separations }, numbers, x, halves } = self;
        let lanes = L::F64::LANES;
        let mut near = Vec::with_capacity(numbers.len() / 4);
        for numbers in numbers.chunks(lanes) {
            let (mut vertices, mut within_reach, mut apart) = ([[0; 16]; 4], [0.0; 16], [0.0; 16]);
            for lane in 0..lanes {
                // Lanes beyond the end repeat the last pair.
                let pair = &pairs[numbers[lane.min(numbers.len() - 1)]];
                for corner in 0..4 {
                    vertices[corner][lane] = pair.vertices[corner];
                }
                within_reach[lane] = pair.reach(halves);
            }
            let closest = Closest::between(kind, &corners::<L>(x, &vertices));
            closest.separation.store(&mut apart);
            for (number, separation) in numbers.iter().zip(&apart) {
                separations[*number] = *separation;
            }
            let mut within = closest.separation.less_or_equal(L::F64::load(&within_reach)).bits();
            within &= u32::MAX >> (32 - numbers.len());
            if within == 0 {
                continue;
            }
            let Closest { weights: [a, b, c, d], normal: [nx, ny, nz], distance, .. } = closest;
            let mut rows = [[0.0; 8]; 16];
            let columns = [a, b, c, d, nx, ny, nz, distance];
            L::F64::store_transposed(&columns, numbers.len(), rows.as_flattened_mut(), 8);
            while within != 0 {
                let lane = within.trailing_zeros() as usize;
                within &= within - 1;
                let [a, b, c, d, nx, ny, nz, distance] = rows[lane];
                let (weights, normal, separation) = ([a, b, c, d], [nx, ny, nz], apart[lane]);
                near.push(Near {
                    number: first + numbers[lane],
                    closest: Closest { weights, normal, distance, separation },
                });
            }
        }
        near
    }
}
