//! A bounding volume hierarchy: the nearest item to a point, and all items near a box.

use energy_dsl::Vector3;

use super::Bounds;

/// A binary tree of boxes, split at the median along the longest axis. The children of node n are n + 1 and the index
/// in `Kind::Inner`.
#[derive(Clone, Debug, PartialEq)]
pub struct Hierarchy {
    nodes: Vec<Node>,
    /// Items, in the order of the leaves.
    items: Vec<usize>,
    /// The boxes of `items`, in the same order: leaves find theirs side by side.
    boxes: Vec<Bounds>,
}

#[derive(Clone, Debug, PartialEq)]
struct Node {
    bounds: Bounds,
    kind: Kind,
}

impl Node {
    fn is_leaf(&self) -> bool {
        matches!(self.kind, Kind::Leaf(..))
    }
}

#[derive(Clone, Debug, PartialEq)]
enum Kind {
    /// The range of `items` in this leaf.
    Leaf(usize, usize),
    /// The index of the second child.
    Inner(usize),
}

/// The pairs of a tree with itself, by the branches of the root.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Branches {
    /// All pairs of items.
    All,
    /// Pairs within the first branch.
    First,
    /// Pairs within the second branch.
    Second,
    /// Pairs of one item in each branch.
    Across,
}

/// The largest number of items in a leaf.
const LEAF: usize = 4;

impl Hierarchy {
    /// Builds the tree over the boxes of items 0, 1, ….
    pub fn new(bounds: &[Bounds]) -> Self {
        let mut tree = Self { nodes: Vec::new(), items: (0..bounds.len()).collect(), boxes: Vec::new() };
        tree.build(bounds, 0, bounds.len());
        tree.boxes = tree.items.iter().map(|&item| bounds[item]).collect();
        tree
    }

