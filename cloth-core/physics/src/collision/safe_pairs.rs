//! The first test of the certificate, for many pairs in lanes.

use energy_dsl::{Kernel, Lane, Level, Mask, Number, dispatch};

use super::closest::{corners, separation};
use super::{Clearance, Closest, Move, Pair, PairKind};

impl Move<'_> {
    /// Returns which of some pairs, given by number and clearance, neither the normal at the start nor that at the end
    /// keeps apart. All others certainly keep their clearance during the whole move. `pairs` are in order, as are the
    /// numbers.
    pub fn doubtful(&self, pairs: &[Pair], numbers: &[(usize, Clearance)]) -> Vec<usize> {
        let points = numbers.partition_point(|(number, _)| pairs[*number].kind == PairKind::PointTriangle);
        let (on_triangles, of_edges) = numbers.split_at(points);
        let mut doubtful = Vec::new();
        for (kind, numbers) in [(PairKind::PointTriangle, on_triangles), (PairKind::EdgeEdge, of_edges)] {
            dispatch(Test { step: self, pairs, kind, numbers, doubtful: &mut doubtful });
        }
        doubtful
    }
}

/// Tests pairs of one kind.
struct Test<'a> {
    step: &'a Move<'a>,
    pairs: &'a [Pair],
    kind: PairKind,
    numbers: &'a [(usize, Clearance)],
    doubtful: &'a mut Vec<usize>,
}

impl Kernel for Test<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Level>(self) {
        let Self { step, pairs, kind, numbers, doubtful } = self;
        let lanes = L::F64::LANES;
        for numbers in numbers.chunks(lanes) {
            let (mut vertices, mut thickness, mut reach) = ([[0; 16]; 4], [0.0; 16], [0.0; 16]);
            for lane in 0..lanes {
                // Lanes beyond the end repeat the last pair.
                let (number, clearance) = numbers[lane.min(numbers.len() - 1)];
                for corner in 0..4 {
                    vertices[corner][lane] = pairs[number].vertices[corner];
                }
                (thickness[lane], reach[lane]) = (clearance.thickness, clearance.reach);
            }
            let (thickness, reach) = (L::F64::load(&thickness), L::F64::load(&reach));
            let [from, to] = [corners::<L>(step.from, &vertices), corners::<L>(step.to, &vertices)];
            let start = Closest::between(kind, &from);
            let level = step.level(start.distance, thickness, reach);
            let at_end = separation(&start.normal, &to, kind.first());
            // False for NaN.
            let mut is_safe = level.less_or_equal(start.separation) & level.less_or_equal(at_end);
            if !is_safe.all() {
                let end = Closest::between(kind, &to);
                let at_start = separation(&end.normal, &from, kind.first());
                is_safe = is_safe | (level.less_or_equal(end.separation) & level.less_or_equal(at_start));
            }
            let bits = is_safe.bits();
            doubtful.extend((0..numbers.len()).filter(|lane| bits >> lane & 1 == 0).map(|lane| numbers[lane].0));
        }
    }
}
