//! The order in which layers of cloth lie.

use std::collections::BTreeMap;

use energy_dsl::Vector3;

use crate::collision::{Closest, CollisionMesh, Crossing, Pair, PairKind};
use crate::geometry::{cross, dot, norm, subtract};

/// Two features that face each other, with their order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Facing {
    pub pair: Pair,
    /// The coefficients of the closest points; see [`Closest::weights`].
    pub weights: [f64; 4],
    /// The unit normal from the second feature to the first, if the two lie in their order.
    pub across: Vector3<f64>,
}

/// Cosine of the angle between normals, below which neighbouring pairs say nothing about each other's order.
const SMOOTH: f64 = 0.3;
/// Sine of the angle below which edges have no common normal that says on which side they are.
const PARALLEL: f64 = 0.5;

/// Returns the close pairs that face each other, with their order. Neighbours have the same order. For each set of
/// neighbours, that order wins in which most features lie already. Small pieces, cut off by crossings, count little.
pub(super) fn sides(
    mesh: &CollisionMesh,
    x: &[Vector3<f64>],
    close: &[(Pair, Closest)],
    crossings: &[Crossing],
) -> Vec<Facing> {
    let mut facings: Vec<Facing> = close.iter().filter_map(|(pair, closest)| Facing::new(pair, closest, x)).collect();
    let mut orders = Orders::new(facings.len());
    for [one, other] in neighbours(&facings) {
        orders.join(&facings, one, other);
    }
    let sizes = pieces(mesh, crossings);
    let mut votes = vec![0.0; facings.len()];
    for (number, facing) in facings.iter().enumerate() {
        let (root, sign) = orders.root(number);
        let [first, second] = [facing.pair.vertices[0], facing.pair.vertices[facing.pair.first()]];
        let weight = sizes[first as usize].min(sizes[second as usize]);
        votes[root] += sign * weight as f64 * facing.apart(x).signum();
    }
    for (number, facing) in facings.iter_mut().enumerate() {
        let (root, sign) = orders.root(number);
        if sign * votes[root] < 0.0 {
            facing.across = facing.across.map(|component| -component);
        }
    }
    facings
}

impl Facing {
    /// Returns a pair whose closest points are inside both features; `None` otherwise. The normal has any sign.
    fn new(pair: &Pair, closest: &Closest, x: &[Vector3<f64>]) -> Option<Self> {
        let [a, b, c, d] = pair.corners(x);
        let (one, other) = match pair.kind {
            PairKind::PointTriangle => (subtract(c, b), subtract(d, b)),
            PairKind::EdgeEdge => (subtract(b, a), subtract(d, c)),
        };
        let normal = cross(one, other);
        let length = norm(normal);
        let is_inside = closest.weights.iter().all(|weight| *weight != 0.0);
        // False for NaN.
        let has_normal = length > PARALLEL * norm(one) * norm(other);
        let across = normal.map(|component| component / length);
        (is_inside && has_normal).then_some(Self { pair: *pair, weights: closest.weights, across })
    }

    /// How far the first feature is from the second along the normal, in m; negative on its other side.
    fn apart(&self, x: &[Vector3<f64>]) -> f64 {
        super::separation(&self.pair, &self.weights, &self.across, x)
    }

    /// Each vertex of the first feature with each of the second. The smaller comes first; the last entry tells if they
    /// were swapped.
    fn keys(&self) -> impl Iterator<Item = ([u32; 2], bool)> + use<> {
        let (vertices, first) = (self.pair.vertices, self.pair.first());
        let all = (0..first).flat_map(move |a| (first..4).map(move |b| [vertices[a], vertices[b]]));
        all.map(|[a, b]| ([a.min(b), a.max(b)], a > b))
    }
}

/// Returns pairs of facings with a common vertex on both sides.
fn neighbours(facings: &[Facing]) -> Vec<[usize; 2]> {
    let mut at: BTreeMap<[u32; 2], usize> = BTreeMap::new();
    let mut found = Vec::new();
    for (number, facing) in facings.iter().enumerate() {
        for (key, _) in facing.keys() {
            // Those that share a key form a chain.
            found.extend(at.insert(key, number).map(|before| [before, number]));
        }
    }
    found
}

/// Whether two facings that are neighbours have the same order: 1, −1, or 0 for a sharp bend.
fn relation(one: &Facing, other: &Facing) -> f64 {
    let cosine = dot(one.across, other.across);
    if cosine.abs() < SMOOTH {
        return 0.0;
    }
    let common = one.keys().find_map(|(key, swapped)| {
        other.keys().find(|(other_key, _)| *other_key == key).map(|(_, other_swapped)| swapped == other_swapped)
    });
    common.map_or(0.0, |same| if same { cosine.signum() } else { -cosine.signum() })
}

/// Sets of facings with their relative orders: a forest whose links have signs.
struct Orders {
    parents: Vec<(usize, f64)>,
}

impl Orders {
    fn new(count: usize) -> Self {
        Self { parents: (0..count).map(|number| (number, 1.0)).collect() }
    }

    /// The representative of a facing, and the facing's order relative to it.
    fn root(&mut self, number: usize) -> (usize, f64) {
        let (mut root, mut sign) = (number, 1.0);
        while self.parents[root].0 != root {
            let (parent, relative) = self.parents[root];
            (root, sign) = (parent, sign * relative);
        }
        // Shortens the way for the next time.
        let (mut here, mut to_root) = (number, sign);
        while here != root {
            let (parent, relative) = std::mem::replace(&mut self.parents[here], (root, to_root));
            (here, to_root) = (parent, to_root * relative);
        }
        (root, sign)
    }

    /// Joins the sets of two neighbours. Where orders contradict each other, the first ones stay.
    fn join(&mut self, facings: &[Facing], one: usize, other: usize) {
        let relative = relation(&facings[one], &facings[other]);
        let [(a, sign), (b, other_sign)] = [self.root(one), self.root(other)];
        if relative != 0.0 && a != b {
            self.parents[b] = (a, sign * relative * other_sign);
        }
    }
}

/// Returns the number of vertices of the piece of each vertex, if edges that cross a triangle are cut.
fn pieces(mesh: &CollisionMesh, crossings: &[Crossing]) -> Vec<usize> {
    let mut cut: Vec<[usize; 2]> = crossings.iter().map(|crossing| crossing.edge).collect();
    cut.sort_unstable();
    let mut piece = vec![usize::MAX; mesh.vertices()];
    let mut sizes = Vec::new();
    for start in 0..piece.len() {
        if piece[start] != usize::MAX {
            continue;
        }
        let (number, mut size, mut waiting) = (sizes.len(), 0, vec![start]);
        piece[start] = number;
        while let Some(vertex) = waiting.pop() {
            size += 1;
            for &next in mesh.neighbours(energy_solve::index(vertex)) {
                let next = next as usize;
                let is_cut = cut.binary_search(&[vertex.min(next), vertex.max(next)]).is_ok();
                if piece[next] == usize::MAX && !is_cut {
                    piece[next] = number;
                    waiting.push(next);
                }
            }
        }
        sizes.push(size);
    }
    piece.into_iter().map(|number| sizes[number]).collect()
}