    fn build(&mut self, bounds: &[Bounds], from: usize, to: usize) {
        let all = self.items[from..to].iter().map(|&item| bounds[item]);
        let around = all.fold(Bounds::EMPTY, Bounds::around);
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

    /// Adapts the boxes of the tree to new boxes of the items, and keeps its structure. Queries stay exact. They become
    /// slow if items move far relative to each other.
    pub fn refit(&mut self, bounds: &[Bounds]) {
        for (own, &item) in self.boxes.iter_mut().zip(&self.items) {
            *own = bounds[item];
        }
        // Children follow their parents.
        for number in (0..self.nodes.len()).rev() {
            self.nodes[number].bounds = match self.nodes[number].kind {
                Kind::Leaf(from, to) => self.boxes[from..to].iter().copied().fold(Bounds::EMPTY, Bounds::around),
                Kind::Inner(second) => self.nodes[number + 1].bounds.around(self.nodes[second].bounds),
            };
        }
    }

    /// Calls `found` with each item whose box overlaps a box, in tree order.
    pub fn near(&self, bounds: &Bounds, mut found: impl FnMut(usize)) {
        // Halving the items at each level keeps the depth below the number of bits of their count.
        let (mut waiting, mut end) = ([0; 64], 1);
        while end > 0 {
            end -= 1;
            let number = waiting[end];
            let node = &self.nodes[number];
            if !node.bounds.overlaps(bounds) {
                continue;
            }
            match node.kind {
                Kind::Leaf(from, to) => self.leaf(from, to).meeting(bounds).for_each(&mut found),
                Kind::Inner(second) => {
                    [waiting[end], waiting[end + 1]] = [second, number + 1];
                    end += 2;
                }
            }
        }
    }

    /// Calls `found` with each pair of items of two trees whose boxes overlap, in any order.
    pub fn meeting(&self, other: &Self, mut found: impl FnMut(usize, usize)) {
        let mut waiting = vec![(0, 0)];
        while let Some((a, b)) = waiting.pop() {
            let (first, second) = (&self.nodes[a], &other.nodes[b]);
            if !first.bounds.overlaps(&second.bounds) {
                continue;
            }
            match (&first.kind, &second.kind) {
                (&Kind::Leaf(from, to), &Kind::Leaf(other_from, other_to)) => {
                    let leaves = [self.leaf(from, to), other.leaf(other_from, other_to)];
                    between_leaves(leaves, &second.bounds, &mut found);
                }
                (&Kind::Inner(right), _) if second.is_leaf() || first.bounds.is_longer_than(&second.bounds) => {
                    waiting.extend([(a + 1, b), (right, b)]);
                }
                (_, &Kind::Inner(right)) => waiting.extend([(a, b + 1), (a, right)]),
                (&Kind::Inner(right), _) => waiting.extend([(a + 1, b), (right, b)]),
            }
        }
    }

    /// Calls `found` with each pair of different items whose boxes overlap, once and in any order, of some branches.
    pub fn meeting_itself(&self, branches: Branches, mut found: impl FnMut(usize, usize)) {
        let mut waiting = vec![match (branches, &self.nodes[0].kind) {
            (Branches::All, _) => (0, 0),
            // The root has no branches.
            (Branches::First, Kind::Leaf(..)) => (0, 0),
            (_, Kind::Leaf(..)) => return,
            (Branches::First, _) => (1, 1),
            (Branches::Second, &Kind::Inner(second)) => (second, second),
            (Branches::Across, &Kind::Inner(second)) => (1, second),
        }];
        while let Some((a, b)) = waiting.pop() {
            let (first, second) = (&self.nodes[a], &self.nodes[b]);
            if !first.bounds.overlaps(&second.bounds) {
                continue;
            }
            match (&first.kind, &second.kind) {
                (&Kind::Leaf(from, to), _) if a == b => {
                    for place in from..to {
                        self.leaf(place + 1, to).meeting(&self.boxes[place]).for_each(|with| {
                            found(self.items[place], with);
                        });
                    }
                }
                (&Kind::Inner(right), _) if a == b => waiting.extend([(a + 1, a + 1), (a + 1, right), (right, right)]),
                (&Kind::Leaf(from, to), &Kind::Leaf(other_from, other_to)) => {
                    let leaves = [self.leaf(from, to), self.leaf(other_from, other_to)];
                    between_leaves(leaves, &second.bounds, &mut found);
                }
                (&Kind::Inner(right), _) if second.is_leaf() || first.bounds.is_longer_than(&second.bounds) => {
                    waiting.extend([(a + 1, b), (right, b)]);
                }
                (_, &Kind::Inner(right)) => waiting.extend([(a, b + 1), (a, right)]),
                (&Kind::Inner(right), _) => waiting.extend([(a + 1, b), (right, b)]),
            }
        }
    }

    fn leaf(&self, from: usize, to: usize) -> Leaf<'_> {
        Leaf { items: &self.items[from..to], boxes: &self.boxes[from..to] }
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

/// The items of a leaf, and their boxes.
#[derive(Clone, Copy)]
struct Leaf<'a> {
    items: &'a [usize],
    boxes: &'a [Bounds],
}

impl<'a> Leaf<'a> {
    /// The items whose boxes overlap a box.
    #[inline]
    fn meeting(self, bounds: &Bounds) -> impl Iterator<Item = usize> + use<'a, '_> {
        self.items.iter().zip(self.boxes).filter(|(_, own)| own.overlaps(bounds)).map(|(item, _)| *item)
    }
}

/// Calls `found` with each pair of items of two leaves whose boxes overlap; `bounds` are those of the second leaf.
#[inline]
fn between_leaves([first, second]: [Leaf<'_>; 2], bounds: &Bounds, found: &mut impl FnMut(usize, usize)) {
    // Leaves overlap little: most items of the first miss all of the second.
    for (&item, own) in first.items.iter().zip(first.boxes).filter(|(_, own)| own.overlaps(bounds)) {
        second.meeting(own).for_each(|other| found(item, other));
    }
}
