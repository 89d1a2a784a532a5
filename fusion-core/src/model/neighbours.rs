use nalgebra::Vector3;

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
