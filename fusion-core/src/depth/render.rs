use nalgebra::Vector3;

use super::camera::Camera;
use super::image::DepthImage;
use crate::body::Mesh;
use crate::random::gaussian;

/// Noise of a structured-light sensor: a standard deviation of k (0.0012 + 0.0019 (z − 0.4)²) m at depth z, then
/// rounding to steps.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct SensorNoise {
    /// Factor k: 1 for the sensor as measured by Khoshelham and Oude Elberink, 0 without noise.
    pub factor: f64,
    /// Step to which depths are rounded, in m; 0 without rounding.
    pub step: f64,
}

impl Default for SensorNoise {
    fn default() -> Self {
        Self { factor: 0.3, step: 0.001 }
    }
}

impl SensorNoise {
    /// Adds noise to every depth.
    pub fn add(&self, image: &mut DepthImage, random: &mut fastrand::Rng) {
        for depth in image.depth.iter_mut().filter(|depth| **depth > 0.0) {
            let z = f64::from(*depth);
            let deviation = self.factor * (0.0012 + 0.0019 * (z - 0.4).powi(2));
            let noisy = z + deviation * gaussian(random);
            *depth = (if self.step > 0.0 { (noisy / self.step).round() * self.step } else { noisy }).max(0.0) as f32;
        }
    }
}

/// Renders the depths of a mesh, in the camera's coordinates, with a z-buffer. Triangles that reach behind the camera
/// are skipped.
#[must_use]
pub fn render(mesh: &Mesh, camera: &Camera) -> DepthImage {
    let mut image = DepthImage::empty(camera.width, camera.height);
    rasterise(mesh, camera, &mut image, |_, _| {});
    image
}

/// Renders as [`render`] does, and returns the triangle that each pixel sees; `None` without one.
#[must_use]
pub fn render_triangles(mesh: &Mesh, camera: &Camera) -> (DepthImage, Vec<Option<u32>>) {
    let mut image = DepthImage::empty(camera.width, camera.height);
    let mut seen = vec![None; image.depth.len()];
    rasterise(mesh, camera, &mut image, |pixel, triangle| seen[pixel] = Some(triangle));
    (image, seen)
}

/// Draws every triangle. Calls `drawn` with a pixel and a triangle that is the nearest so far.
fn rasterise(mesh: &Mesh, camera: &Camera, image: &mut DepthImage, mut drawn: impl FnMut(usize, u32)) {
    let projected: Vec<Option<[f64; 2]>> = mesh.vertices.iter().map(|v| camera.project(v)).collect();
    for (at, triangle) in mesh.triangles.iter().enumerate() {
        let corners = triangle.map(|vertex| projected[vertex as usize]);
        if let [Some(a), Some(b), Some(c)] = corners {
            // Inverse depths are linear in the image.
            let inverse = triangle.map(|vertex| 1.0 / mesh.vertices[vertex as usize].z);
            fill(image, [a, b, c], inverse, |pixel| drawn(pixel, at as u32));
        }
    }
}

fn fill(image: &mut DepthImage, [a, b, c]: [[f64; 2]; 3], inverse: [f64; 3], mut drawn: impl FnMut(usize)) {
    let edge = |p: [f64; 2], q: [f64; 2], x: f64, y: f64| (q[0] - p[0]) * (y - p[1]) - (q[1] - p[1]) * (x - p[0]);
    let area = edge(a, b, c[0], c[1]);
    if area == 0.0 || !area.is_finite() {
        return;
    }
    let range = |axis: usize, size: usize| {
        let (low, high) = (a[axis].min(b[axis]).min(c[axis]), a[axis].max(b[axis]).max(c[axis]));
        (low.ceil().max(0.0) as usize)..(high.floor().min(size as f64 - 1.0) + 1.0).max(0.0) as usize
    };
    for v in range(1, image.height) {
        for u in range(0, image.width) {
            let (x, y) = (u as f64, v as f64);
            let parts = [edge(b, c, x, y) / area, edge(c, a, x, y) / area, edge(a, b, x, y) / area];
            if parts.iter().all(|&part| part >= 0.0) {
                let depth = (1.0 / parts.iter().zip(inverse).map(|(part, inverse)| part * inverse).sum::<f64>()) as f32;
                let pixel = v * image.width + u;
                let place = &mut image.depth[pixel];
                if *place == 0.0 || depth < *place {
                    *place = depth;
                    drawn(pixel);
                }
            }
        }
    }
}

/// Returns which vertices the camera sees: they face it, and lie within 1 cm of the rendered depth.
#[must_use]
pub fn visible_vertices(mesh: &Mesh, camera: &Camera) -> Vec<bool> {
    let image = render(mesh, camera);
    let seen = |(vertex, normal): (&Vector3<f64>, &Vector3<f64>)| {
        let depth = camera.pixel(vertex).and_then(|pixel| image.at(pixel));
        normal.dot(vertex) < 0.0 && depth.is_some_and(|depth| (depth - vertex.z).abs() < 0.01)
    };
    mesh.vertices.iter().zip(&mesh.normals).map(seen).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A square facing the camera at depth 2, and another behind it.
    fn squares() -> Mesh {
        let square = |z: f64, half: f64| [[-half, -half, z], [half, -half, z], [half, half, z], [-half, half, z]];
        let vertices = [square(2.0, 0.5), square(3.0, 0.6)].concat().into_iter().map(Vector3::from).collect();
        Mesh::new(vertices, vec![[0, 3, 1], [1, 3, 2], [4, 7, 5], [5, 7, 6]])
    }

    #[test]
    fn the_nearest_surface_wins() {
        let camera = Camera { fx: 100.0, fy: 100.0, cx: 50.0, cy: 50.0, width: 101, height: 101, distortion: None };
        let image = render(&squares(), &camera);
        assert_eq!(image.at([50, 50]), Some(2.0));
        assert_eq!(image.at([50 + 24, 50]), Some(2.0));
        assert_eq!(image.at([50 + 26, 50]), None);
        let visible = visible_vertices(&squares(), &camera);
        assert_eq!(visible, [true, true, true, true, false, false, false, false]);
    }

    #[test]
    fn noise_has_the_standard_deviation_of_the_model() {
        let mut image = DepthImage { width: 100, height: 100, depth: vec![2.4; 10_000] };
        SensorNoise { factor: 1.0, step: 0.0 }.add(&mut image, &mut fastrand::Rng::with_seed(1));
        let square: f64 = image.depth.iter().map(|&d| (f64::from(d) - 2.4).powi(2)).sum::<f64>() / 1e4;
        assert!((square.sqrt() / 0.0088 - 1.0).abs() < 0.03, "{}", square.sqrt());
        SensorNoise { factor: 0.0, step: 0.001 }.add(&mut image, &mut fastrand::Rng::with_seed(1));
        assert!(
            image.depth.iter().all(|&d| (f64::from(d) * 1e3).fract().min(1.0 - (f64::from(d) * 1e3).fract()) < 1e-3)
        );
    }
}
