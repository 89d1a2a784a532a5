//! A bounding volume hierarchy, and the nearest item to a point.

use std::ops::Range;

use energy_dsl::Vector3;

use super::rounded_boxes::RoundedBoxes;
use super::{Bounds, Volume};

/// A binary tree of boxes, split at the median along the longest axis.
#[derive(Clone, Debug, PartialEq)]
pub struct Hierarchy<B = Bounds> {
    pub(super) nodes: Vec<Node<B>>,
    /// Items, in the order of the leaves.
    pub(super) items: Vec<usize>,
    /// The boxes of `items`, in the same order: leaves find theirs side by side.
    pub(super) boxes: Vec<B>,
    /// The same boxes, for comparisons in lanes.
    pub(super) rounded: RoundedBoxes,
    /// The position of each item in `items`.
    positions: Vec<usize>,
    /// The nodes of each group, the first of which holds all its items.
    groups: Vec<Range<usize>>,
}

/// A node of the tree. Its first child is the next node.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Node<B> {
    pub bounds: B,
    /// The range of `items` in this node.
    pub from: usize,
    pub to: usize,
    /// The index of the second child; `None` for a leaf.
    pub second: Option<usize>,
}

impl<B> Node<B> {
    /// The index of the second child, if the node has more than this many items.
    #[inline]
    pub fn branches(&self, more_than: usize) -> Option<usize> {
        self.second.filter(|_| self.to - self.from > more_than)
    }
}

/// Items below one node.
struct Group<B> {
    number: usize,
    items: Vec<usize>,
    bounds: B,
}

impl<B: Volume> Hierarchy<B> {
    /// Builds the tree over the boxes of items 0, 1, …, which are one group.
    pub fn new(bounds: &[B]) -> Self {
        Self::grouped(bounds, |_| 0)
    }

    /// Builds the tree over the boxes of items 0, 1, …, so that the items of each group are below a node of their own.
    pub fn grouped(bounds: &[B], group: impl Fn(usize) -> usize) -> Self {
        let mut items: Vec<usize> = (0..bounds.len()).collect();
        items.sort_by_key(|item| group(*item));
        let gathered = |items: &[usize]| Group {
            number: group(items[0]),
            items: items.to_vec(),
            bounds: items.iter().map(|&item| bounds[item]).fold(B::empty(), B::joined),
        };
        let mut groups: Vec<_> = items.chunk_by(|a, b| group(*a) == group(*b)).map(gathered).collect();
        let mut tree = Self {
            nodes: Vec::new(),
            items: Vec::new(),
            boxes: Vec::new(),
            rounded: RoundedBoxes::default(),
            positions: vec![0; bounds.len()],
            groups: vec![0..0; groups.last().map_or(1, |last| last.number + 1)],
        };
        tree.build_groups(bounds, &mut groups);
        tree.items.iter().enumerate().for_each(|(position, &item)| tree.positions[item] = position);
        tree.boxes = tree.items.iter().map(|&item| bounds[item]).collect();
        tree.rounded.set(&tree.boxes);
        tree
    }

    /// Adds the items of some groups, divided at the median of the groups.
    fn build_groups(&mut self, bounds: &[B], groups: &mut [Group<B>]) {
        let (node, from) = (self.nodes.len(), self.items.len());
        if let [] | [_] = groups {
            groups.iter().for_each(|group| self.items.extend(&group.items));
            self.build(bounds, from, self.items.len());
            groups.iter().for_each(|group| self.groups[group.number] = node..self.nodes.len());
            return;
        }
        let around = groups.iter().map(|group| group.bounds).fold(B::empty(), B::joined);
        let to = from + groups.iter().map(|group| group.items.len()).sum::<usize>();
        self.nodes.push(Node { bounds: around, from, to, second: None });
        let axis = longest_axis(&around);
        let middle = |group: &Group<B>| group.bounds.at(0).middle(axis);
        let order = |a: &Group<B>, b: &Group<B>| middle(a).total_cmp(&middle(b)).then(a.number.cmp(&b.number));
        let half = groups.len() / 2;
        groups.select_nth_unstable_by(half, order);
        let (before, after) = groups.split_at_mut(half);
        self.build_groups(bounds, before);
        self.nodes[node].second = Some(self.nodes.len());
        self.build_groups(bounds, after);
    }

