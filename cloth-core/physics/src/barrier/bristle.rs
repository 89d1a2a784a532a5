//! Bristles: how far pairs in contact have slid without slipping.

use std::ops::Range;

use energy_dsl::Vector3;
use energy_solve::{ContactMemory, index};

use crate::collision::{Pair, PairKind};
use crate::geometry::{add_scaled, dot, norm};

/// The largest deflection, in m. A pair that slides farther slips.
pub(super) const LENGTH: f64 = 1e-4;
/// The cosine between the normals of two pairs with one feature in common, above which they are the same contact.
const SAME_CONTACT: f64 = 0.5;

/// The fraction by which the deflection of a slipping pair may fall short of `LENGTH`: the normal turns from step to
/// step.
const SLIPPING: f64 = 1e-3;

/// The kind of pairs of edges in names.
const EDGES: u32 = 1;

/// The deflections at the start of a step, by pair.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Bristles {
    /// Kind and features of each pair, ascending.
    names: Vec<[u32; 3]>,
    /// The normal and the deflection (in m) of each pair.
    vectors: Vec<[Vector3<f64>; 2]>,
    /// The numbers of pairs of edges, by their second edge.
    by_second_edge: Vec<u32>,
}

/// The name of a pair: its kind and its features.
fn name(pair: &Pair) -> [u32; 3] {
    let [first, second] = pair.features;
    [if pair.kind == PairKind::EdgeEdge { EDGES } else { 0 }, first, second]
}

impl Bristles {
    /// Takes the pairs in order, each with its normal and its tangential displacement, in m.
    pub fn new(pairs: impl Iterator<Item = (Pair, Vector3<f64>, Vector3<f64>)>) -> Self {
        Self::in_order(pairs.map(|(pair, normal, displacement)| (name(&pair), [normal, limited(displacement)])).unzip())
    }

    /// Returns the deflection of a pair, in m, across its normal. A point that has moved on to another triangle, or an
    /// edge to another edge, keeps its deflection. If the second edge is an obstacle's, it may touch many edges, which
    /// do not keep that of each other.
    pub fn deflection(&self, pair: &Pair, normal: Vector3<f64>, is_on_obstacle: bool) -> Vector3<f64> {
        let found = match self.names.binary_search(&name(pair)) {
            Ok(number) => Some(number),
            Err(_) => self.similar(pair, normal, is_on_obstacle),
        };
        found.map_or([0.0; 3], |number| {
            let [_, deflection] = self.vectors[number];
            add_scaled(deflection, -dot(deflection, normal), normal)
        })
    }

    /// The pair with the same point, or a common edge, and the most similar normal, if it is similar at all.
    fn similar(&self, pair: &Pair, normal: Vector3<f64>, is_on_obstacle: bool) -> Option<usize> {
        let cosine = |number: &usize| dot(self.vectors[*number][0], normal);
        let with_second = (!is_on_obstacle).then(|| self.with_second_edge(pair));
        let candidates = self.with_first_feature(pair).chain(with_second.into_iter().flatten());
        candidates.filter(|number| cosine(number) > SAME_CONTACT).max_by(|a, b| cosine(a).total_cmp(&cosine(b)))
    }

    fn with_first_feature(&self, pair: &Pair) -> Range<usize> {
        let [kind, first, _] = name(pair);
        let before = |name: &[u32; 3]| name[..2] < [kind, first][..];
        let until = |name: &[u32; 3]| name[..2] <= [kind, first][..];
        self.names.partition_point(before)..self.names.partition_point(until)
    }

    fn with_second_edge(&self, pair: &Pair) -> impl Iterator<Item = usize> {
        let second = |number: &u32| self.names[*number as usize][2];
        let [kind, _, edge] = name(pair);
        let numbers = if kind == EDGES { &self.by_second_edge[..] } else { &[] };
        let first = numbers.partition_point(|number| second(number) < edge);
        numbers[first..].iter().take_while(move |number| second(number) == edge).map(|number| *number as usize)
    }

    fn in_order((names, vectors): (Vec<[u32; 3]>, Vec<[Vector3<f64>; 2]>)) -> Self {
        let first = names.partition_point(|[kind, ..]| *kind < EDGES);
        let mut by_second_edge: Vec<u32> = (first..names.len()).map(index).collect();
        by_second_edge.sort_by_key(|number| names[*number as usize][2]);
        Self { names, vectors, by_second_edge }
    }

