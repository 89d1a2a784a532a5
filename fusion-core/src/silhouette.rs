//! Matches from the image to the model, for measured points that the model leaves uncovered.
//!
//! [`correspondences`](crate::correspondence::correspondences) goes from vertices to pixels. A flat limb can then slide
//! across its own image: vertices past its edge meet no depth and exert no pull. The pixels on the other side, which no
//! part of the model covers, have a depth, and pull the edge back.

use nalgebra::Vector3;

use crate::body::Mesh;
use crate::depth::{Camera, DepthImage, PixelRays, render_triangles};
use crate::energy::Pair;

/// The body as the camera sees it at reduced resolution.
#[derive(Clone, Debug)]
pub struct BodyView {
    camera: Camera,
    depth: DepthImage,
    triangles: Vec<Option<u32>>,
}

impl BodyView {
    /// Pixels of the camera, along each axis, per pixel of the view.
    pub const REDUCTION: usize = 4;

    /// Renders a mesh, in the camera's coordinates.
    #[must_use]
    pub fn new(mesh: &Mesh, camera: &Camera) -> Self {
        let camera = Self::camera(camera);
        let (depth, triangles) = render_triangles(mesh, &camera);
        Self { camera, depth, triangles }
    }

    /// Returns a camera whose pixel (u, v) sees exactly what one pixel of the full camera sees, [`Self::full_pixel`].
    /// An offset of half a pixel would count the points on one side of every limb as uncovered.
    fn camera(full: &Camera) -> Camera {
        let (by, [x, y]) = (Self::REDUCTION as f64, Self::full_pixel([0, 0]).map(|at| at as f64));
        Camera { cx: (full.cx - x) / by, cy: (full.cy - y) / by, ..full.reduced(Self::REDUCTION) }
    }

    /// Returns the pixel of the full camera at the centre of a pixel of the view.
    fn full_pixel(pixel: [usize; 2]) -> [usize; 2] {
        pixel.map(|at| at * Self::REDUCTION + Self::REDUCTION / 2)
    }

    /// Returns the triangle that a pixel of the full camera sees; `None` without one.
    #[must_use]
    pub fn triangle(&self, [u, v]: [usize; 2]) -> Option<u32> {
        let (x, y) = (u / Self::REDUCTION, v / Self::REDUCTION);
        self.triangles[y * self.camera.width + x]
    }

    /// Returns which vertices lie more than `tolerance` m behind the surface that the camera sees, such as the trunk
    /// behind an arm.
    #[must_use]
    pub fn hidden(&self, vertices: &[Vector3<f64>], tolerance: f64) -> Vec<bool> {
        let behind = |vertex: &Vector3<f64>| {
            let depth = self.camera.pixel(vertex).and_then(|pixel| self.depth.at(pixel));
            depth.is_some_and(|depth| vertex.z > depth + tolerance)
        };
        vertices.iter().map(behind).collect()
    }

    /// Matches each measured point whose pixel the body does not cover with the nearest visible vertex, at most
    /// `distance` m away. Looks at one pixel in [`Self::REDUCTION`]², in the order of rows.
    ///
    /// `mesh` is the rendered mesh; `origin` is the model's origin in the camera's coordinates.
    #[must_use]
    pub fn uncovered(
        &self,
        mesh: &Mesh,
        image: &DepthImage,
        rays: &PixelRays,
        origin: &Vector3<f64>,
        distance: f64,
    ) -> Vec<Pair> {
        let mut pairs = Vec::new();
        for v in 0..self.camera.height {
            for u in 0..self.camera.width {
                if self.depth.at([u, v]).is_some() {
                    continue;
                }
                let centre = Self::full_pixel([u, v]);
                if centre[0] >= image.width || centre[1] >= image.height {
                    continue;
                }
                let Some(depth) = image.at(centre) else { continue };
                let point = rays.point(centre, depth);
                if let Some(vertex) = self.nearest(mesh, [u, v], &point, distance) {
                    pairs.push(Pair { vertex, point: point - origin });
                }
            }
        }
        pairs
    }

    /// Returns the vertex nearest to a point, among those of the triangles seen around a pixel.
    fn nearest(&self, mesh: &Mesh, [u, v]: [usize; 2], point: &Vector3<f64>, distance: f64) -> Option<u32> {
        let reach = |focal: f64| (distance * focal / point.z).ceil() as usize;
        let (across, down) = (reach(self.camera.fx), reach(self.camera.fy));
        let columns = u.saturating_sub(across)..(u + across + 1).min(self.camera.width);
        let mut best = (distance * distance, None);
        for y in v.saturating_sub(down)..(v + down + 1).min(self.camera.height) {
            for x in columns.clone() {
                let Some(triangle) = self.triangles[y * self.camera.width + x] else { continue };
                for vertex in mesh.triangles[triangle as usize] {
                    let square = (mesh.vertices[vertex as usize] - point).norm_squared();
                    if square < best.0 {
                        best = (square, Some(vertex));
                    }
                }
            }
        }
        best.1
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::{figure, figure_motion};
    use crate::depth::render;
    use crate::protocol::Recording;

    fn standing() -> Mesh {
        Recording::new(&figure(), &[figure_motion(0.0)], Camera::VGA, 2.6).truth(0)
    }

    #[test]
    fn uncovered_points_pull_a_shifted_body_back() {
        let image = render(&standing(), &Camera::VGA);
        let rays = PixelRays::new(Camera::VGA).unwrap();
        let pairs = |shift: f64| {
            let mut mesh = standing();
            mesh.vertices.iter_mut().for_each(|vertex| vertex.x += shift);
            let view = BodyView::new(&mesh, &Camera::VGA);
            let pairs = view.uncovered(&mesh, &image, &rays, &Vector3::zeros(), 0.06);
            let pull = |pair: &Pair| mesh.normals[pair.vertex as usize].x.signum() * shift.signum();
            (pairs.len(), pairs.iter().map(pull).sum::<f64>() / pairs.len().max(1) as f64)
        };
        let (at_rest, _) = pairs(0.0);
        for shift in [-0.03, 0.03] {
            let (count, pull) = pairs(shift);
            assert!(count > 4 * at_rest.max(20), "{count} uncovered points, {at_rest} at rest");
            assert!(pull < -0.8, "edges on the side that the body left: {pull}");
        }
    }

    #[test]
    fn vertices_behind_the_body_are_hidden() {
        let square = |z: f64, half: f64| [[-half, -half, z], [half, -half, z], [half, half, z], [-half, half, z]];
        let vertices = [square(2.0, 0.5), square(2.1, 0.4)].concat().into_iter().map(Vector3::from).collect();
        let mesh = Mesh::new(vertices, vec![[0, 3, 1], [1, 3, 2], [4, 7, 5], [5, 7, 6]]);
        let view = BodyView::new(&mesh, &Camera::VGA);
        assert_eq!(view.hidden(&mesh.vertices, 0.03), [false, false, false, false, true, true, true, true]);
        assert_eq!(view.hidden(&mesh.vertices, 0.2), [false; 8]);
    }
}
