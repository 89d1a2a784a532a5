use crate::blocks::largest;
use crate::geometry::{cross, difference};

/// |Σ f| and |Σ (x − x₀) × f|, relative to the largest force (or its natural size) and the largest torque.
pub(super) fn momentum_errors(positions: &[f64], force: &[f64], natural: f64) -> (f64, f64) {
    let (mut sum, mut torque, mut lever) = ([0.0; 3], [0.0; 3], 0.0_f64);
    let strongest = largest(force).max(natural);
    for (x, f) in positions.chunks(3).zip(force.chunks(3)) {
        let arm = difference(x, &positions[..3]);
        let turning = cross(&arm, f);
        for axis in 0..3 {
            sum[axis] += f[axis];
            torque[axis] += turning[axis];
        }
        lever = lever.max(largest(&arm) * largest(f).max(natural));
    }
    let relative = |value: f64, scale: f64| if scale == 0.0 { value } else { value / scale };
    (relative(largest(&sum), strongest), relative(largest(&torque), lever))
}
