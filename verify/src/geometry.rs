//! Small vector geometry for sampling and conservation laws.

/// A rotation about the origin, by rows.
#[derive(Clone, Copy, Debug)]
pub struct Rotation([[f64; 3]; 3]);

impl Rotation {
    /// Returns the rotation matrix of a unit quaternion.
    #[must_use]
    pub fn from_unit_quaternion([w, x, y, z]: [f64; 4]) -> Self {
        Self([
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
        ])
    }
}

/// Returns the rotated vector.
pub fn rotate(Rotation(rows): &Rotation, v: &[f64]) -> [f64; 3] {
    rows.map(|row| row[0] * v[0] + row[1] * v[1] + row[2] * v[2])
}

/// Rotates each vector of a flattened list.
pub fn rotate_all(rotation: &Rotation, vectors: &[f64]) -> Vec<f64> {
    vectors.chunks(3).flat_map(|v| rotate(rotation, v)).collect()
}

/// Returns a − b.
#[must_use]
pub fn difference(a: &[f64], b: &[f64]) -> Vec<f64> {
    a.iter().zip(b).map(|(a, b)| a - b).collect()
}

/// Returns a × b.
pub fn cross(a: &[f64], b: &[f64]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn norm(a: &[f64]) -> f64 {
    dot(a, a).sqrt()
}

/// Returns the shortest positive distance between two points in space; `None` if all points coincide.
pub fn shortest_distance(points: &[f64]) -> Option<f64> {
    let points: Vec<&[f64]> = points.chunks(3).collect();
    let distances = pairs(points.len()).map(|(i, j)| norm(&difference(points[i], points[j])));
    distances.filter(|&d| d > 0.0).min_by(f64::total_cmp)
}

/// Returns the longest distance between two points in space; `None` for fewer than two points.
pub fn longest_distance(points: &[f64]) -> Option<f64> {
    let points: Vec<&[f64]> = points.chunks(3).collect();
    pairs(points.len()).map(|(i, j)| norm(&difference(points[i], points[j]))).max_by(f64::total_cmp)
}

fn pairs(count: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..count).flat_map(move |i| (i + 1..count).map(move |j| (i, j)))
}

/// Whether points are well separated, with no three near a line and no four (in space) near a plane. Textbook forms
/// lose digits near these configurations, and the audit would measure that loss. `demand` scales the required distances
/// and angles from 1 downwards: many points do not fit into a box otherwise.
pub fn is_well_shaped(points: &[f64], dimension: usize, demand: f64) -> bool {
    let points: Vec<&[f64]> = points.chunks(dimension).collect();
    let edge = |i: usize, j: usize| difference(points[j], points[i]);
    let apart = pairs(points.len()).all(|(i, j)| norm(&edge(i, j)) > 0.4 * demand);
    let triples = || pairs(points.len()).flat_map(|(i, j)| (j + 1..points.len()).map(move |k| (i, j, k)));
    let open = || {
        triples().all(|(i, j, k)| {
            let (a, b) = (edge(i, j), edge(i, k));
            let cosine = dot(&a, &b) / (norm(&a) * norm(&b));
            cosine.abs() < 1.0 - 0.05 * demand
        })
    };
    let solid = || {
        triples().flat_map(|(i, j, k)| (k + 1..points.len()).map(move |l| (i, j, k, l))).all(|(i, j, k, l)| {
            let (a, b, c) = (edge(i, j), edge(i, k), edge(i, l));
            dot(&cross(&a, &b), &c).abs() > 0.15 * demand * norm(&a) * norm(&b) * norm(&c)
        })
    };
    apart && open() && (dimension < 3 || solid())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn degenerate_shapes_are_rejected() {
        assert!(is_well_shaped(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0], 3, 1.0));
        assert!(!is_well_shaped(&[0.0, 0.0, 0.0, 0.1, 0.0, 0.0], 3, 1.0), "too close");
        assert!(!is_well_shaped(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 2.0, 0.1, 0.0], 3, 1.0), "in line");
        assert!(
            !is_well_shaped(&[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0, -1.0, -1.0, 0.02], 3, 1.0),
            "in a plane"
        );
    }

    #[test]
    fn rotations_keep_lengths_and_orientation() {
        let turn = Rotation::from_unit_quaternion([0.5, -0.5, 0.5, 0.5]);
        let (a, b) = ([1.0, 2.0, -3.0], [0.5, -1.0, 2.0]);
        let (ra, rb) = (rotate(&turn, &a), rotate(&turn, &b));
        assert!((dot(&ra, &rb) - dot(&a, &b)).abs() < 1e-14);
        let turned = rotate(&turn, &cross(&a, &b));
        assert!(norm(&difference(&turned, &cross(&ra, &rb))) < 1e-14);
    }
}
