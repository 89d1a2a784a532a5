//! Merges vertices at the same position, which exporters double along seams of texture coordinates.

use std::ops::Range;

use energy_dsl::Vector3;

use crate::geometry::{norm, subtract};
use crate::mesh::DisjointSets;

/// The most vertices of a leaf.
const LEAF: usize = 8;

/// Returns the most comparisons of boxes and vertices for this many vertices. Meshes take about 15 for each.
pub(super) fn most_comparisons(vertices: usize) -> usize {
    1_000_000 + 100 * vertices
}

/// Returns for each vertex the first one that it is merged with: those within `distance`, in m, and those within that
/// distance of them. Returns `None` if that takes more than [`most_comparisons`].
pub(super) fn welded(vertices: &[Vector3<f64>], distance: f64) -> Option<Vec<usize>> {
    let mut tree = Tree::new(vertices, distance);
    if !tree.nodes.is_empty() {
        tree.weld(0, 0)?;
    }
    Some((0..vertices.len()).map(|vertex| tree.sets.representative(vertex)).collect())
}

/// Finite vertices in a tree of boxes. Pairs of boxes decide for all their vertices, so that clusters cost little.
struct Tree<'a> {
    vertices: &'a [Vector3<f64>],
    distance: f64,
    /// The vertices, in the order of the leaves.
    order: Vec<u32>,
    /// Parents before their children. The first child comes right after its parent.
    nodes: Vec<Node>,
    sets: DisjointSets,
    /// Number of comparisons that are left.
    left: usize,
}

struct Node {
    /// The corners of the smallest box.
    low: Vector3<f64>,
    high: Vector3<f64>,
    /// The vertices, as places in the order.
    members: Range<usize>,
    /// The second child; `None` for a leaf.
    second: Option<usize>,
    /// Whether all vertices are known to be in one set.
    is_joined: bool,
}

impl Node {
    /// Returns the largest difference along an axis.
    fn extent(&self) -> f64 {
        subtract(self.high, self.low).into_iter().fold(0.0, f64::max)
    }
}

impl<'a> Tree<'a> {
    fn new(vertices: &'a [Vector3<f64>], distance: f64) -> Self {
        let is_finite = |&vertex: &u32| vertices[vertex as usize].iter().all(|c| c.is_finite());
        let order: Vec<u32> = (0..vertices.len() as u32).filter(is_finite).collect();
        let sets = DisjointSets::singletons(vertices.len());
        let (members, left) = (0..order.len(), most_comparisons(vertices.len()));
        let mut tree = Self { vertices, distance, order, nodes: Vec::new(), sets, left };
        if !members.is_empty() {
            tree.add(members);
        }
        tree
    }

    /// Adds a node with these vertices, and all nodes below it.
    fn add(&mut self, members: Range<usize>) {
        let vertices = self.vertices;
        let first = vertices[self.order[members.start] as usize];
        let (mut low, mut high) = (first, first);
        for &vertex in &self.order[members.clone()] {
            let p = vertices[vertex as usize];
            low = std::array::from_fn(|axis| low[axis].min(p[axis]));
            high = std::array::from_fn(|axis| high[axis].max(p[axis]));
        }
        let node = self.nodes.len();
        self.nodes.push(Node { low, high, members: members.clone(), second: None, is_joined: false });
        if members.len() > LEAF && low != high {
            let size = subtract(high, low);
            let axis = (0..3).max_by(|&a, &b| size[a].total_cmp(&size[b])).expect("there are three axes");
            let middle = members.len() / 2;
            let coordinate = |vertex: &u32| vertices[*vertex as usize][axis];
            self.order[members.clone()].select_nth_unstable_by(middle, |a, b| coordinate(a).total_cmp(&coordinate(b)));
            self.add(members.start..members.start + middle);
            self.nodes[node].second = Some(self.nodes.len());
            self.add(members.start + middle..members.end);
        }
    }

