//! A bounding volume hierarchy for nearest-feature queries.

use energy_dsl::Vector3;

/// An axis-aligned box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Bounds {
    low: Vector3<f64>,
    high: Vector3<f64>,
}

impl Bounds {
    pub fn of(points: &[Vector3<f64>]) -> Self {
        let bound = |pick: fn(f64, f64) -> f64, start: f64| -> Vector3<f64> {
            std::array::from_fn(|axis| points.iter().map(|p| p[axis]).fold(start, pick))
        };
        Self { low: bound(f64::min, f64::INFINITY), high: bound(f64::max, f64::NEG_INFINITY) }
    }

    fn around(self, other: Self) -> Self {
        Self {
            low: std::array::from_fn(|axis| self.low[axis].min(other.low[axis])),
            high: std::array::from_fn(|axis| self.high[axis].max(other.high[axis])),
        }
    }

    fn middle(&self, axis: usize) -> f64 {
        0.5 * (self.low[axis] + self.high[axis])
    }

    /// Squared distance of a point, in m²; 0 inside.
    fn distance_squared(&self, x: Vector3<f64>) -> f64 {
        let beyond = |axis: usize| (self.low[axis] - x[axis]).max(x[axis] - self.high[axis]).max(0.0);
        (0..3).map(|axis| beyond(axis).powi(2)).sum()
    }
}

/// A binary tree of boxes, split at the median along the longest axis. The children of node n are n + 1 and the index
/// in [`Kind::Inner`].
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Hierarchy {
    nodes: Vec<Node>,
    /// Items, in the order of the leaves.
    items: Vec<usize>,
}

#[derive(Clone, Debug, PartialEq)]
struct Node {
    bounds: Bounds,
    kind: Kind,
}

#[derive(Clone, Debug, PartialEq)]
enum Kind {
    /// The range of `items` in this leaf.
    Leaf(usize, usize),
    /// The index of the second child.
    Inner(usize),
}

/// The largest number of items in a leaf.
const LEAF: usize = 4;

impl Hierarchy {
    /// Builds the tree over the boxes of items 0, 1, …; at least one item.
    pub fn new(bounds: &[Bounds]) -> Self {
        let mut tree = Self { nodes: Vec::new(), items: (0..bounds.len()).collect() };
        tree.build(bounds, 0, bounds.len());
        tree
    }

    fn build(&mut self, bounds: &[Bounds], from: usize, to: usize) {
        let all = self.items[from..to].iter().map(|&item| bounds[item]);
        let around = all.reduce(Bounds::around).unwrap_or(Bounds { low: [0.0; 3], high: [0.0; 3] });
        let node = self.nodes.len();
        self.nodes.push(Node { bounds: around, kind: Kind::Leaf(from, to) });
        if to - from <= LEAF {
            return;
        }
        let length = |axis: &usize| around.high[*axis] - around.low[*axis];
        let axis = (0..3).max_by(|a, b| length(a).total_cmp(&length(b))).unwrap_or(0);
        let half = (to - from) / 2;
        let order = |a: &usize, b: &usize| bounds[*a].middle(axis).total_cmp(&bounds[*b].middle(axis)).then(a.cmp(b));
        self.items[from..to].select_nth_unstable_by(half, order);
        self.build(bounds, from, from + half);
        self.nodes[node].kind = Kind::Inner(self.nodes.len());
        self.build(bounds, from + half, to);
    }

    /// Returns the distance of a point from the bounding box of all items, in m.
    pub fn distance(&self, x: Vector3<f64>) -> f64 {
        self.nodes[0].bounds.distance_squared(x).sqrt()
    }

    /// Returns the item with the smallest squared distance from a point. `measure` returns the squared distance of an
    /// item, with a payload. Of several nearest items, the first in tree order wins.
    pub fn nearest<T>(&self, x: Vector3<f64>, measure: impl Fn(usize) -> (f64, T)) -> Option<(f64, T)> {
        let mut best: Option<(f64, T)> = None;
        let mut waiting = vec![(self.nodes[0].bounds.distance_squared(x), 0)];
        while let Some((least, number)) = waiting.pop() {
            if best.as_ref().is_some_and(|(distance, _)| *distance <= least) {
                continue;
            }
            match self.nodes[number].kind {
                Kind::Leaf(from, to) => {
                    for &item in &self.items[from..to] {
                        let measured = measure(item);
                        if best.as_ref().is_none_or(|(distance, _)| measured.0 < *distance) {
                            best = Some(measured);
                        }
                    }
                }
                Kind::Inner(second) => {
                    let mut children =
                        [number + 1, second].map(|child| (self.nodes[child].bounds.distance_squared(x), child));
                    // The stack pops the nearer child first.
                    children.sort_by(|a, b| b.0.total_cmp(&a.0));
                    waiting.extend(children);
                }
            }
        }
        best
    }
}
