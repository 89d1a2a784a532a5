//! Distances along a surface.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use nalgebra::Vector3;

use super::bridges::bridges;

/// The edges of a mesh, with their lengths, for distances along its surface.
///
/// Paths follow the mesh's edges and the diagonals of pairs of triangles, so they exceed geodesic distances by a few
/// per cent. Disconnected parts are joined where they come closest.
#[derive(Clone, Debug)]
pub struct Surface {
    row_start: Vec<usize>,
    links: Vec<(u32, f64)>,
}

impl Surface {
    /// Creates the graph of a mesh. `extra(a, b)` in m makes parts that do not belong together less likely to be
    /// joined: the connection with the smallest √(distance² + extra²) is taken.
    #[must_use]
    pub fn new(vertices: &[Vector3<f64>], triangles: &[[u32; 3]], extra: impl Fn(usize, usize) -> f64) -> Self {
        let mut pairs = edges_and_diagonals(triangles);
        let connected = Self::of_pairs(vertices, &pairs);
        pairs.extend(bridges(vertices, &connected.parts(), extra));
        Self::of_pairs(vertices, &pairs)
    }

    fn of_pairs(vertices: &[Vector3<f64>], pairs: &[[u32; 2]]) -> Self {
        let mut row_start = vec![0; vertices.len() + 1];
        for &[a, b] in pairs {
            row_start[a as usize + 1] += 1;
            row_start[b as usize + 1] += 1;
        }
        for row in 0..vertices.len() {
            row_start[row + 1] += row_start[row];
        }
        let mut next = row_start.clone();
        let mut links = vec![(0, 0.0); 2 * pairs.len()];
        for &[a, b] in pairs {
            let length = (vertices[a as usize] - vertices[b as usize]).norm();
            for (from, to) in [(a, b), (b, a)] {
                links[next[from as usize]] = (to, length);
                next[from as usize] += 1;
            }
        }
        Self { row_start, links }
    }

    /// Returns the neighbours of a vertex, with distances in m.
    #[must_use]
    pub fn links(&self, vertex: usize) -> &[(u32, f64)] {
        &self.links[self.row_start[vertex]..self.row_start[vertex + 1]]
    }

    /// Returns the index of the connected part of each vertex.
    #[must_use]
    pub fn parts(&self) -> Vec<usize> {
        const NONE: usize = usize::MAX;
        let vertices = self.row_start.len() - 1;
        let mut part = vec![NONE; vertices];
        let (mut count, mut open) = (0, Vec::new());
        for seed in 0..vertices {
            if part[seed] != NONE {
                continue;
            }
            part[seed] = count;
            open.push(seed);
            while let Some(at) = open.pop() {
                for &(to, _) in self.links(at) {
                    if part[to as usize] == NONE {
                        part[to as usize] = count;
                        open.push(to as usize);
                    }
                }
            }
            count += 1;
        }
        part
    }
}

/// Returns the edges of the triangles, and the diagonals of pairs of triangles that share an edge.
fn edges_and_diagonals(triangles: &[[u32; 3]]) -> Vec<[u32; 2]> {
    let mut opposite: Vec<([u32; 2], u32)> = Vec::with_capacity(3 * triangles.len());
    for &[a, b, c] in triangles {
        opposite.extend([(a, b, c), (b, c, a), (c, a, b)].map(|(p, q, r)| ([p.min(q), p.max(q)], r)));
    }
    opposite.sort_unstable();
    let mut pairs: Vec<[u32; 2]> = opposite.iter().map(|(edge, _)| *edge).collect();
    for two in opposite.windows(2) {
        if two[0].0 == two[1].0 {
            pairs.push([two[0].1.min(two[1].1), two[0].1.max(two[1].1)]);
        }
    }
    pairs.retain(|[a, b]| a != b);
    pairs.sort_unstable();
    pairs.dedup();
    pairs
}

/// A vertex to visit, ordered by descending distance.
#[derive(Debug, PartialEq)]
struct Visit {
    distance: f64,
    vertex: u32,
}

impl Eq for Visit {}

impl PartialOrd for Visit {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Visit {
    fn cmp(&self, other: &Self) -> Ordering {
        other.distance.total_cmp(&self.distance).then(other.vertex.cmp(&self.vertex))
    }
}

/// Dijkstra's algorithm on a surface; reuses its memory between searches.
#[derive(Debug)]
pub struct SurfaceSearch<'a> {
    surface: &'a Surface,
    distance: Vec<f64>,
    touched: Vec<u32>,
    heap: BinaryHeap<Visit>,
}