    /// Returns the least and the largest distance that vertices of two boxes can have. Rounding keeps the order: the
    /// computed distance of any two vertices lies between both.
    fn distances(&self, a: usize, b: usize) -> [f64; 2] {
        let (a, b) = (&self.nodes[a], &self.nodes[b]);
        let (one, other) = (subtract(b.low, a.high), subtract(a.low, b.high));
        let least = std::array::from_fn(|axis| one[axis].max(other[axis]).max(0.0));
        let largest = std::array::from_fn(|axis| one[axis].min(other[axis]));
        [norm(least), norm(largest)]
    }

    fn pay(&mut self, comparisons: usize) -> Option<()> {
        self.left = self.left.checked_sub(comparisons)?;
        Some(())
    }

    /// Merges vertices of two nodes, or of a node with itself.
    fn weld(&mut self, a: usize, b: usize) -> Option<()> {
        self.pay(1)?;
        let [least, largest] = self.distances(a, b);
        if least > self.distance || self.is_one_set(a, b) {
            return Some(());
        }
        if largest <= self.distance {
            self.join_all(a);
            self.join_all(b);
            self.sets.join(self.first(a), self.first(b));
            return Some(());
        }
        match (self.children(a), self.children(b)) {
            (Some([one, other]), _) if a == b => {
                self.weld(one, one)?;
                self.weld(other, other)?;
                self.weld(one, other)?;
                self.nodes[a].is_joined = self.is_one_set(one, other);
            }
            (Some([one, other]), right) if right.is_none() || self.nodes[a].extent() >= self.nodes[b].extent() => {
                self.weld(one, b)?;
                self.weld(other, b)?;
            }
            (_, Some([one, other])) => {
                self.weld(a, one)?;
                self.weld(a, other)?;
            }
            _ => self.compare(a, b)?,
        }
        Some(())
    }

    /// Compares all vertices of two leaves, or of a leaf with itself.
    fn compare(&mut self, a: usize, b: usize) -> Option<()> {
        let (left, right) = (self.nodes[a].members.clone(), self.nodes[b].members.clone());
        self.pay(left.len() * right.len())?;
        for at in left {
            for other in if a == b { at + 1..right.end } else { right.clone() } {
                let pair = [self.order[at] as usize, self.order[other] as usize];
                let [p, q] = pair.map(|vertex| self.vertices[vertex]);
                if norm(subtract(p, q)) <= self.distance {
                    self.sets.join(pair[0], pair[1]);
                }
            }
        }
        if a == b {
            let first = self.sets.representative(self.first(a));
            let mut members = self.nodes[a].members.clone();
            self.nodes[a].is_joined =
                members.all(|place| self.sets.representative(self.order[place] as usize) == first);
        }
        Some(())
    }

    /// Returns both children, which are joined if their parent is.
    fn children(&mut self, node: usize) -> Option<[usize; 2]> {
        let children = [node + 1, self.nodes[node].second?];
        if self.nodes[node].is_joined {
            children.into_iter().for_each(|child| self.nodes[child].is_joined = true);
        }
        Some(children)
    }

    /// Merges all vertices of a node.
    fn join_all(&mut self, node: usize) {
        if !std::mem::replace(&mut self.nodes[node].is_joined, true) {
            let first = self.first(node);
            for place in self.nodes[node].members.clone() {
                self.sets.join(first, self.order[place] as usize);
            }
        }
    }

    /// Returns whether the vertices of two nodes are known to be in one set.
    fn is_one_set(&mut self, a: usize, b: usize) -> bool {
        let [one, other] = [a, b].map(|node| self.nodes[node].is_joined.then(|| self.first(node)));
        one.zip(other).is_some_and(|(one, other)| self.sets.representative(one) == self.sets.representative(other))
    }

