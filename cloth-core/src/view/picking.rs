use std::ops::Range;

use energy_dsl::Vector3;

use super::orbit::{Orbit, Ray};
use crate::geometry::{cross, dot, subtract};

/// Largest distance between mouse and a joint of hair, in pixels.
const REACH: f64 = 8.0;

/// The vertex under the mouse.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Picked {
    /// Index of the vertex.
    pub vertex: usize,
    /// Depth of the vertex, in m.
    pub depth: f64,
}

/// Returns the vertex under a pixel of a picture of this size; `None` for the background. It is the nearest corner of
/// the foremost triangle, or a joint of hair within a few pixels that the triangle does not hide.
#[must_use]
pub fn pick(
    camera: &Orbit,
    pixel: [f64; 2],
    size: [f64; 2],
    positions: &[Vector3<f64>],
    triangles: &[[usize; 3]],
    strands: &[Range<usize>],
) -> Option<Picked> {
    let ray = camera.ray(pixel, size);
    let met =
        |&corners: &[usize; 3]| intersect(&ray, corners.map(|corner| positions[corner])).map(|hit| (corners, hit));
    let foremost = triangles.iter().filter_map(met).min_by(|a, b| a.1.distance.total_cmp(&b.1.distance));
    let seen = |vertex: usize| {
        let depth = camera.project(positions[vertex], size)?.depth;
        Some(Picked { vertex, depth })
    };
    let on_cloth = foremost.and_then(|(corners, hit)| {
        let nearest = (0..3).max_by(|&a, &b| hit.weights[a].total_cmp(&hit.weights[b]))?;
        seen(corners[nearest])
    });
    let joints = strands.iter().flat_map(Clone::clone).filter_map(|vertex| {
        let seen = camera.project(positions[vertex], size)?;
        let apart = (seen.pixel[0] - pixel[0]).hypot(seen.pixel[1] - pixel[1]);
        let hidden = on_cloth.is_some_and(|cloth| cloth.depth < seen.depth);
        (apart <= REACH && !hidden).then_some((apart, Picked { vertex, depth: seen.depth }))
    });
    joints.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, joint)| joint).or(on_cloth)
}

/// The intersection of a ray with a triangle.
struct Hit {
    /// Distance from the ray's origin, in m.
    distance: f64,
    /// Barycentric weights of the corners.
    weights: [f64; 3],
}

/// Intersects a ray with a two-sided triangle (Möller & Trumbore 1997).
fn intersect(ray: &Ray, [a, b, c]: [Vector3<f64>; 3]) -> Option<Hit> {
    let (ab, ac) = (subtract(b, a), subtract(c, a));
    let across = cross(ray.direction, ac);
    let determinant = dot(ab, across);
    if determinant == 0.0 {
        return None;
    }
    let offset = subtract(ray.origin, a);
    let u = dot(offset, across) / determinant;
    let turned = cross(offset, ab);
    let v = dot(ray.direction, turned) / determinant;
    let distance = dot(ac, turned) / determinant;
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && distance > 0.0).then_some(Hit { distance, weights: [1.0 - u - v, u, v] })
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIZE: [f64; 2] = [640.0, 480.0];

    #[test]
    fn the_foremost_corner_under_the_mouse_is_picked() {
        // Two squares, one behind the other seen from −y.
        let square = |y: f64| [[-1.0, y, -1.0], [1.0, y, -1.0], [1.0, y, 1.0], [-1.0, y, 1.0]];
        let positions: Vec<Vector3<f64>> = square(1.0).into_iter().chain(square(0.0)).collect();
        let triangles = [[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]];
        let camera = Orbit { target: [0.0; 3], distance: 10.0, azimuth: -std::f64::consts::FRAC_PI_2, elevation: 0.1 };
        for vertex in 4..8 {
            let towards_middle = positions[vertex].map(|c| 0.9 * c);
            let pixel = camera.project(towards_middle, SIZE).unwrap().pixel;
            let picked = pick(&camera, pixel, SIZE, &positions, &triangles, &[]).unwrap();
            assert_eq!(picked.vertex, vertex);
            assert_eq!(picked.depth, camera.project(positions[vertex], SIZE).unwrap().depth);
            // From behind, the other square is in front.
            let turned = Orbit { azimuth: -camera.azimuth, ..camera };
            let pixel = turned.project(positions[vertex - 4].map(|c| 0.95 * c), SIZE).unwrap().pixel;
            assert_eq!(pick(&turned, pixel, SIZE, &positions, &triangles, &[]).unwrap().vertex, vertex - 4);
        }
        assert_eq!(pick(&camera, [1.0, 1.0], SIZE, &positions, &triangles, &[]), None);
    }

    #[test]
    fn hair_is_picked_within_a_few_pixels_unless_cloth_hides_it() {
        let camera = Orbit { target: [0.0; 3], distance: 10.0, azimuth: -std::f64::consts::FRAC_PI_2, elevation: 0.0 };
        let mut positions = vec![[0.0, 0.0, 0.0], [0.0, 0.0, 0.5], [0.0, 0.0, 1.0]];
        let strand = 0..3;
        let [x, y] = camera.project(positions[1], SIZE).unwrap().pixel;
        let hair = pick(&camera, [x + 5.0, y], SIZE, &positions, &[], std::slice::from_ref(&strand));
        assert_eq!(hair.map(|picked| picked.vertex), Some(1));
        assert_eq!(pick(&camera, [x + 9.0, y], SIZE, &positions, &[], std::slice::from_ref(&strand)), None);
        positions.extend([[-3.0, -1.0, -3.0], [3.0, -1.0, -3.0], [0.0, -1.0, 5.0]]);
        let hidden = pick(&camera, [x, y], SIZE, &positions, &[[3, 4, 5]], std::slice::from_ref(&strand)).unwrap();
        assert!(hidden.vertex >= 3, "{hidden:?}");
    }
}