    /// Adds the nodes of some items, divided at the median.
    fn build(&mut self, bounds: &[B], from: usize, to: usize) {
        let all = self.items[from..to].iter().map(|&item| bounds[item]);
        let around = all.fold(B::empty(), B::joined);
        let node = self.nodes.len();
        self.nodes.push(Node { bounds: around, from, to, second: None });
        if to - from <= B::LEAF {
            return;
        }
        let axis = longest_axis(&around);
        let half = (to - from) / 2;
        let middle = |item: &usize| bounds[*item].at(0).middle(axis);
        let order = |a: &usize, b: &usize| middle(a).total_cmp(&middle(b)).then(a.cmp(b));
        self.items[from..to].select_nth_unstable_by(half, order);
        self.build(bounds, from, from + half);
        self.nodes[node].second = Some(self.nodes.len());
        self.build(bounds, from + half, to);
    }

    /// Whether the hierarchy is empty.
    pub fn is_empty(&self) -> bool {
        self.items.is_empty()
    }

    /// The node that holds all items of a group, if it has any.
    pub(super) fn root(&self, group: usize) -> Option<usize> {
        self.groups.get(group).filter(|nodes| !nodes.is_empty()).map(|nodes| nodes.start)
    }

    /// Adapts the boxes of the tree to new boxes of the items, and keeps its structure. Queries stay exact. They become
    /// slow if items move far relative to each other.
    pub fn refit(&mut self, bounds: impl Fn(usize) -> B) {
        for (own, &item) in self.boxes.iter_mut().zip(&self.items) {
            *own = bounds(item);
        }
        self.rounded.set(&self.boxes);
        self.refit_nodes(0..self.nodes.len());
    }

    /// Adapts the boxes of a group to new boxes of its items. Nodes with several groups keep theirs.
    pub fn refit_group(&mut self, group: usize, bounds: impl Fn(usize) -> B) {
        let Some(root) = self.root(group) else { return };
        for position in self.nodes[root].from..self.nodes[root].to {
            self.boxes[position] = bounds(self.items[position]);
            self.rounded.replace(position, &self.boxes[position]);
        }
        self.refit_nodes(self.groups[group].clone());
    }

    fn refit_nodes(&mut self, nodes: Range<usize>) {
        // Children follow their parents.
        for number in nodes.rev() {
            let Node { from, to, second, .. } = self.nodes[number];
            self.nodes[number].bounds = match second {
                None => self.boxes[from..to].iter().copied().fold(B::empty(), B::joined),
                Some(second) => self.nodes[number + 1].bounds.joined(self.nodes[second].bounds),
            };
        }
    }

    /// Adapts the tree to new boxes of some items.
    pub fn refit_some(&mut self, items: impl Iterator<Item = usize>, bounds: impl Fn(usize) -> B) {
        let mut positions = Vec::new();
        for item in items {
            let position = self.positions[item];
            self.boxes[position] = bounds(item);
            self.rounded.replace(position, &self.boxes[position]);
            positions.push(position);
        }
        positions.sort_unstable();
        self.refit_positions(0, &positions);
    }

    /// Adapts a node to the new boxes at some positions in it, in order.
    fn refit_positions(&mut self, number: usize, positions: &[usize]) {
        if positions.is_empty() {
            return;
        }
        let Node { from, to, second, .. } = self.nodes[number];
        self.nodes[number].bounds = match second {
            None => self.boxes[from..to].iter().copied().fold(B::empty(), B::joined),
            Some(second) => {
                let (before, after) =
                    positions.split_at(positions.partition_point(|position| *position < self.nodes[second].from));
                self.refit_positions(number + 1, before);
                self.refit_positions(second, after);
                self.nodes[number + 1].bounds.joined(self.nodes[second].bounds)
            }
        };
    }
}

fn longest_axis<B: Volume>(bounds: &B) -> usize {
    let length = |axis: &usize| bounds.at(0).length(*axis);
    (0..3).max_by(|a, b| length(a).total_cmp(&length(b))).unwrap_or(0)
}

impl Hierarchy {
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
            let node = &self.nodes[number];
            match node.second {
                None => {
                    for &item in &self.items[node.from..node.to] {
                        let measured = measure(item);
                        if best.as_ref().is_none_or(|(distance, _)| measured.0 < *distance) {
                            best = Some(measured);
                        }
                    }
                }
                Some(second) => {
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
