use std::f64::consts::TAU;

/// Draws a standard normal deviate (Box and Muller).
pub(crate) fn gaussian(random: &mut fastrand::Rng) -> f64 {
    let radius = (-2.0 * (1.0 - random.f64()).ln()).sqrt();
    radius * (TAU * random.f64()).cos()
}
