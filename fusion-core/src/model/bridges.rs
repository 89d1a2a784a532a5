//! Connections between the disconnected parts of a mesh.

use nalgebra::Vector3;

/// Returns pairs of vertices that join all parts of a mesh: of every two parts that are joined, the pair with the
/// smallest √(distance² + extra²). This is Borůvka's minimum spanning tree over the parts.
pub(super) fn bridges(
    vertices: &[Vector3<f64>],
    parts: &[usize],
    extra: impl Fn(usize, usize) -> f64,
) -> Vec<[u32; 2]> {
    let mut part = parts.to_vec();
    let mut along: Vec<usize> = (0..vertices.len()).collect();
    along.sort_by(|&a, &b| vertices[a].y.total_cmp(&vertices[b].y));
    let mut found = Vec::new();
    let mut count = part.iter().max().map_or(0, |last| last + 1);
    while count > 1 {
        for [a, b] in shortest(vertices, &part, count, &along, &extra) {
            let (keep, drop) = (part[a as usize], part[b as usize]);
            if keep != drop {
                part.iter_mut().filter(|part| **part == drop).for_each(|part| *part = keep);
                found.push([a, b]);
            }
        }
        let left = renumber(&mut part);
        // Vertices that are not finite have no nearest neighbour.
        if left == count {
            break;
        }
        count = left;
    }
    found
}

/// Returns the shortest connection from each part to another. `along` lists the vertices by ascending y, so that a scan
/// can stop where the difference in y alone exceeds the shortest connection known.
fn shortest(
    vertices: &[Vector3<f64>],
    part: &[usize],
    count: usize,
    along: &[usize],
    extra: impl Fn(usize, usize) -> f64,
) -> Vec<[u32; 2]> {
    let mut best = vec![(f64::INFINITY, [0, 0]); count];
    for (at, &a) in along.iter().enumerate() {
        let longest = best.iter().map(|(square, _)| *square).fold(0.0, f64::max);
        for &b in &along[at + 1..] {
            let rise = vertices[b].y - vertices[a].y;
            if rise * rise >= longest {
                break;
            }
            let square = (vertices[a] - vertices[b]).norm_squared();
            if part[a] == part[b] || square >= best[part[a]].0.max(best[part[b]].0) {
                continue;
            }
            let square = square + extra(a, b).powi(2);
            for side in [part[a], part[b]] {
                if square < best[side].0 {
                    best[side] = (square, [a as u32, b as u32]);
                }
            }
        }
    }
    best.into_iter().filter(|(square, _)| square.is_finite()).map(|(_, pair)| pair).collect()
}

fn renumber(part: &mut [usize]) -> usize {
    let mut names: Vec<usize> = part.to_vec();
    names.sort_unstable();
    names.dedup();
    part.iter_mut().for_each(|part| *part = names.partition_point(|name| *name < *part));
    names.len()
}
