use energy_dsl::{Kernel, Lane, Level, Vector3, dispatch};

use super::closest::corners;
use super::{Closest, Pair, PairKind};

/// The closest points of many pairs at one state.
#[derive(Clone, Debug, Default)]
pub struct Measured {
    /// The positions where pairs were measured; empty before that.
    x: Vec<Vector3<f64>>,
    /// Weights, normal and distance of each pair.
    numbers: Vec<[f64; 8]>,
    separations: Vec<f64>,
}

/// Consecutive pairs, to be measured at one state.
#[derive(Debug)]
pub struct Unmeasured<'a> {
    pairs: &'a [Pair],
    /// The positions; `None` if the pairs have been measured there.
    x: Option<&'a [Vector3<f64>]>,
    numbers: &'a mut [[f64; 8]],
    separations: &'a mut [f64],
}

/// The closest points of consecutive pairs at one state.
#[derive(Clone, Copy, Debug)]
pub struct MeasuredPart<'a> {
    /// The pairs of this part, in order.
    pub pairs: &'a [Pair],
    numbers: &'a [[f64; 8]],
    separations: &'a [f64],
}

impl Measured {
    /// Divides pairs into parts of this length, which are measured at x unless they have been. All parts must be
    /// measured. Pairs are in order, so those of one kind are consecutive.
    pub fn at<'a>(
        &'a mut self,
        pairs: &'a [Pair],
        x: &'a [Vector3<f64>],
        length: usize,
    ) -> impl Iterator<Item = Unmeasured<'a>> {
        let is_known = self.numbers.len() == pairs.len() && (pairs.is_empty() || self.x == x);
        if !is_known {
            x.clone_into(&mut self.x);
            self.numbers.resize(pairs.len(), [0.0; 8]);
            self.separations.resize(pairs.len(), 0.0);
        }
        let unmeasured_at = (!is_known).then_some(x);
        let parts = pairs.chunks(length).zip(self.numbers.chunks_mut(length)).zip(self.separations.chunks_mut(length));
        parts.map(move |((pairs, numbers), separations)| Unmeasured { pairs, x: unmeasured_at, numbers, separations })
    }

    /// Discards everything. Required if pairs change.
    pub fn clear(&mut self) {
        self.x.clear();
        self.numbers.clear();
        self.separations.clear();
    }
}

impl<'a> Unmeasured<'a> {
    /// Measures the pairs.
    pub fn measured(self) -> MeasuredPart<'a> {
        let Self { pairs, x, numbers, separations } = self;
        if let Some(x) = x {
            dispatch(Measure { pairs, x, numbers, separations });
        }
        MeasuredPart { pairs, numbers, separations }
    }
}

impl MeasuredPart<'_> {
    /// The distance of a pair, in m.
    #[inline]
    pub fn distance(&self, number: usize) -> f64 {
        self.numbers[number][7]
    }

    /// The closest points of a pair.
    #[inline]
    pub fn closest(&self, number: usize) -> Closest {
        let [c0, c1, c2, c3, nx, ny, nz, distance] = self.numbers[number];
        let separation = self.separations[number];
        Closest { weights: [c0, c1, c2, c3], normal: [nx, ny, nz], distance, separation }
    }
}

struct Measure<'a> {
    pairs: &'a [Pair],
    x: &'a [Vector3<f64>],
    numbers: &'a mut [[f64; 8]],
    separations: &'a mut [f64],
}

impl Kernel for Measure<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Level>(self) {
        let Self { pairs, x, numbers, separations } = self;
        let points = pairs.partition_point(|pair| pair.kind == PairKind::PointTriangle);
        let (of_points, of_edges) = numbers.split_at_mut(points);
        let (apart_of_points, apart_of_edges) = separations.split_at_mut(points);
        measure::<L>(PairKind::PointTriangle, &pairs[..points], x, of_points, apart_of_points);
        measure::<L>(PairKind::EdgeEdge, &pairs[points..], x, of_edges, apart_of_edges);
    }
}

/// Measures pairs of one kind.
#[inline(always)]
fn measure<L: Level>(
    kind: PairKind,
    pairs: &[Pair],
    x: &[Vector3<f64>],
    numbers: &mut [[f64; 8]],
    separations: &mut [f64],
) {
    let lanes = L::F64::LANES;
    for (start, pairs) in pairs.chunks(lanes).enumerate().map(|(chunk, pairs)| (chunk * lanes, pairs)) {
        // Lanes beyond the end repeat the last pair.
        let mut vertices = [[0; 16]; 4];
        for lane in 0..lanes {
            let pair = &pairs[lane.min(pairs.len() - 1)];
            for corner in 0..4 {
                vertices[corner][lane] = pair.vertices[corner];
            }
        }
        let Closest { weights: [a, b, c, d], normal: [nx, ny, nz], distance, separation } =
            Closest::between(kind, &corners::<L>(x, &vertices));
        let rows = numbers[start..][..pairs.len()].as_flattened_mut();
        L::F64::store_transposed(&[a, b, c, d, nx, ny, nz, distance], pairs.len(), rows, 8);
        separation.store_ragged(&mut separations[start..][..pairs.len()]);
    }
}
