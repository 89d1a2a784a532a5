//! Connected components.

use super::{SpringNetwork, TriangleMesh};

/// Disjoint sets with path halving. The smallest member of a set is its representative.
#[derive(Clone, Debug)]
pub struct DisjointSets {
    parent: Vec<usize>,
}

impl DisjointSets {
    /// Creates sets of one member each.
    pub fn singletons(count: usize) -> Self {
        Self { parent: (0..count).collect() }
    }

    /// Returns the representative of a member's set.
    pub(crate) fn representative(&mut self, mut member: usize) -> usize {
        while self.parent[member] != member {
            self.parent[member] = self.parent[self.parent[member]];
            member = self.parent[member];
        }
        member
    }

    /// Merges the sets of two members.
    pub fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.representative(a), self.representative(b));
        self.parent[a.max(b)] = a.min(b);
    }

    /// Returns the index of each member's set. Sets are numbered in the order of their representatives.
    pub fn numbers(mut self) -> Vec<usize> {
        let (mut numbers, mut count) = (vec![0; self.parent.len()], 0);
        for member in 0..numbers.len() {
            let representative = self.representative(member);
            numbers[member] = if representative == member { count } else { numbers[representative] };
            count += usize::from(representative == member);
        }
        numbers
    }
}

impl TriangleMesh {
    /// Returns the vertices of each connected component, in ascending order. Components of fewer than `least` vertices
    /// are merged into one.
    pub fn pieces(&self, least: usize) -> Vec<Vec<usize>> {
        let count = self.vertices().len();
        let mut groups = DisjointSets::singletons(count);
        for &[a, b, c] in self.triangles() {
            groups.join(a, b);
            groups.join(a, c);
        }
        let mut sizes = vec![0; count];
        (0..count).for_each(|vertex| sizes[groups.representative(vertex)] += 1);
        let small: Vec<usize> = (0..count).filter(|&vertex| sizes[groups.representative(vertex)] < least).collect();
        small.iter().for_each(|&vertex| groups.join(small[0], vertex));
        let numbers = groups.numbers();
        let mut pieces = vec![Vec::new(); numbers.iter().max().map_or(0, |last| last + 1)];
        numbers.into_iter().enumerate().for_each(|(vertex, piece)| pieces[piece].push(vertex));
        pieces
    }

    /// Returns the component with these vertices, and its springs.
    pub fn piece(&self, vertices: &[usize], springs: &SpringNetwork) -> (Self, SpringNetwork) {
        let mut new_numbers = vec![usize::MAX; self.vertices().len()];
        vertices.iter().enumerate().for_each(|(number, &vertex)| new_numbers[vertex] = number);
        let renumbered = |pairs: &[[usize; 2]]| -> Vec<[usize; 2]> {
            let moved = pairs.iter().map(|pair| pair.map(|vertex| new_numbers[vertex]));
            moved.filter(|pair| !pair.contains(&usize::MAX)).collect()
        };
        let springs = SpringNetwork {
            structural: renumbered(&springs.structural),
            shear: renumbered(&springs.shear),
            bending: renumbered(&springs.bending),
        };
        let is_inside = |corners: &[usize; 3]| new_numbers[corners[0]] != usize::MAX;
        let inside = self.triangles().iter().filter(|corners| is_inside(corners));
        let triangles = inside.map(|corners| corners.map(|corner| new_numbers[corner])).collect();
        let warps = self.warps().map(|warps| {
            let inside = self.triangles().iter().zip(warps).filter(|(corners, _)| is_inside(corners));
            inside.map(|(_, warp)| *warp).collect()
        });
        let numbers = (0..self.triangles().len()).filter(|&triangle| is_inside(&self.triangles()[triangle]));
        let patterns = self.patterns().map(|patterns| patterns.selected(numbers));
        let mesh = Self::from_valid(vertices.iter().map(|&vertex| self.vertices()[vertex]).collect(), triangles);
        (mesh.with_warps(warps).with_valid_patterns(patterns), springs)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::Topology;

    #[test]
    fn pieces_are_connected_components_and_small_ones_are_merged() {
        let at = |n: usize| [n as f64, (n * n) as f64, 0.0];
        let triangles = vec![[0, 3, 6], [1, 2, 4], [3, 6, 5], [7, 8, 9]];
        let mesh = TriangleMesh::new((0..10).map(at).collect(), triangles).unwrap();
        assert_eq!(mesh.pieces(1), [vec![0, 3, 5, 6], vec![1, 2, 4], vec![7, 8, 9]]);
        assert_eq!(mesh.pieces(4), [vec![0, 3, 5, 6], vec![1, 2, 4, 7, 8, 9]]);
        assert_eq!(mesh.pieces(100), [(0..10).collect::<Vec<_>>()]);
        let springs = SpringNetwork::of_mesh(&Topology::of(&mesh));
        let (piece, springs) = mesh.piece(&[0, 3, 5, 6], &springs);
        assert_eq!(piece, TriangleMesh::new([0, 3, 5, 6].map(at).to_vec(), vec![[0, 1, 3], [1, 3, 2]]).unwrap());
        assert_eq!(springs, SpringNetwork::of_mesh(&Topology::of(&piece)));
    }
}
