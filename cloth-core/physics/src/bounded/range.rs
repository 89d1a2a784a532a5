use schemars::{Schema, json_schema};
use serde::de::Error;

/// The largest speed of anything, in m/s.
pub const SPEED_OF_LIGHT: f64 = 299_792_458.0;
/// The largest coordinate, in m: beyond, single precision in files would not resolve a metre.
const LARGEST_COORDINATE: f64 = 1e9;
/// The largest of other quantities. Nothing that cloth is made of exceeds it in SI units; sums of larger numbers
/// overflow or do not converge.
const LARGEST: f64 = 1e12;

/// A range of real numbers.
pub trait Range {
    /// The lower bound, and whether it belongs to the range.
    const LEAST: (f64, bool);
    /// The upper bound, and whether it belongs to the range.
    const MOST: (f64, bool);
    /// Names one number of the range, for messages, and several.
    const NAMES: [&'static str; 2];
    /// Why larger numbers are refused.
    const REASON: &'static str;

    /// Returns an error if a number lies outside the range. `all` holds the numbers of an array.
    fn check<E: Error>(number: f64, all: &[f64]) -> Result<(), E> {
        let (least, has_least) = Self::LEAST;
        let (most, has_most) = Self::MOST;
        let is_above = number > least || has_least && number == least;
        let is_below = number < most || has_most && number == most;
        if is_above && is_below {
            return Ok(());
        }
        let got = match all {
            // `{}` writes 309 digits for 1e308.
            [] if number.abs() > LARGEST => format!("{number:e}"),
            [] => format!("{number}"),
            _ => format!("{all:?}"),
        };
        let [one, several] = Self::NAMES;
        let wanted = if all.is_empty() { one.to_owned() } else { format!("{several} only") };
        Err(E::custom(if number.is_finite() && number.abs() > most && has_most {
            format!("expected {wanted} and up to {most:e}, got {got}: {}", Self::REASON)
        } else {
            format!("expected {wanted}, got {got}")
        }))
    }

    /// Returns the schema of a number of the range.
    fn schema() -> Schema {
        let mut schema = json_schema!({ "type": "number" });
        let (least, has_least) = Self::LEAST;
        let (most, has_most) = Self::MOST;
        schema.insert(if has_least { "minimum" } else { "exclusiveMinimum" }.to_owned(), least.into());
        schema.insert(if has_most { "maximum" } else { "exclusiveMaximum" }.to_owned(), most.into());
        schema
    }
}

macro_rules! ranges {
    ($($(#[$doc:meta])* $name:ident: $least:expr, $most:expr; $one:literal, $several:literal; $reason:literal;)*) => {
        $(
            $(#[$doc])*
            #[derive(Debug)]
            pub enum $name {}

            impl Range for $name {
                const LEAST: (f64, bool) = $least;
                const MOST: (f64, bool) = $most;
                const NAMES: [&'static str; 2] = [$one, $several];
                const REASON: &'static str = $reason;
            }
        )*
    };
}

ranges! {
    /// Sizes, masses, times and stiffnesses that must not vanish.
    Positive: (0.0, false), (LARGEST, true); "a finite number greater than 0", "finite numbers greater than 0";
        "no quantity of cloth is that large in SI units";
    /// Quantities that may be zero.
    NonNegative: (0.0, true), (LARGEST, true); "a finite number of at least 0", "finite numbers of at least 0";
        "no quantity of cloth is that large in SI units";
    /// Parameters of elements of the user.
    Signed: (-LARGEST, true), (LARGEST, true); "a finite number", "finite numbers";
        "no quantity of cloth is that large in SI units";
    /// Coordinates, angles, accelerations.
    Number: (-LARGEST_COORDINATE, true), (LARGEST_COORDINATE, true); "a finite number", "finite numbers";
        "single precision in files would not resolve it";
    /// Components of velocities.
    Speed: (-SPEED_OF_LIGHT, true), (SPEED_OF_LIGHT, true); "a finite number", "finite numbers";
        "nothing is faster than light";
    /// Poisson's ratios.
    PoissonRatio: (-1.0, false), (1.0, false);
        "a number strictly between −1 and 1", "numbers strictly between −1 and 1"; "";
    /// Relative tolerances.
    Fraction: (0.0, false), (1.0, false); "a number strictly between 0 and 1", "numbers strictly between 0 and 1"; "";
    /// Strains of curves.
    Strain: (0.0, false), (2.0, true); "a strain greater than 0", "strains greater than 0";
        "strains are no percentages, 7 % is 0.07";
    /// Parts of a whole.
    Share: (0.0, false), (1.0, true); "a number greater than 0", "numbers greater than 0"; "it is part of a whole";
    /// Channels of a colour.
    Channel: (0.0, true), (1.0, true); "a number from 0 to 1", "numbers from 0 to 1"; "";
    /// Angles of a camera.
    Angle: (0.1, true), (170.0, true); "an angle from 0.1 to 170", "angles from 0.1 to 170"; "";
    /// Stretches: lengths relative to those at rest.
    AboveOne: (1.0, false), (LARGEST, true); "a number greater than 1", "numbers greater than 1";
        "no thread stretches that far";
}

#[cfg(test)]
mod tests {
    use serde::de::value::Error;

    use super::*;

    /// Panics unless a range contains some numbers, and not others.
    fn contains<R: Range>(inside: &[f64], outside: &[f64]) {
        let is_inside = |number: &f64| R::check::<Error>(*number, &[]).is_ok();
        let [wanted, _] = R::NAMES;
        inside.iter().for_each(|number| assert!(is_inside(number), "{number:e} is {wanted}"));
        let beyond = [f64::NAN, f64::INFINITY, f64::NEG_INFINITY];
        outside.iter().chain(&beyond).for_each(|number| assert!(!is_inside(number), "{number:e} is not {wanted}"));
    }

    #[test]
    fn ranges_contain_what_is_physically_possible() {
        contains::<Positive>(&[1e-300, 1.0, 1e12], &[0.0, -1.0, 2e12]);
        contains::<NonNegative>(&[0.0, 1e12], &[-1e-300, 2e12]);
        contains::<Signed>(&[-1e12, 0.0, 1e12], &[-2e12, 2e12]);
        contains::<Number>(&[-1e9, 0.0, 1e9], &[-2e9, 2e9]);
        contains::<Speed>(&[-SPEED_OF_LIGHT, 0.0, SPEED_OF_LIGHT], &[-3e8, 3e8]);
        // Outside, an elastic solid gains energy when it is sheared or compressed.
        contains::<PoissonRatio>(&[-0.99, 0.0, 0.99], &[-1.0, 1.0]);
        contains::<Fraction>(&[1e-300, 0.99], &[0.0, 1.0]);
        // Black and white.
        contains::<Channel>(&[0.0, 0.5, 1.0], &[-0.01, 1.01]);
        contains::<Angle>(&[0.1, 170.0], &[0.0, 171.0]);
        contains::<AboveOne>(&[1.01, 1e12], &[1.0, 2e12]);
    }
}
