use nalgebra::{Matrix3, Vector3};

use super::image::DepthImage;
use super::pixel_rays::PixelRays;

/// The normal of a measured surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SurfaceNormal {
    /// Unit vector towards the camera.
    pub normal: Vector3<f64>,
    /// Number from 0 to 1: the information about the less certain slope, as a fraction of that of a window without
    /// holes. The variance of the slope is inversely proportional to it.
    pub confidence: f64,
}

/// Steepest surface, as the tangent of its angle to the image plane, whose pixels are still neighbours.
const STEEPEST: f64 = 4.0;
/// Difference of depth between neighbours that noise explains, in m.
const NOISE: f64 = 0.01;
/// Least confidence of a normal.
const LEAST_CONFIDENCE: f64 = 0.03;

impl DepthImage {
    /// Returns the normal of the surface at a pixel: of the plane fitted to the measured pixels up to `reach` pixels
    /// away on each side that belong to the same surface. `None` without a depth, or if the neighbours that exist do
    /// not determine a plane.
    ///
    /// The inverse depth of a plane is linear in the rays, 1/z = a Δu + b Δv + c, so the fit is linear least squares.
    /// u and v are the ray's coordinates times the focal lengths, which are the pixel's for a pinhole.
    /// A neighbour belongs to another surface if its depth differs more than that of a steep surface would.
    #[must_use]
    pub fn normal(&self, rays: &PixelRays, [u, v]: [usize; 2], reach: usize) -> Option<SurfaceNormal> {
        let camera = rays.camera();
        let centre = rays.ray([u, v]);
        let here = self.at([u, v])?;
        let (left, right) = (u.saturating_sub(reach), (u + reach).min(self.width - 1));
        let (top, bottom) = (v.saturating_sub(reach), (v + reach).min(self.height - 1));
        let slope = STEEPEST * here / camera.fx.min(camera.fy);
        let mut sums = Sums::default();
        for y in top..=bottom {
            let row = &self.depth[y * self.width..][..self.width];
            let down = y as f64 - v as f64;
            for (x, &depth) in row.iter().enumerate().take(right + 1).skip(left) {
                let (depth, across) = (f64::from(depth), x as f64 - u as f64);
                let limit = NOISE + slope * across.abs().max(down.abs());
                if depth > 0.0 && (depth - here).abs() <= limit {
                    let offset = if rays.is_pinhole() {
                        [across, down]
                    } else {
                        let ray = rays.ray([x, y]);
                        [camera.fx * (ray[0] - centre[0]), camera.fy * (ray[1] - centre[1])]
                    };
                    sums.add(offset, 1.0 / depth);
                }
            }
        }
        let confidence = sums.least_spread() / full_spread(reach);
        if confidence.is_nan() || confidence < LEAST_CONFIDENCE {
            return None;
        }
        let [a, b, c] = sums.plane()?;
        let [x, y] = [a * camera.fx, b * camera.fy];
        let normal = Vector3::new(x, y, c - x * centre[0] - y * centre[1]);
        // n·p = 1 for a normal that points into the scene.
        (-normal).try_normalize(0.0).map(|normal| SurfaceNormal { normal, confidence: confidence.min(1.0) })
    }
}

/// The normals of one image. Each is fitted once, when it is first asked for.
#[derive(Clone, Debug)]
pub struct NormalMap<'a> {
    /// Image to fit the normals to.
    pub image: &'a DepthImage,
    /// The rays of its pixels.
    pub rays: &'a PixelRays,
    reach: usize,
    /// One more than the index in `fitted` of each pixel's normal; 0 before it is fitted.
    index: Vec<u32>,
    fitted: Vec<Option<SurfaceNormal>>,
}

impl<'a> NormalMap<'a> {
    /// Creates a map of normals fitted up to `reach` pixels on each side; see [`DepthImage::normal`].
    #[must_use]
    pub fn new(image: &'a DepthImage, rays: &'a PixelRays, reach: usize) -> Self {
        Self { image, rays, reach, index: vec![0; image.depth.len()], fitted: Vec::new() }
    }

    /// Returns the normal at a pixel of the image; `None` if it cannot be determined.
    pub fn at(&mut self, pixel: [usize; 2]) -> Option<SurfaceNormal> {
        let index = &mut self.index[pixel[1] * self.image.width + pixel[0]];
        if *index == 0 {
            self.fitted.push(self.image.normal(self.rays, pixel, self.reach));
            *index = self.fitted.len() as u32;
        }
        self.fitted[*index as usize - 1]
    }
}

/// Returns the sum of Δu² over a window without holes.
fn full_spread(reach: usize) -> f64 {
    let (r, side) = (reach as f64, (2 * reach + 1) as f64);
    side * r * (r + 1.0) * side / 3.0
}

/// Sums of a linear fit of w over (u, v).
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    count: f64,
    u: f64,
    v: f64,
    uu: f64,
    uv: f64,
    vv: f64,
    w: f64,
    uw: f64,
    vw: f64,
}

impl Sums {
    fn add(&mut self, [u, v]: [f64; 2], w: f64) {
        self.count += 1.0;
        self.u += u;
        self.v += v;
        self.uu += u * u;
        self.uv += u * v;
        self.vv += v * v;
        self.w += w;
        self.uw += u * w;
        self.vw += v * w;
    }

