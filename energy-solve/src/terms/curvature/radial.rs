use energy_dsl::Lane;

use super::{Curvature, largest_of, upper_index};

/// Tolerance of the deviation from the radial form, relative to the largest entry.
const TOLERANCE: f64 = 1e-10;

/// Projects Hessians of functions of ‖d‖, which have the form a I + b d dᵀ. The eigenvalue across d is a (twice), along
/// d it is λ = a + b ‖d‖²; the projected matrix is a' I + (λ' − a') d dᵀ/‖d‖².
///
/// Returns a mask of the lanes with this form, each of which is tested, and the projected upper triangles.
#[inline(always)]
pub(super) fn change<V: Lane<f64>>(upper: &[V], curvature: Curvature, d: [V; 3]) -> (V::Mask, [V; 6]) {
    let [xx, xy, xz, yy, yz, zz] = [upper[0], upper[1], upper[2], upper[3], upper[4], upper[5]];
    let squared = d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
    let per_squared = V::splat(1.0) / squared;
    let times_d =
        [xx * d[0] + xy * d[1] + xz * d[2], xy * d[0] + yy * d[1] + yz * d[2], xz * d[0] + yz * d[1] + zz * d[2]];
    let along = (d[0] * times_d[0] + d[1] * times_d[1] + d[2] * times_d[2]) * per_squared;
    let across = (xx + yy + zz - along) * V::splat(0.5);
    let largest = largest_of(upper);
    let found = form(along, across, d, per_squared);
    let mut radial = squared.is_moderate(2);
    for entry in 0..6 {
        radial = radial & (found[entry] - upper[entry]).abs().less_or_equal(largest * V::splat(TOLERANCE));
    }
    (radial, form(along + curvature.change(along), across + curvature.change(across), d, per_squared))
}

/// Returns the upper triangle of a I + (λ − a) d dᵀ/‖d‖².
#[inline(always)]
fn form<V: Lane<f64>>(along: V, across: V, d: [V; 3], per_squared: V) -> [V; 6] {
    let part = (along - across) * per_squared;
    let mut form = [across; 6];
    for i in 0..3 {
        for j in i..3 {
            let product = part * d[i] * d[j];
            form[upper_index(3, i, j)] = if i == j { product + across } else { product };
        }
    }
    form
}

#[cfg(test)]
mod tests {
    use super::*;

    /// f″ n nᵀ + f′/‖d‖ (1 − n nᵀ), the Hessian of f(‖d‖).
    fn hessian(d: [f64; 3], bend: f64, pull: f64) -> [f64; 6] {
        let square: f64 = d.iter().map(|component| component * component).sum();
        let entry = |i: usize, j: usize| {
            let along = d[i] * d[j] / square;
            bend * along + pull * (if i == j { 1.0 } else { 0.0 } - along)
        };
        [entry(0, 0), entry(0, 1), entry(0, 2), entry(1, 1), entry(1, 2), entry(2, 2)]
    }

    #[test]
    fn hessians_of_lengths_are_recognised_and_projected() {
        let d = [0.3, -1.2, 2.0];
        for (bend, pull) in [(5.0_f64, 2.0_f64), (5.0, -2.0), (-3.0, 2.0), (-3.0, -2.0)] {
            for (curvature, [bent, pulled]) in
                [(Curvature::Clamped, [bend.max(0.0), pull.max(0.0)]), (Curvature::Absolute, [bend.abs(), pull.abs()])]
            {
                let (radial, changed) = change(&hessian(d, bend, pull), curvature, d);
                assert!(radial, "{bend}, {pull}");
                for (found, expected) in changed.into_iter().zip(hessian(d, bent, pulled)) {
                    assert!((found - expected).abs() < 1e-14 * 5.0, "{curvature:?} of {bend}, {pull}: {found}");
                }
            }
        }
        let mut other = hessian(d, 5.0, 2.0);
        other[4] += 1e-3;
        assert!(!change(&other, Curvature::Clamped, d).0);
    }
}