    /// Returns the first vertex of a node.
    fn first(&self, node: usize) -> usize {
        self.order[self.nodes[node].members.start] as usize
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fastrand::Rng;

    /// Returns the first vertex of each vertex's set, from the distances of all pairs.
    fn by_all_pairs(vertices: &[Vector3<f64>], distance: f64) -> Vec<usize> {
        let mut sets = DisjointSets::singletons(vertices.len());
        for (vertex, p) in vertices.iter().enumerate() {
            let near = (0..vertex).filter(|&other| norm(subtract(*p, vertices[other])) <= distance);
            near.for_each(|other| sets.join(other, vertex));
        }
        (0..vertices.len()).map(|vertex| sets.representative(vertex)).collect()
    }

    /// Returns the number of comparisons per vertex.
    fn comparisons(vertices: &[Vector3<f64>], distance: f64) -> f64 {
        let mut tree = Tree::new(vertices, distance);
        tree.weld(0, 0).expect("within the limit");
        (most_comparisons(vertices.len()) - tree.left) as f64 / vertices.len() as f64
    }

    fn in_cube(random: &mut Rng) -> Vector3<f64> {
        [0; 3].map(|_| random.f64())
    }

    #[test]
    fn sets_are_those_of_all_pairs() {
        let mut random = Rng::with_seed(1);
        for trial in 0..400 {
            let count = random.usize(0..200);
            // Random places, places on a lattice, whose distances are ties, and many at the same place.
            let mut vertices: Vec<_> = (0..count).map(|_| in_cube(&mut random)).collect();
            let cells = [f64::INFINITY, 1024.0, 8.0, 2.0][trial % 4];
            if cells.is_finite() {
                vertices.iter_mut().flatten().for_each(|c| *c = (*c * cells).floor() / cells);
            }
            if let Some(last) = vertices.last_mut() {
                *last = [[f64::NAN, 0.0, 0.0], [f64::INFINITY; 3], [1e300; 3], [0.0; 3]][trial % 4];
            }
            for distance in [0.0, 1e-300, 1.0 / 1024.0, 0.03, 0.1, 0.125, 0.25, 0.5, 10.0] {
                let expected = by_all_pairs(&vertices, distance);
                assert_eq!(welded(&vertices, distance).unwrap(), expected, "trial {trial}, {distance} m");
            }
        }
    }

    #[test]
    fn clusters_just_over_the_distance_apart_cost_little() {
        let mut random = Rng::with_seed(2);
        let mut clusters = |size: [f64; 3], start: [f64; 3]| -> Vec<Vector3<f64>> {
            let all = 0..100_000;
            let vertex = |number| {
                let p = in_cube(&mut random);
                std::array::from_fn(|axis| size[axis] * p[axis] + if number % 2 == 0 { 0.0 } else { start[axis] })
            };
            all.map(vertex).collect()
        };
        for (size, start) in [([0.3; 3], [1.3001, 0.0, 0.0]), ([0.0, 1.0, 1.0], [1.0001, 0.0, 0.0])] {
            let vertices = clusters(size, start);
            assert!(comparisons(&vertices, 1.0) < 10.0);
            let sets = welded(&vertices, 1.0).unwrap();
            assert!(sets.iter().enumerate().all(|(vertex, &first)| first == vertex % 2));
        }
        let one_place = vec![[0.1; 3]; 100_000];
        assert!(comparisons(&one_place, 0.0) < 1.0);
    }

    #[test]
    fn meshes_take_few_comparisons() {
        let mut random = Rng::with_seed(3);
        let mut grid: Vec<Vector3<f64>> =
            (0..40_000).map(|i| [f64::from(i % 200), f64::from(i / 200), random.f64()]).collect();
        grid.extend_from_within(..400);
        for distance in [0.0, 1e-6, 0.5, 1.0, 1.3, 3.0, 30.0] {
            let per_vertex = comparisons(&grid, distance);
            println!("{distance} m: {per_vertex:.1} comparisons per vertex");
            assert!(per_vertex < 50.0, "{distance} m: {per_vertex}");
        }
    }

    #[test]
    fn hostile_vertices_are_refused() {
        // A needle on the axis of a ring, whose radius is barely more than the distance.
        let mut random = Rng::with_seed(4);
        let mut place = |number: usize| {
            let angle = std::f64::consts::TAU * random.f64();
            let (radius, height) = match number % 2 {
                0 => (1e-9, 1e-5 * random.f64()),
                _ => (1.0 + 1.01e-9, 0.0),
            };
            [radius * angle.cos(), radius * angle.sin(), height]
        };
        let vertices: Vec<_> = (0..40_000).map(&mut place).collect();
        assert_eq!(welded(&vertices, 1.0), None);
    }
}
