use nalgebra::Vector3;

use super::surface::{Surface, SurfaceSearch};

/// Returns the `count` points nearest to `from` with their squared distances, ascending. The squared distance of
/// point i is |x − y|² + `extra(i)`. The point `skip` is left out.
#[must_use]
pub fn nearest(
    from: &Vector3<f64>,
    places: &[Vector3<f64>],
    count: usize,
    extra: impl Fn(usize) -> f64,
    skip: Option<usize>,
) -> Vec<(usize, f64)> {
    let mut best: Vec<(usize, f64)> = Vec::with_capacity(count + 1);
    for (at, place) in places.iter().enumerate() {
        let euclidean = (from - place).norm_squared();
        let limit = if best.len() == count { best.last().map_or(0.0, |b| b.1) } else { f64::INFINITY };
        if Some(at) == skip || euclidean >= limit {
            continue;
        }
        let square = euclidean + extra(at);
        if square < limit {
            let place = best.partition_point(|b| b.1 <= square);
            best.insert(place, (at, square));
            best.truncate(count);
        }
    }
    best
}

/// The nearest nodes of a place with their squared distances, ascending.
pub(super) type Near = Vec<(usize, f64)>;

/// Finds the nearest nodes along a surface: `counts[v]` of them for each vertex v. The squared distance of vertex v and
/// node i is g² + `extra(v, i)` with the distance g along the surface. Only nodes within a limit compete, which is
/// doubled until each vertex has enough.
pub(super) fn nearest_on_surface(
    surface: &Surface,
    nodes: &[usize],
    counts: &[usize],
    first_limit: f64,
    extra: impl Fn(usize, usize) -> f64,
) -> Vec<Near> {
    let mut search = SurfaceSearch::new(surface);
    let mut limit = first_limit;
    loop {
        let mut best: Vec<Near> = vec![Vec::new(); counts.len()];
        let mut reached = 0;
        for (node, &vertex) in nodes.iter().enumerate() {
            search.within(vertex, limit, |near, distance| {
                reached += 1;
                insert(&mut best[near], counts[near], node, distance * distance + extra(near, node));
            });
        }
        let enough = best.iter().zip(counts).all(|(best, &count)| best.len() == count);
        // If every node reached every vertex, the surface has no more nodes.
        if enough || reached == nodes.len() * counts.len() {
            return best;
        }
        limit *= 2.0;
    }
}

/// Inserts a node into a list of at most `count` nodes.
fn insert(best: &mut Near, count: usize, node: usize, square: f64) {
    if best.len() < count || best.last().is_some_and(|last| square < last.1) {
        let place = best.partition_point(|one| one.1 <= square);
        best.insert(place, (node, square));
        best.truncate(count);
    }
}