    /// Returns the deflections for a checkpoint.
    pub fn memory(self) -> ContactMemory {
        ContactMemory { names: self.names, vectors: self.vectors }
    }

    /// Restores the deflections of a checkpoint.
    pub fn restored(memory: ContactMemory) -> Self {
        let ContactMemory { mut names, mut vectors } = memory;
        // Those of a damaged checkpoint may have different lengths.
        let count = names.len().min(vectors.len());
        names.truncate(count);
        vectors.truncate(count);
        Self::in_order((names, vectors))
    }
}

/// Whether a bristle is bent to its full length: its pair slipped in the last step.
pub(super) fn slips(deflection: Vector3<f64>) -> bool {
    norm(deflection) >= LENGTH * (1.0 - SLIPPING)
}

/// Limits a displacement to the length of a bristle.
fn limited(displacement: Vector3<f64>) -> Vector3<f64> {
    let length = norm(displacement);
    if length > LENGTH { displacement.map(|component| LENGTH / length * component) } else { displacement }
}

#[cfg(test)]
mod tests {
    use super::*;

    const UP: Vector3<f64> = [0.0, 0.0, 1.0];

    fn pair(features: [u32; 2]) -> Pair {
        Pair { kind: PairKind::PointTriangle, features, vertices: [0; 4] }
    }

    #[test]
    fn deflections_are_short_and_lie_across_the_normal() {
        let displacements = [([3, 1], [5e-5, 0.0, 0.0]), ([3, 4], [0.0, 1.0, 0.0])];
        let bristles =
            Bristles::new(displacements.into_iter().map(|(features, displacement)| (pair(features), UP, displacement)));
        assert_eq!(bristles.deflection(&pair([3, 1]), UP, false), [5e-5, 0.0, 0.0]);
        assert_eq!(bristles.deflection(&pair([3, 4]), UP, false), [0.0, LENGTH, 0.0]);
        assert_eq!(bristles.deflection(&pair([3, 1]), [0.6, 0.0, 0.8], false)[0], 5e-5 * 0.64);
    }

    #[test]
    fn a_point_that_moves_on_keeps_its_deflection() {
        let turned = [0.6, 0.0, 0.8];
        let displacements = [([3, 1], UP, [0.0, 5e-5, 0.0]), ([3, 4], turned, [0.0, 7e-5, 0.0])];
        let bristles = Bristles::new(
            displacements.into_iter().map(|(features, normal, displacement)| (pair(features), normal, displacement)),
        );
        assert_eq!(bristles.deflection(&pair([3, 2]), UP, false), [0.0, 5e-5, 0.0]);
        assert_eq!(bristles.deflection(&pair([3, 9]), turned, false), [0.0, 7e-5, 0.0]);
        for (features, normal) in [([2, 1], UP), ([4, 1], UP), ([3, 2], [0.0, 0.0, -1.0])] {
            assert_eq!(bristles.deflection(&pair(features), normal, false), [0.0; 3]);
        }
    }

    #[test]
    fn either_edge_of_a_pair_may_move_on() {
        let pair = |features: [u32; 2]| Pair { kind: PairKind::EdgeEdge, ..pair(features) };
        let displacements = [([3, 7], UP, [0.0, 5e-5, 0.0]), ([4, 6], [0.0, 0.0, -1.0], [0.0, 7e-5, 0.0])];
        let bristles = Bristles::new(
            displacements.into_iter().map(|(features, normal, displacement)| (pair(features), normal, displacement)),
        );
        for bristles in [Bristles::restored(bristles.clone().memory()), bristles] {
            for features in [[3, 7], [3, 8], [2, 7]] {
                assert_eq!(bristles.deflection(&pair(features), UP, false), [0.0, 5e-5, 0.0], "{features:?}");
            }
            assert_eq!(bristles.deflection(&pair([3, 8]), UP, true), [0.0, 5e-5, 0.0]);
            assert_eq!(bristles.deflection(&pair([2, 7]), UP, true), [0.0; 3], "a new edge on a rail");
            for features in [[2, 6], [4, 9], [7, 9]] {
                assert_eq!(bristles.deflection(&pair(features), UP, false), [0.0; 3], "{features:?}");
            }
        }
    }
}
