use super::ValidateError;

/// How the stiffness depends on the sign of the load.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Symmetry {
    /// Even: the stiffness falls with the square of the load.
    Even,
    /// No symmetry: the stiffness falls with the load.
    None,
}

/// Returns the load Γ at which a stiffness vanishes, by secants within the bounds found so far. The stiffness can be
/// measured below that load only; above, it is `None`.
pub(super) fn critical_load(
    what: &'static str,
    symmetry: Symmetry,
    first: f64,
    mut stiffness: impl FnMut(f64) -> Result<Option<f64>, ValidateError>,
) -> Result<f64, ValidateError> {
    let scale = |gamma: f64| if symmetry == Symmetry::Even { gamma * gamma } else { gamma };
    let back = |scaled: f64| if symmetry == Symmetry::Even { scaled.max(0.0).sqrt() } else { scaled };
    let small = 1e-3 * first;
    let mut low = (small, stiffness(small)?.ok_or(ValidateError::Stable { what, gamma: 0.0 })?);
    let (mut gamma, mut high) = (first, f64::INFINITY);
    for _ in 0..60 {
        match stiffness(gamma)? {
            Some(left) => {
                let slope = (left - low.1) / (scale(gamma) - scale(low.0));
                let zero = back(scale(gamma) - left / slope);
                if slope < 0.0 && (zero / gamma - 1.0).abs() < 1e-4 {
                    return Ok(zero);
                }
                low = (gamma, left);
                // Stop short of the predicted zero: beyond it nothing can be measured.
                let next = if slope < 0.0 { gamma + 0.97 * (zero - gamma) } else { 2.0 * gamma };
                gamma = next.min(2.0 * gamma).min(if high.is_finite() { 0.5 * (gamma + high) } else { f64::INFINITY });
            }
            None => {
                high = gamma;
                gamma = 0.5 * (low.0 + high);
            }
        }
        if high - low.0 < 1e-5 * high {
            return Ok(0.5 * (high + low.0));
        }
    }
    Err(ValidateError::Stable { what, gamma })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_critical_load_is_found_from_below() {
        for (symmetry, power) in [(Symmetry::Even, 2), (Symmetry::None, 1)] {
            let stiffness = |gamma: f64| {
                let left = 1.0 - (gamma / 17.0).powi(power) - 0.05 * (gamma / 17.0).powi(4);
                Ok((left > 0.0).then_some(left))
            };
            let found = critical_load("a spring", symmetry, 3.0, stiffness).unwrap();
            let left = 1.0 - (found / 17.0).powi(power) - 0.05 * (found / 17.0).powi(4);
            assert!(left.abs() < 3e-4, "{found}: {left}");
        }
    }
}
