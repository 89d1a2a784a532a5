//! Critical loads of rods. A load is critical where the smallest eigenvalue of the Hessian vanishes.

use energy_dsl::energy;
use energy_solve::{MixedSystem, MixedTerm};

use super::ValidateError;
use super::rod::{Ends, Loaded, Rod, Vector, arc, ring, weights};
use crate::validate::critical_load::{Symmetry, critical_load};

/// Returns the largest load, or another number, that passes, within a relative tolerance. It is below `high`.
pub(super) fn largest(
    high: f64,
    tolerance: f64,
    mut passes: impl FnMut(f64) -> Result<bool, ValidateError>,
) -> Result<f64, ValidateError> {
    let (mut low, mut high) = (0.0, high);
    while high - low > tolerance * high {
        let load = 0.5 * (low + high);
        *(if passes(load)? { &mut low } else { &mut high }) = load;
    }
    Ok(0.5 * (low + high))
}

/// Returns w L³/B at which a column buckles under its own weight. A small force at the top measures its stiffness.
pub(super) fn heavy_column(segments: usize) -> Result<f64, ValidateError> {
    let points: Vec<Vector> = arc(1.0, 0.0, segments).into_iter().map(|[x, ..]| [0.0, 0.0, x]).collect();
    let mut rod = Rod::new(points, [0.0, 1.0, 0.0], Ends::Clamped, [1.0, 1.0], 1.0);
    rod.loads = weights(segments + 2, 1.0 / segments as f64, [0.0, 0.0, -1.0]);
    let force = 1e-6;
    rod.dead_loads[segments + 1] = [force, 0.0, 0.0];
    critical_load("the column", Symmetry::None, 4.0, |gamma| {
        let mut loaded = rod.at_rest()?;
        let report = loaded.settle(gamma)?;
        let moved = loaded.tip()[0];
        Ok((report.converged() && moved > 0.0 && moved < 0.01).then_some(force / moved))
    })
}

/// Returns the twist at which a ring of radius 1 that is closed from a straight rod leaves its plane.
pub(super) fn twisted_ring(stiffness_ratio: f64, segments: usize) -> Result<f64, ValidateError> {
    largest(40.0, 1e-4, |twist| {
        let mut rod = Rod::new(ring(segments), [0.0, 0.0, 1.0], Ends::Ring(twist), [stiffness_ratio; 2], 1.0);
        rod.stretching = 1e5 * stiffness_ratio;
        // The flat ring is at rest but for tiny changes of its radius.
        stays_straight(&mut rod.at_rest()?, 0.0)
    })
}

/// Whether Newton's method finds the equilibrium next to the start, and it is a minimum.
fn stays_straight(loaded: &mut Loaded, factor: f64) -> Result<bool, ValidateError> {
    let report = loaded.settle(factor)?;
    Ok(report.converged() && report.projected == 0)
}

/// A load on a strip that bends 10⁵ times more easily sideways than up and down, until it tips over.
#[derive(Clone, Copy, Debug)]
pub(super) enum Tipping {
    /// A cantilever with a force on its tip.
    TipLoad,
    /// A cantilever under its own weight.
    OwnWeight,
    /// A hinged beam with a force on its middle.
    MidLoad,
    /// A hinged beam with opposite moments on its ends.
    EndMoments,
}

