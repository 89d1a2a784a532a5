//! The fewest nodes through which all paths between two sets of nodes lead: as many as there are paths without common
//! nodes (Menger's theorem).

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use crate::graph::NodeId;

/// The sides of a node. Only one path may lead from one to the other.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Side {
    Above(NodeId),
    Below(NodeId),
}

/// The nodes between a top and a bottom, with paths that have no node in common.
struct Network<'a> {
    below: &'a BTreeMap<NodeId, Vec<NodeId>>,
    above: BTreeMap<NodeId, Vec<NodeId>>,
    /// Steps of the paths.
    taken: BTreeSet<(Side, Side)>,
}

/// Returns the narrowest cut between the nodes of the top and those that have none below; of equals, the one closest to
/// the top. `below` lists the nodes right below each node.
pub(super) fn narrowest(top: &BTreeSet<NodeId>, below: &BTreeMap<NodeId, Vec<NodeId>>) -> Vec<NodeId> {
    let mut above: BTreeMap<NodeId, Vec<NodeId>> = BTreeMap::new();
    for (&node, others) in below {
        others.iter().for_each(|&other| above.entry(other).or_default().push(node));
    }
    let mut network = Network { below, above, taken: BTreeSet::new() };
    loop {
        match network.another(top) {
            Ok(path) => network.take(&path),
            Err(reached) => {
                let is_cut =
                    |&node: &NodeId| reached.contains(&Side::Above(node)) && !reached.contains(&Side::Below(node));
                return below.keys().copied().filter(is_cut).collect();
            }
        }
    }
}

impl Network<'_> {
    /// Returns one more path, which may undo steps of others; or all that can be reached from the top.
    fn another(&self, top: &BTreeSet<NodeId>) -> Result<Vec<Side>, BTreeSet<Side>> {
        let mut open: VecDeque<Side> = top.iter().map(|&node| Side::Above(node)).collect();
        let mut before: BTreeMap<Side, Option<Side>> = open.iter().map(|&side| (side, None)).collect();
        while let Some(side) = open.pop_front() {
            if matches!(side, Side::Below(node) if self.below[&node].is_empty()) {
                let steps = std::iter::successors(Some(side), |side| before[side]);
                let mut path: Vec<Side> = steps.collect();
                path.reverse();
                return Ok(path);
            }
            for next in self.next(side) {
                before.entry(next).or_insert_with(|| {
                    open.push_back(next);
                    Some(side)
                });
            }
        }
        Err(before.into_keys().collect())
    }

    /// Returns the steps that are free, and those that can be undone.
    fn next(&self, side: Side) -> Vec<Side> {
        let (ahead, back): (Vec<Side>, Vec<Side>) = match side {
            Side::Above(node) => {
                let above = self.above.get(&node).into_iter().flatten();
                (vec![Side::Below(node)], above.map(|&node| Side::Below(node)).collect())
            }
            Side::Below(node) => {
                (self.below[&node].iter().map(|&node| Side::Above(node)).collect(), vec![Side::Above(node)])
            }
        };
        let free = ahead.into_iter().filter(|&next| !self.taken.contains(&(side, next)));
        free.chain(back.into_iter().filter(|&next| self.taken.contains(&(next, side)))).collect()
    }

    fn take(&mut self, path: &[Side]) {
        for step in path.windows(2) {
            if !self.taken.remove(&(step[1], step[0])) {
                self.taken.insert((step[0], step[1]));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The narrowest cut of layers of nodes, each linked to all of the next.
    fn of_layers(widths: &[u32]) -> usize {
        let mut layers: Vec<Vec<NodeId>> = Vec::new();
        let mut first = 0;
        for &width in widths {
            layers.push((first..first + width).map(NodeId).collect());
            first += width;
        }
        let mut below = BTreeMap::new();
        for (number, layer) in layers.iter().enumerate() {
            let next = layers.get(number + 1).cloned().unwrap_or_default();
            below.extend(layer.iter().map(|&node| (node, next.clone())));
        }
        narrowest(&layers[0].iter().copied().collect(), &below).len()
    }

    #[test]
    fn the_narrowest_layer_is_found() {
        assert_eq!(of_layers(&[5, 3, 7, 4]), 3);
        assert_eq!(of_layers(&[2, 3, 7, 4]), 2);
        assert_eq!(of_layers(&[9, 8, 8, 6]), 6);
        assert_eq!(of_layers(&[4]), 4);
    }

    #[test]
    fn a_path_gives_way_to_two() {
        // 0 leads to 2 and 3, 1 to 2 only; 2 to 4 and 5, 3 to 4. The path 0, 2, 4 would block the other two.
        let below = [(0, vec![2, 3]), (1, vec![2]), (2, vec![4, 5]), (3, vec![4]), (4, vec![]), (5, vec![])];
        let nodes = |list: Vec<u32>| list.into_iter().map(NodeId).collect::<Vec<_>>();
        let below = below.map(|(node, others)| (NodeId(node), nodes(others))).into_iter().collect();
        let cut = narrowest(&nodes(vec![0, 1]).into_iter().collect(), &below);
        assert_eq!(cut, nodes(vec![0, 1]));
    }
}
