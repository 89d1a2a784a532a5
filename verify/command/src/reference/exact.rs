use dashu_int::{IBig, UBig};
use dashu_ratio::RBig;

/// A decimal number in twice the precision of a double: `high` is the nearest double, `low` the remainder.
///
/// ```
/// use verify_command::reference::Truth;
/// let third: Truth = "3.33333333333333333333333333333e-01".parse().unwrap();
/// // Errors of a hundredth of a roundoff are visible.
/// assert!((third.error_of(1.0 / 3.0) / 2.0_f64.powi(-53) - 1.0 / 6.0).abs() < 1e-2);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Truth {
    /// Nearest double.
    pub high: f64,
    /// Remainder of the number.
    pub low: f64,
}

impl Truth {
    /// |value − truth|, itself with a relative error of about one roundoff.
    #[must_use]
    pub fn error_of(&self, value: f64) -> f64 {
        if value == self.high {
            return self.low.abs();
        }
        ((value - self.high) - self.low).abs()
    }
}

impl std::str::FromStr for Truth {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let high: f64 = text.trim().parse().map_err(|_| format!("`{text}` is not a decimal number"))?;
        if !high.is_finite() || text.trim() == "0" {
            return Ok(Self { high, low: 0.0 });
        }
        let exact = decimal(text.trim()).ok_or_else(|| format!("`{text}` is not a decimal number"))?;
        let rounded = RBig::try_from(high).map_err(|_| format!("`{text}` is out of the range of doubles"))?;
        Ok(Self { high, low: (exact - rounded).to_f64().value() })
    }
}

/// Parses `-1.25e-3` as a fraction.
fn decimal(text: &str) -> Option<RBig> {
    let (mantissa, exponent) = text.split_once(['e', 'E']).unwrap_or((text, "0"));
    let (whole, fraction) = mantissa.split_once('.').unwrap_or((mantissa, ""));
    let digits: IBig = format!("{whole}{fraction}").parse().ok()?;
    let exponent = exponent.parse::<i32>().ok()? - i32::try_from(fraction.len()).ok()?;
    if digits.is_zero() {
        return Some(RBig::ZERO);
    }
    let power = UBig::from(10_u8).pow(exponent.unsigned_abs() as usize);
    Some(if exponent < 0 { RBig::from_parts(digits, power) } else { (digits * power).into() })
}

#[cfg(test)]
mod tests {
    use super::Truth;

    #[test]
    fn the_remainder_of_rounding_is_known() {
        let tenth: Truth = "1.00000000000000000000000000000e-01".parse().unwrap();
        // 0.1 = 0x3fb999999999999a − 5.551115123125783e-18.
        assert_eq!(tenth.high, 0.1);
        assert!((tenth.low + 5.551_115_123_125_783e-18).abs() < 1e-32);
        let tiny: Truth = "-1.23456789012345678901234567890e-200".parse().unwrap();
        assert!(tiny.low != 0.0 && tiny.low.abs() < 1.2e-216);
        assert_eq!("1e400".parse::<Truth>().unwrap().high, f64::INFINITY);
        assert!("one".parse::<Truth>().is_err());
    }
}