impl Tipping {
    /// All loads, with the critical values of P L², w L³ and M L over √(B C) (Timoshenko and Gere 1961, chapter 6).
    pub(super) const ALL: [(Self, &'static str, f64); 4] = [
        (Self::TipLoad, "tip load", 4.012_599_3),
        (Self::OwnWeight, "own weight", 12.853_763_3),
        (Self::MidLoad, "mid load", 16.936_132_2),
        (Self::EndMoments, "end moments", std::f64::consts::PI),
    ];

    fn rod(self, segments: usize) -> Rod {
        let sideways: Vector = [0.0, 1.0, 0.0];
        let spacing = 1.0 / segments as f64;
        let mut rod = match self {
            Self::TipLoad | Self::OwnWeight => {
                Rod::new(arc(1.0, 0.0, segments), sideways, Ends::Clamped, [1e5, 1.0], 1.0)
            }
            Self::MidLoad | Self::EndMoments => {
                let points = (0..=segments).map(|point| [point as f64 * spacing, 0.0, 0.0]).collect();
                Rod::new(points, sideways, Ends::Hinged, [1e5, 1.0], 1.0)
            }
        };
        // Between fixed hinges, a deflection stretches the rod. The tension must stay far below B/L².
        rod.stretching = 1e5;
        match self {
            Self::TipLoad => rod.loads[segments + 1] = [0.0, 0.0, -1.0],
            Self::OwnWeight => rod.loads = weights(segments + 2, spacing, [0.0, 0.0, -1.0]),
            Self::MidLoad => rod.loads[segments / 2] = [0.0, 0.0, -1.0],
            Self::EndMoments => {}
        }
        rod
    }

    /// Returns the critical load, for B = C = L = 1.
    pub(super) fn critical(self, segments: usize) -> Result<f64, ValidateError> {
        largest(40.0, 1e-7, |load| {
            let rod = self.rod(segments);
            let moments = match self {
                Self::EndMoments => {
                    let sideways = [0.0, 1.0, 0.0];
                    vec![rod.moments(&[(0, -1.0, sideways), (segments - 1, 1.0, sideways)])?]
                }
                _ => Vec::new(),
            };
            stays_straight(&mut rod.at_rest_with(moments)?, load)
        })
    }
}

energy! {
    /// A spring that keeps a point on the x axis.
    energy Roller(x: Point; k: Scalar[N/m]) { k / 2 * (x.y^2 + x.z^2) }

    /// A moment s M on the angle of twist of an edge.
    energy Torque(twist: Scalar[rad], shared s: Scalar[1]; M: Scalar[N m]) { -s * M * twist }
}

/// Returns M²/4B² + P/B, times L²/π², at which a strut with a compression P and a torque M on its ends buckles. They
/// may turn, and the torque keeps its axis (Greenhill 1883). P is given in units of π² B/L².
///
/// Such a torque has no potential. That of the angle of twist has the moment M (e + t)/(1 + e·t), halfway between the
/// axis e and the tangent t. The rest, ½ M (e − t), adds a skew part to the Hessian, of rank 4: it belongs to the tilts
/// of both end edges. So the stiffness against a force on the middle decides, by the formula of Sherman, Morrison and
/// Woodbury.
pub(super) fn twisted_strut(compression: f64, segments: usize) -> Result<f64, ValidateError> {
    let squared = std::f64::consts::PI * std::f64::consts::PI;
    let spacing = 1.0 / segments as f64;
    let points = (0..=segments).map(|point| [point as f64 * spacing, 0.0, 0.0]).collect();
    let mut rod = Rod::new(points, [0.0, 1.0, 0.0], Ends::Strut, [1.0; 2], 1.0);
    rod.dead_loads[segments] = [-compression * squared, 0.0, 0.0];
    rod.stretching = 1e8;
    let torque = largest(10.0, 1e-9, |torque| {
        // Evenly twisted, C = 1.
        rod.twists = (0..segments).map(|edge| torque * edge as f64 * spacing).collect();
        let roller = MixedTerm::of_points("roller", vec![Roller::new(1e9)], &[[rod.point(segments)]])?;
        let twisting = MixedTerm::new("torque", vec![Torque::new(torque)], &[[rod.twist(segments - 1), 0]])?;
        let mut loaded = rod.at_rest_with(vec![roller, twisting])?;
        loaded.settle(1.0)?;
        Ok(middle_gives(&mut loaded, torque, segments)? > 0.0)
    })?;
    Ok(0.25 * torque * torque / squared + compression)
}

/// Returns the displacement of the middle of a strut by a force of 1 N there.
fn middle_gives(loaded: &mut Loaded, torque: f64, segments: usize) -> Result<f64, ValidateError> {
    let (_, mut factor, _) = loaded.factored()?;
    let system = &loaded.system;
    let spacing = 1.0 / segments as f64;
    let tilts: Vec<Vec<f64>> = [(1, 0), (segments, segments - 1)]
        .iter()
        .flat_map(|&(to, from)| {
            [1, 2].map(|axis| displacement(system, axis, &[(to, 1.0 / spacing), (from, -1.0 / spacing)]))
        })
        .collect();
    let force = displacement(system, 1, &[(segments / 2, 1.0)]);
    let mut solve = |right: &[f64]| {
        let mut x = right.to_vec();
        factor.solve(&mut x);
        x
    };
    let moved = solve(&force);
    let solved: Vec<Vec<f64>> = tilts.iter().map(|tilt| solve(tilt)).collect();
    // ½ M (ψz δψy − ψy δψz) on the last edge, and the opposite on the first one.
    let half = 0.5 * torque;
    let skew = [[0.0, -half, 0.0, 0.0], [half, 0.0, 0.0, 0.0], [0.0, 0.0, 0.0, half], [0.0, 0.0, -half, 0.0]];
    let times = |v: [f64; 4]| -> [f64; 4] { std::array::from_fn(|i| (0..4).map(|j| skew[i][j] * v[j]).sum()) };
    // K = S + U N Uᵀ with the tilts as columns of U: K⁻¹ f = S⁻¹ f − S⁻¹ U (1 + N Uᵀ S⁻¹ U)⁻¹ N Uᵀ S⁻¹ f.
    let columns: [[f64; 4]; 4] = std::array::from_fn(|j| times(std::array::from_fn(|i| inner(&tilts[i], &solved[j]))));
    let small = std::array::from_fn(|i| std::array::from_fn(|j| columns[j][i] + if i == j { 1.0 } else { 0.0 }));
    let part = solved_densely(small, times(std::array::from_fn(|i| inner(&tilts[i], &moved))));
    let corrections: f64 = (0..4).map(|i| part[i] * inner(&force, &solved[i])).sum();
    Ok(inner(&force, &moved) - corrections)
}

/// Returns a vector over the free unknowns with entries at points along an axis.
fn displacement(system: &MixedSystem, axis: usize, points: &[(usize, f64)]) -> Vec<f64> {
    let mut all = vec![0.0; system.body().increments()];
    for &(point, entry) in points {
        all[system.body().first_increment(2 * point) + axis] = entry;
    }
    system.free_part(&all)
}

fn inner(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Returns A⁻¹ b, by elimination with row exchanges.
fn solved_densely<const N: usize>(mut a: [[f64; N]; N], mut b: [f64; N]) -> [f64; N] {
    for column in 0..N {
        let size = |row: &usize| a[*row][column].abs();
        let pivot = (column..N).max_by(|i, j| size(i).total_cmp(&size(j))).unwrap_or(column);
        a.swap(column, pivot);
        b.swap(column, pivot);
        for row in 0..N {
            if row != column {
                let factor = a[row][column] / a[column][column];
                (column..N).for_each(|entry| a[row][entry] -= factor * a[column][entry]);
                b[row] -= factor * b[column];
            }
        }
    }
    std::array::from_fn(|row| b[row] / a[row][row])
}
