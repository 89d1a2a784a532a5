//! Strain along warp and weft, and shear, over a garment.

use energy_dsl::Vector3;
use serde::{Deserialize, Serialize};

use crate::geometry::{dot, norm, subtract};
use crate::mesh::{TriangleMesh, Warp};

/// The part of the area below the low end of a [`Distribution`], and above its high end.
const TAIL: f64 = 0.05;

/// The distribution of a quantity over the area at rest.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Distribution {
    /// Mean over the area.
    pub mean: f64,
    /// The value of largest magnitude, with its sign.
    pub largest: f64,
    /// 5th percentile: 5 % of the area have at most this value.
    pub low: f64,
    /// 95th percentile: 95 % of the area have at most this value.
    pub high: f64,
}

impl Distribution {
    /// Creates the distribution of values with weights; `None` if the weights add up to nothing.
    fn of(mut values: Vec<(f64, f64)>) -> Option<Self> {
        let total: f64 = values.iter().map(|(_, weight)| weight).sum();
        if total.is_nan() || total <= 0.0 {
            return None;
        }
        let mean = values.iter().map(|(value, weight)| value * weight).sum::<f64>() / total;
        let larger = |most: f64, (value, _): &(f64, f64)| if value.abs() > most.abs() { *value } else { most };
        let largest = values.iter().fold(0.0, larger);
        values.sort_by(|one, other| one.0.total_cmp(&other.0));
        let percentile = |part: f64| {
            let mut below = 0.0;
            let reaches = |(_, weight): &&(f64, f64)| {
                below += weight;
                below >= part * total
            };
            values.iter().find(reaches).or(values.last()).map_or(0.0, |(value, _)| *value)
        };
        Some(Self { mean, largest, low: percentile(TAIL), high: percentile(1.0 - TAIL) })
    }
}

/// Strain of a garment relative to its rest shape. With the deformed unit vectors a and b along warp and weft, the
/// engineering strains are ‖a‖ − 1 and ‖b‖ − 1, and the shear angle is asin(a·b / (‖a‖ ‖b‖)): what testers print.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Strain {
    /// Engineering strain along the warp.
    pub warp: Distribution,
    /// Engineering strain along the weft.
    pub weft: Distribution,
    /// Shear angle in degrees: 90° minus the angle between the threads.
    pub shear: Distribution,
}

/// Measures the strain of a garment.
///
/// ```
/// use cloth_core::measure::StrainGauge;
/// use cloth_core::physics::mesh::TriangleMesh;
/// let rest = TriangleMesh::new(vec![[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]], vec![[0, 1, 2]])?;
/// let gauge = StrainGauge::new(&rest, [1.0, 0.0, 0.0].into());
/// let strain = gauge.strain(&[[0.0; 3], [1.1, 0.0, 0.0], [0.5, 0.0, 0.5 * 3_f64.sqrt()]]).unwrap();
/// assert!((strain.warp.mean - 0.1).abs() < 1e-15 && strain.weft.mean.abs() < 1e-15);
/// assert!((strain.shear.largest - 30.0).abs() < 1e-12);
/// # Ok::<(), cloth_core::physics::mesh::MeshError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct StrainGauge {
    triangles: Vec<ThreadTriangle>,
}

/// A triangle whose threads are known.
#[derive(Clone, Copy, Debug, PartialEq)]
struct ThreadTriangle {
    corners: [usize; 3],
    /// Coefficients of the two edges from the first corner in the deformed unit vectors along warp and weft, in 1/m.
    along: [[f64; 2]; 2],
    /// Area at rest, in m².
    area: f64,
}

impl StrainGauge {
    /// Creates the gauge of a rest mesh. Triangles without a warp direction, and those without area, do not count.
    #[must_use]
    pub fn new(mesh: &TriangleMesh, warp: Warp) -> Self {
        let thread = |(triangle, &corners): (usize, &[usize; 3])| {
            let [_, b, c] = mesh.thread_triangle(triangle, warp)?;
            let double_area = b[0] * c[1] - b[1] * c[0];
            let along = [[c[1], -b[1]], [-c[0], b[0]]].map(|row| row.map(|entry| entry / double_area));
            let is_regular = along.as_flattened().iter().all(|entry| entry.is_finite());
            is_regular.then_some(ThreadTriangle { corners, along, area: 0.5 * double_area.abs() })
        };
        Self { triangles: mesh.triangles().iter().enumerate().filter_map(thread).collect() }
    }

    /// The area at rest that counts, in m².
    #[must_use]
    pub fn area(&self) -> f64 {
        self.triangles.iter().map(|triangle| triangle.area).sum()
    }

    /// Returns the strain at positions in m, in the numbering of the mesh; `None` if no triangle has a warp direction.
    #[must_use]
    pub fn strain(&self, x: &[Vector3<f64>]) -> Option<Strain> {
        let count = self.triangles.len();
        let [mut warp, mut weft, mut shear] = [(); 3].map(|()| Vec::with_capacity(count));
        for &ThreadTriangle { corners: [a, b, c], along, area } in &self.triangles {
            let edges = [subtract(x[b], x[a]), subtract(x[c], x[a])];
            let [u, v] = along.map(|[of_base, of_side]| -> Vector3<f64> {
                std::array::from_fn(|axis| of_base * edges[0][axis] + of_side * edges[1][axis])
            });
            let lengths = [norm(u), norm(v)];
            let sine = dot(u, v) / (lengths[0] * lengths[1]);
            warp.push((lengths[0] - 1.0, area));
            weft.push((lengths[1] - 1.0, area));
            // A collapsed triangle has no angle between its threads.
            shear.push((if sine.is_finite() { sine.clamp(-1.0, 1.0).asin().to_degrees() } else { 0.0 }, area));
        }
        let of = Distribution::of;
        Some(Strain { warp: of(warp)?, weft: of(weft)?, shear: of(shear)? })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_are_weighted_by_area() {
        // 4 % of the area at −3, 92 % at 1, 4 % at 2: both percentiles lie in the middle.
        let values = vec![(2.0, 0.04), (-3.0, 0.04), (1.0, 0.92)];
        let found = Distribution::of(values).unwrap();
        assert!((found.mean - 0.88).abs() < 1e-15);
        assert_eq!((found.largest, found.low, found.high), (-3.0, 1.0, 1.0));
        let found = Distribution::of(vec![(2.0, 0.06), (-3.0, 0.06), (1.0, 0.88)]).unwrap();
        assert_eq!((found.low, found.high), (-3.0, 2.0));
        assert_eq!(Distribution::of(Vec::new()), None);
    }

    #[test]
    fn a_rotation_is_no_strain_and_a_warp_across_counts_nothing() {
        let rest = vec![[0.0; 3], [1.0, 0.2, 0.0], [-0.3, 0.8, 0.0]];
        let mesh = TriangleMesh::new(rest.clone(), vec![[0, 1, 2]]).unwrap();
        let turned: Vec<_> = rest.iter().map(|[x, y, z]| [*z, *x, *y]).collect();
        let strain = StrainGauge::new(&mesh, [0.6, 0.8, 0.0].into()).strain(&turned).unwrap();
        let all = [strain.warp.largest, strain.weft.largest, strain.shear.largest];
        assert!(all.iter().all(|value| value.abs() < 1e-13), "{all:?}");
        let across = StrainGauge::new(&mesh, [0.0, 0.0, 1.0].into());
        assert_eq!((across.area(), across.strain(&turned)), (0.0, None));
    }
}
