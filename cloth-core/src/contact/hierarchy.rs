//! A hierarchy of boxes, to find what is nearest to a point without looking at everything.

use energy_dsl::Vector3;

/// A box along the axes.
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

    /// The square of the distance of a point, in m²; 0 inside.
    fn distance_squared(&self, x: Vector3<f64>) -> f64 {
        let beyond = |axis: usize| (self.low[axis] - x[axis]).max(x[axis] - self.high[axis]).max(0.0);
        (0..3).map(|axis| beyond(axis).powi(2)).sum()
    }
}

/// A binary tree over boxes, halved at the median of the longest axis. The children of node n are n + 1 and `second`.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Hierarchy {
    nodes: Vec<Node>,
    /// The items in the order of the leaves.
    items: Vec<usize>,
}

#[derive(Clone, Debug, PartialEq)]
struct Node {
    bounds: Bounds,
    kind: Kind,
}

#[derive(Clone, Debug, PartialEq)]
enum Kind {
    /// Items from one place to another.
    Leaf(usize, usize),
    /// Where the second child is.
    Inner(usize),
}

/// Items of a leaf at most.
const LEAF: usize = 4;

impl Hierarchy {
    /// Over the boxes of items 0, 1, …; at least one.
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

    /// The distance of a point from the box around everything, in m.
    pub fn distance(&self, x: Vector3<f64>) -> f64 {
        self.nodes[0].bounds.distance_squared(x).sqrt()
    }

    /// What is nearest to a point by the square of its distance, which `measure` says with it; the first in the order of the tree where several are.
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
                    // The nearer one is looked at first.
                    children.sort_by(|a, b| b.0.total_cmp(&a.0));
                    waiting.extend(children);
                }
            }
        }
        best
    }
}
