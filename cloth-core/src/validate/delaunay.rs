//! Delaunay triangulation of a few thousand points in the plane.

/// A point in the plane.
pub(super) type Point = [f64; 2];

/// Returns the anticlockwise triangles of the points' convex hull (Bowyer 1981; Watson 1981). If four points lie on a
/// common circle, returns one of the possible triangulations.
pub(super) fn triangulate(points: &[Point]) -> Vec<[usize; 3]> {
    let n = points.len();
    let reach = points.iter().flatten().fold(1.0_f64, |reach, c| reach.max(c.abs()));
    let far = 1e4 * reach;
    let mut all = points.to_vec();
    all.extend([[-far, -0.7 * far], [1.1 * far, -far], [0.1 * far, far]]);
    let mut triangles = vec![[n, n + 1, n + 2]];
    for p in 0..n {
        let mut hole: Vec<[usize; 2]> = Vec::new();
        triangles.retain(|&[a, b, c]| {
            let inside = in_circle([all[a], all[b], all[c]], all[p]);
            if inside {
                hole.extend([[a, b], [b, c], [c, a]]);
            }
            !inside
        });
        for &[a, b] in &hole {
            if !hole.contains(&[b, a]) {
                triangles.push([a, b, p]);
            }
        }
    }
    triangles.retain(|triangle| triangle.iter().all(|&corner| corner < n));
    triangles
}

/// Whether a point lies inside the circumcircle of an anticlockwise triangle.
fn in_circle(corners: [Point; 3], p: Point) -> bool {
    let [a, b, c] = corners.map(|q| {
        let d = [q[0] - p[0], q[1] - p[1]];
        [d[0], d[1], d[0] * d[0] + d[1] * d[1]]
    });
    a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0]) + a[2] * (b[0] * c[1] - b[1] * c[0]) > 0.0
}

/// Returns twice the signed area.
pub(super) fn double_area(a: Point, b: Point, c: Point) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

#[cfg(test)]
mod tests {
    use super::super::strip::random_numbers;
    use super::*;

    #[test]
    fn no_point_lies_inside_any_circle_and_the_hull_is_covered() {
        let mut random = random_numbers(7);
        let mut points: Vec<Point> = (0..60).map(|_| [random(), random()]).collect();
        points.extend([[-0.6, -0.6], [0.6, -0.6], [0.6, 0.6], [-0.6, 0.6]]);
        let triangles = triangulate(&points);
        let area: f64 = triangles.iter().map(|&[a, b, c]| 0.5 * double_area(points[a], points[b], points[c])).sum();
        assert!((area - 1.44).abs() < 1e-12, "{area}");
        for &[a, b, c] in &triangles {
            let circle = [points[a], points[b], points[c]];
            let inside = |p: &usize| ![a, b, c].contains(p) && in_circle(circle, points[*p]);
            assert_eq!((0..points.len()).find(inside), None);
        }
    }
}
