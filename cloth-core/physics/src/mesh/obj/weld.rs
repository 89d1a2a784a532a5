//! Merges vertices at the same position, which exporters double along seams of texture coordinates.

use std::collections::HashMap;

use energy_dsl::Vector3;

use crate::geometry::{norm, subtract};
use crate::mesh::DisjointSets;

/// Returns for each vertex the first one that it is merged with: those within `distance`, in m, and those within that
/// distance of them.
pub(super) fn welded(vertices: &[Vector3<f64>], distance: f64) -> Vec<usize> {
    // Cells that are not smaller than the distance; below that, rounding of the coordinates would decide.
    let largest = vertices.iter().flatten().fold(0.0, |largest: f64, c| largest.max(c.abs()));
    let size = distance.max(1e-15 * largest).max(f64::MIN_POSITIVE);
    let cell = |p: &Vector3<f64>| p.map(|coordinate| (coordinate / size).floor() as i64);
    // The last vertex in each cell, and for each vertex the one before it in its cell.
    let (mut last, mut before) = (HashMap::<[i64; 3], u32>::new(), vec![None; vertices.len()]);
    let mut sets = DisjointSets::singletons(vertices.len());
    for (vertex, p) in vertices.iter().enumerate() {
        let home = cell(p);
        let mut is_new = true;
        for neighbour in 0..27_i64 {
            let offset = [neighbour % 3 - 1, neighbour / 3 % 3 - 1, neighbour / 9 - 1];
            let at = std::array::from_fn(|axis| home[axis].saturating_add(offset[axis]));
            let next = |other: &u32| before[*other as usize];
            for other in std::iter::successors(last.get(&at).copied(), next).map(|other| other as usize) {
                if norm(subtract(*p, vertices[other])) <= distance {
                    sets.join(other, vertex);
                    is_new &= vertices[other] != *p;
                }
            }
        }
        // Of vertices at one place, later ones are compared with the first only: there may be millions.
        if is_new {
            before[vertex] = last.insert(home, vertex as u32);
        }
    }
    (0..vertices.len()).map(|vertex| sets.representative(vertex)).collect()
}
