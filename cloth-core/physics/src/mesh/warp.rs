use energy_dsl::Vector3;

use super::{MaterialTriangle, TriangleMesh, thread_triangle};
use crate::geometry::{norm, subtract};

/// The direction of the warp in the rest shape.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Warp {
    /// One direction, projected onto each triangle.
    Direction(Vector3<f64>),
    /// The direction in which the first texture coordinate grows, for each triangle its own. Closed garments need this:
    /// no single direction lies along all of them.
    Uv,
}

impl From<Vector3<f64>> for Warp {
    fn from(direction: Vector3<f64>) -> Self {
        Self::Direction(direction)
    }
}

impl TriangleMesh {
    /// Returns the direction in which the first texture coordinate grows along each triangle, as a unit vector; zero if
    /// it does not grow.
    pub fn warps_of(&self, uvs: &[[[f64; 2]; 3]]) -> Vec<Vector3<f64>> {
        let warp = |(triangle, [a, b, c]): (usize, &[[f64; 2]; 3])| -> Vector3<f64> {
            let [p, q, r] = self.corners(triangle);
            let (base, side) = (subtract(q, p), subtract(r, p));
            let determinant = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]);
            let [of_base, of_side] = [c[1] - a[1], -(b[1] - a[1])].map(|part| part * determinant.signum());
            let along: Vector3<f64> = std::array::from_fn(|axis| of_base * base[axis] + of_side * side[axis]);
            let length = norm(along);
            let is_regular = determinant != 0.0 && length > 0.0 && length.is_finite();
            if is_regular { along.map(|component| component / length) } else { [0.0; 3] }
        };
        uvs.iter().enumerate().map(warp).collect()
    }

    /// Maps a triangle to its plane, with the first axis along the warp; see [`thread_triangle`]. `None` if the
    /// triangle stands across the warp or has no texture coordinates that tell it.
    #[must_use]
    pub fn thread_triangle(&self, triangle: usize, warp: Warp) -> Option<MaterialTriangle> {
        let direction = match warp {
            Warp::Direction(direction) => direction,
            Warp::Uv => *self.warps()?.get(triangle)?,
        };
        thread_triangle(self.corners(triangle), direction)
    }
}