    /// Returns the smaller eigenvalue of Σ d dᵀ, with the offsets d = (Δu, Δv) from their mean.
    fn least_spread(&self) -> f64 {
        let uu = self.uu - self.u * self.u / self.count;
        let vv = self.vv - self.v * self.v / self.count;
        let uv = self.uv - self.u * self.v / self.count;
        0.5 * (uu + vv) - (0.5 * (uu - vv)).hypot(uv)
    }

    /// Returns a, b and c of w = a u + b v + c.
    fn plane(&self) -> Option<[f64; 3]> {
        let matrix = Matrix3::new(self.uu, self.uv, self.u, self.uv, self.vv, self.v, self.u, self.v, self.count);
        let solved = matrix.cholesky()?.solve(&Vector3::new(self.uw, self.vw, self.w));
        Some(solved.into())
    }
}

#[cfg(test)]
mod tests {
    use super::super::camera::Camera;
    use super::super::distortion::DistortionCoefficients;
    use super::*;

    const CAMERA: Camera = Camera { fx: 100.0, fy: 100.0, cx: 10.0, cy: 10.0, width: 21, height: 21, distortion: None };

    fn rays() -> PixelRays {
        PixelRays::new(CAMERA).unwrap()
    }

    /// An image of the plane n·p = n·(0, 0, 2).
    fn plane(n: Vector3<f64>) -> DepthImage {
        plane_through(&rays(), n)
    }

    fn plane_through(rays: &PixelRays, n: Vector3<f64>) -> DepthImage {
        let mut image = DepthImage::empty(21, 21);
        for v in 0..21 {
            for u in 0..21 {
                let ray = rays.point([u, v], 1.0);
                image.depth[v * 21 + u] = (2.0 * n.z / n.dot(&ray)) as f32;
            }
        }
        image
    }

    fn slanted() -> Vector3<f64> {
        Vector3::new(0.3, -0.2, -1.0).normalize()
    }

    #[test]
    fn normals_of_a_slanted_plane_point_to_the_camera() {
        let image = plane(slanted());
        for pixel in [[7, 12], [0, 12], [20, 20]] {
            let found = image.normal(&rays(), pixel, 2).unwrap();
            assert!((found.normal - slanted()).norm() < 1e-4, "{pixel:?}: {found:?}");
            let inside = pixel == [7, 12];
            assert_eq!(found.confidence > 0.999, inside, "{pixel:?}: {found:?}");
        }
    }

    #[test]
    fn a_distorted_lens_does_not_bend_a_plane() {
        // The factor q falls from 1 to 0.9 at the corners.
        let coefficients = DistortionCoefficients { k1: -5.0, ..DistortionCoefficients::default() };
        let rays = PixelRays::new(Camera { distortion: Some(coefficients.into()), ..CAMERA }).unwrap();
        let image = plane_through(&rays, slanted());
        for pixel in [[7, 12], [2, 2], [20, 20]] {
            let found = image.normal(&rays, pixel, 2).unwrap();
            assert!((found.normal - slanted()).norm() < 1e-4, "{pixel:?}: {found:?}");
        }
    }

    #[test]
    fn holes_lower_the_confidence_only() {
        let mut random = fastrand::Rng::with_seed(5);
        for (missing, least) in [(0.2, 0.7), (0.5, 0.35), (0.8, 0.05)] {
            let mut image = plane(slanted());
            image.depth.iter_mut().filter(|_| random.f64() < missing).for_each(|depth| *depth = 0.0);
            let inside = (2..19).flat_map(|v| (2..19).map(move |u| [u, v]));
            let found: Vec<SurfaceNormal> = inside.filter_map(|pixel| image.normal(&rays(), pixel, 2)).collect();
            assert!(found.iter().all(|one| (one.normal - slanted()).norm() < 1e-4), "{missing}");
            let mean = found.iter().map(|one| one.confidence).sum::<f64>() / found.len() as f64;
            assert!((least..1.0 - missing + 0.05).contains(&mean), "{missing} missing: confidence {mean}");
        }
    }

    #[test]
    fn pixels_of_another_surface_do_not_count() {
        let mut image = plane(slanted());
        for v in 0..21 {
            image.depth[v * 21..][11..21].fill(3.0);
        }
        let found = image.normal(&rays(), [10, 10], 2).unwrap();
        assert!((found.normal - slanted()).norm() < 1e-4, "{found:?}");
        assert!(found.confidence < 0.6, "{found:?}");
    }

    #[test]
    fn a_map_repeats_the_normals_of_the_image() {
        let image = plane(slanted());
        let rays = rays();
        let mut map = NormalMap::new(&image, &rays, 2);
        for pixel in [[3, 4], [20, 0], [3, 4], [4, 3]] {
            assert_eq!(map.at(pixel), image.normal(&rays, pixel, 2), "{pixel:?}");
        }
        assert_eq!(map.fitted.len(), 3, "the repeated pixel is fitted once");
    }

    #[test]
    fn pixels_on_a_line_have_no_normal() {
        let mut image = DepthImage::empty(21, 21);
        assert_eq!(image.normal(&rays(), [10, 10], 2), None);
        image.depth[10 * 21 + 10] = 2.0;
        assert_eq!(image.normal(&rays(), [10, 10], 2), None);
        image.depth[10 * 21..][..21].fill(2.0);
        assert_eq!(image.normal(&rays(), [10, 10], 2), None);
        image.depth[11 * 21 + 9] = f32::NAN;
        assert_eq!(image.normal(&rays(), [10, 10], 2), None);
    }
}
