//! Symmetric tensors in the plane.

/// Returns a symmetric tensor (uu, vv, uv) with other eigenvalues and the same eigenvectors.
pub(super) fn with_eigenvalues([uu, vv, uv]: [f64; 3], new: impl Fn(f64) -> f64) -> [f64; 3] {
    let (middle, half, radius) = (0.5 * (uu + vv), 0.5 * (uu - vv), (0.5 * (uu - vv)).hypot(uv));
    let [upper, lower] = [middle + radius, middle - radius].map(new);
    // The projections onto the eigenvectors are ½ (1 ± N), where N is the traceless part over its radius.
    let (mean, per_radius) = (0.5 * (upper + lower), if radius > 0.0 { 0.5 * (upper - lower) / radius } else { 0.0 });
    [mean + half * per_radius, mean - half * per_radius, uv * per_radius]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eigenvectors_stay() {
        // 4 along (3, 4)/5, −1 across.
        let tensor = [(4.0 * 9.0 - 16.0) / 25.0, (4.0 * 16.0 - 9.0) / 25.0, 5.0 * 12.0 / 25.0];
        let clamped = with_eigenvalues(tensor, |eigenvalue| eigenvalue.max(0.0));
        let expected = [36.0 / 25.0, 64.0 / 25.0, 48.0 / 25.0];
        assert!((0..3).all(|k| (clamped[k] - expected[k]).abs() < 1e-15), "{clamped:?}");
        let same = with_eigenvalues(tensor, |eigenvalue| eigenvalue);
        assert!((0..3).all(|k| (same[k] - tensor[k]).abs() < 1e-15), "{same:?}");
        assert_eq!(with_eigenvalues([2.0, 2.0, 0.0], |eigenvalue| eigenvalue - 1.0), [1.0, 1.0, 0.0]);
    }
}
