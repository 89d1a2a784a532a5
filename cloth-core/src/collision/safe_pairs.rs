//! The first test of the certificate, for many pairs in lanes.

use energy_dsl::{Kernel, Lane, Level, Mask, Number, dispatch};

use super::closest::separation;
use super::{Closest, Measured, Move, Pair, PairKind};

/// Pairs of a move that may come close, with the distance that each must keep.
pub(crate) struct Doubts<'a> {
    pub step: &'a Move<'a>,
    /// All pairs, in order.
    pub pairs: &'a [Pair],
    /// All pairs at the start of the move.
    pub measured: &'a Measured,
}

impl Doubts<'_> {
    /// Returns which of some pairs, given with their levels, neither the normal at the start nor that at the end keeps
    /// apart. All others certainly keep their level during the whole move. The pairs are in order.
    pub fn of(&self, numbers: &[(usize, f64)]) -> Vec<usize> {
        let points = numbers.partition_point(|(number, _)| self.pairs[*number].kind == PairKind::PointTriangle);
        let (on_triangles, of_edges) = numbers.split_at(points);
        let mut doubtful = Vec::new();
        for (kind, numbers) in [(PairKind::PointTriangle, on_triangles), (PairKind::EdgeEdge, of_edges)] {
            dispatch(Test { doubts: self, kind, numbers, doubtful: &mut doubtful });
        }
        doubtful
    }
}

struct Test<'a> {
    doubts: &'a Doubts<'a>,
    kind: PairKind,
    numbers: &'a [(usize, f64)],
    doubtful: &'a mut Vec<usize>,
}

impl Kernel for Test<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Level>(self) {
        let Self { doubts: Doubts { step, pairs, measured }, kind, numbers, doubtful } = self;
        let lanes = L::F64::LANES;
        for numbers in numbers.chunks(lanes) {
            let (mut vertices, mut start) = ([[0; 16]; 4], [[0.0; 16]; 5]);
            for lane in 0..lanes {
                // Lanes beyond the end repeat the last pair.
                let (number, level) = numbers[lane.min(numbers.len() - 1)];
                for corner in 0..4 {
                    vertices[corner][lane] = pairs[number].vertices[corner];
                }
                let Closest { normal: [x, y, z], separation, .. } = measured.closest(number);
                for (row, value) in start.iter_mut().zip([x, y, z, separation, level]) {
                    row[lane] = value;
                }
            }
            let [p, q, r, s] = &vertices;
            let [x, y, z, apart, level] = &start;
            let normal = [L::F64::load(x), L::F64::load(y), L::F64::load(z)];
            let (apart, level) = (L::F64::load(apart), L::F64::load(level));
            let to = step.to();
            let to = [L::F64::gather(to, p), L::F64::gather(to, q), L::F64::gather(to, r), L::F64::gather(to, s)];
            let at_end = separation(&normal, &to, kind.first());
            // False for NaN.
            let mut is_safe = level.less_or_equal(apart) & level.less_or_equal(at_end);
            if !is_safe.all() {
                let end = Closest::between(kind, &to);
                let from = step.from();
                let from = [
                    L::F64::gather(from, p),
                    L::F64::gather(from, q),
                    L::F64::gather(from, r),
                    L::F64::gather(from, s),
                ];
                let at_start = separation(&end.normal, &from, kind.first());
                is_safe = is_safe | (level.less_or_equal(end.separation) & level.less_or_equal(at_start));
            }
            let bits = is_safe.bits();
            doubtful.extend((0..numbers.len()).filter(|lane| bits >> lane & 1 == 0).map(|lane| numbers[lane].0));
        }
    }
}
