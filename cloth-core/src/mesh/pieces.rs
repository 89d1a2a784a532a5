//! What hangs together.

use super::{SpringNetwork, TriangleMesh};

/// Things in groups that grow together (disjoint sets with path halving; the first of a group stands for it).
#[derive(Clone, Debug)]
pub(crate) struct Groups {
    parent: Vec<usize>,
}

impl Groups {
    /// Each thing in a group of its own.
    pub(crate) fn apart(count: usize) -> Self {
        Self { parent: (0..count).collect() }
    }

    /// The first of the group of a thing.
    pub(crate) fn first(&mut self, mut thing: usize) -> usize {
        while self.parent[thing] != thing {
            self.parent[thing] = self.parent[self.parent[thing]];
            thing = self.parent[thing];
        }
        thing
    }

    /// Makes one group of two.
    pub(crate) fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.first(a), self.first(b));
        self.parent[a.max(b)] = a.min(b);
    }

    /// The number of each thing's group; groups are numbered in the order of their first things.
    pub(crate) fn numbers(mut self) -> Vec<usize> {
        let (mut numbers, mut count) = (vec![0; self.parent.len()], 0);
        for thing in 0..numbers.len() {
            let first = self.first(thing);
            numbers[thing] = if first == thing { count } else { numbers[first] };
            count += usize::from(first == thing);
        }
        numbers
    }
}

impl TriangleMesh {
    /// The vertices of each connected piece, ascending. All pieces of fewer than `least` vertices count as one, in the place of the first of them.
    pub(crate) fn pieces(&self, least: usize) -> Vec<Vec<usize>> {
        let count = self.vertices().len();
        let mut groups = Groups::apart(count);
        for &[a, b, c] in self.triangles() {
            groups.join(a, b);
            groups.join(a, c);
        }
        let mut sizes = vec![0; count];
        (0..count).for_each(|vertex| sizes[groups.first(vertex)] += 1);
        let small: Vec<usize> = (0..count).filter(|&vertex| sizes[groups.first(vertex)] < least).collect();
        small.iter().for_each(|&vertex| groups.join(small[0], vertex));
        let numbers = groups.numbers();
        let mut pieces = vec![Vec::new(); numbers.iter().max().map_or(0, |last| last + 1)];
        numbers.into_iter().enumerate().for_each(|(vertex, piece)| pieces[piece].push(vertex));
        pieces
    }

    /// One of its pieces, with the springs of it.
    pub(crate) fn piece(&self, vertices: &[usize], springs: &SpringNetwork) -> (Self, SpringNetwork) {
        let mut place = vec![usize::MAX; self.vertices().len()];
        vertices.iter().enumerate().for_each(|(number, &vertex)| place[vertex] = number);
        let inside = |pairs: &[[usize; 2]]| -> Vec<[usize; 2]> {
            let moved = pairs.iter().map(|pair| pair.map(|vertex| place[vertex]));
            moved.filter(|pair| !pair.contains(&usize::MAX)).collect()
        };
        let springs = SpringNetwork {
            structural: inside(&springs.structural),
            shear: inside(&springs.shear),
            bending: inside(&springs.bending),
        };
        let triangles = self.triangles().iter().map(|corners| corners.map(|corner| place[corner]));
        let triangles = triangles.filter(|corners| corners[0] != usize::MAX).collect();
        (Self::of_valid(vertices.iter().map(|&vertex| self.vertices()[vertex]).collect(), triangles), springs)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::Topology;

    #[test]
    fn pieces_are_what_triangles_hold_together_and_crumbs_count_as_one() {
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