impl<'a> SurfaceSearch<'a> {
    /// Creates a search.
    #[must_use]
    pub fn new(surface: &'a Surface) -> Self {
        let distance = vec![f64::INFINITY; surface.row_start.len() - 1];
        Self { surface, distance, touched: Vec::new(), heap: BinaryHeap::new() }
    }

    /// Calls `each` with every vertex closer than `limit` to a vertex, and its distance in m, in ascending order.
    pub fn within(&mut self, from: usize, limit: f64, mut each: impl FnMut(usize, f64)) {
        self.distance[from] = 0.0;
        self.touched.push(from as u32);
        self.heap.push(Visit { distance: 0.0, vertex: from as u32 });
        while let Some(Visit { distance, vertex }) = self.heap.pop() {
            if distance > self.distance[vertex as usize] {
                continue;
            }
            each(vertex as usize, distance);
            for &(to, length) in self.surface.links(vertex as usize) {
                let there = distance + length;
                let known = &mut self.distance[to as usize];
                if there < limit && there < *known {
                    if known.is_infinite() {
                        self.touched.push(to);
                    }
                    *known = there;
                    self.heap.push(Visit { distance: there, vertex: to });
                }
            }
        }
        for vertex in self.touched.drain(..) {
            self.distance[vertex as usize] = f64::INFINITY;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A flat square of 1 m, with 21 × 21 vertices.
    fn square() -> (Vec<Vector3<f64>>, Vec<[u32; 3]>) {
        let vertices = (0..441).map(|i| Vector3::new((i % 21) as f64, (i / 21) as f64, 0.0) / 20.0).collect();
        let cell = |i: u32| i + i / 20;
        let triangles = (0..400).map(cell).flat_map(|a| [[a, a + 1, a + 21], [a + 1, a + 22, a + 21]]).collect();
        (vertices, triangles)
    }

    #[test]
    fn distances_on_a_plane_are_nearly_euclidean() {
        let (vertices, triangles) = square();
        let surface = Surface::new(&vertices, &triangles, |_, _| 0.0);
        let (mut count, mut last) = (0, 0.0);
        SurfaceSearch::new(&surface).within(0, 0.7, |vertex, distance| {
            let straight = vertices[vertex].norm();
            assert!(distance >= straight - 1e-12 && distance <= 1.09 * straight, "{distance} m for {straight} m");
            assert!(distance >= last, "ascending");
            (count, last) = (count + 1, distance);
        });
        assert!((130..160).contains(&count), "{count} vertices in a quarter of a disc of 0.7 m");
    }

    #[test]
    fn a_search_can_be_repeated() {
        let (vertices, triangles) = square();
        let surface = Surface::new(&vertices, &triangles, |_, _| 0.0);
        let mut search = SurfaceSearch::new(&surface);
        let mut near = |from| {
            let mut found = Vec::new();
            search.within(from, 0.12, |vertex, distance| found.push((vertex, distance)));
            found
        };
        let first = near(220);
        near(0);
        assert_eq!(near(220), first);
        assert_eq!(first[0], (220, 0.0));
    }

    #[test]
    fn parts_are_joined_where_they_belong_together() {
        // Two strips: the second starts above the end of the first, and comes back down to its start.
        let places = [[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [2.0, 0.3], [1.0, 0.3], [0.0, 0.1]];
        let vertices: Vec<Vector3<f64>> = places.iter().map(|[x, y]| Vector3::new(*x, *y, 0.0)).collect();
        let triangles = [[0, 1, 1], [1, 2, 2], [3, 4, 4], [4, 5, 5]];
        let joined = |extra: &dyn Fn(usize, usize) -> f64| {
            let surface = Surface::new(&vertices, &triangles, extra);
            assert!(surface.parts().iter().all(|&part| part == 0));
            let links = (0..3).flat_map(|a| surface.links(a).iter().map(move |&(b, _)| (a, b)));
            links.filter(|(_, b)| *b >= 3).collect::<Vec<_>>()
        };
        assert_eq!(joined(&|_, _| 0.0), [(0, 5)], "the closest vertices");
        let apart = |a: usize, b: usize| if a.max(b) == 5 { 1.0 } else { 0.0 };
        assert_eq!(joined(&apart), [(1, 4)], "the closest vertices that belong together");
    }
}
