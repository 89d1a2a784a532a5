use schemars::JsonSchema;
use serde::Deserialize;

use super::curve::StiffeningCurve;
use super::error::YarnError;
use crate::bounded::{Points, Positive, Real, Strain};

/// Tension per original width over engineering strain, along warp or weft, while the other direction is held.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Tension {
    /// The same tension over strain at every strain.
    Modulus(#[serde(with = "Real::<Positive>")] f64),
    /// The law's own numbers: k ε + a ε³, given by its slope at rest and its end.
    Law(TensionLaw),
    /// The numbers that a KES-F tensile tester prints.
    Kes(Kes),
    /// The numbers that a FAST-3 extension meter prints.
    Fast(Fast),
    /// Points [strain, tension in N/m] of a measured curve, both ascending. They are fitted by least squares.
    Curve(#[serde(with = "Points")] Vec<[f64; 2]>),
}

/// The tension k ε + a ε³ up to an end, and straight beyond.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct TensionLaw {
    /// Slope k at rest, in N/m.
    #[serde(with = "Real::<Positive>")]
    pub modulus: f64,
    /// Largest strain of the curve.
    #[serde(with = "Real::<Strain>")]
    pub strain: f64,
    /// Tension there, in N/m; at least `modulus` times `strain`.
    #[serde(with = "Real::<Positive>")]
    pub tension: f64,
}

/// The results of a KES-F tensile tester.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Kes {
    /// Strain EMT at the largest load: 0.07 for 7 %.
    #[serde(with = "Real::<Strain>")]
    pub emt: f64,
    /// Linearity LT = 2 WT/(load · EMT), above 1/3 and at most 1.
    #[serde(with = "Real::<Positive>")]
    pub lt: f64,
    /// The largest load, in N/m. Default 490.33, which is 500 gf/cm; knits often have 49.
    #[serde(default = "kes_load", with = "Real::<Positive>")]
    pub load: f64,
}

/// The results of a FAST-3 extension meter: strains at 4.9, 19.6 and 98.1 N/m.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct Fast {
    /// Strain at 4.9 N/m (5 gf/cm): 0.01 for 1 %.
    #[serde(with = "Real::<Strain>")]
    pub e5: f64,
    /// Strain at 19.6 N/m (20 gf/cm).
    #[serde(with = "Real::<Strain>")]
    pub e20: f64,
    /// Strain at 98.1 N/m (100 gf/cm).
    #[serde(with = "Real::<Strain>")]
    pub e100: f64,
}

/// Shear force per width over the angle of shear.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum Shear {
    /// Shear stiffness G, in N/m per rad. KES: 1 gf/(cm·°) is 56.19 N/m. FAST: 123 N/m over the extension EB5 in %.
    Modulus(#[serde(with = "Real::<Positive>")] f64),
    /// Points [sine of the angle, force in N/m] of a measured curve, both ascending. They are fitted by least squares.
    Curve(#[serde(with = "Points")] Vec<[f64; 2]>),
}

/// 1 gf/cm, in N/m.
const GRAM_FORCE_PER_CM: f64 = 0.980_665;

fn kes_load() -> f64 {
    500.0 * GRAM_FORCE_PER_CM
}

impl Tension {
    /// Returns the curve, and the largest misfit of the points that it was fitted to: its error relative to the tension
    /// there, or to 5 % of the largest tension if that is more.
    ///
    /// For KES with LT > 1/2, k = (2 LT − 1) F/EMT and a = 2 (1 − LT) F/EMT³. For 1/3 < LT ≤ 1/2 a fifth power is
    /// needed: k = ½ (3 LT − 1) F/EMT and b = 3/2 (1 − LT) F/EMT⁵. Both have the strain EMT and the work ½ LT F EMT
    /// at the load F.
    ///
    /// # Errors
    /// Returns an error if the numbers contradict each other, or belong to a curve that bends down.
    pub fn curve(&self, direction: &'static str) -> Result<(StiffeningCurve, f64), YarnError> {
        match *self {
            Self::Modulus(modulus) => Ok((StiffeningCurve::straight(modulus), 0.0)),
            Self::Law(TensionLaw { modulus, strain, tension }) => {
                let least = modulus * strain;
                // Numbers of a straight line may differ by rounding.
                if tension < least * (1.0 - 1e-9) {
                    return Err(YarnError::BendsDown { direction, tension, least });
                }
                Ok((StiffeningCurve::to_end(modulus, [strain, tension.max(least)], 0.0), 0.0))
            }
            Self::Kes(Kes { emt, lt, load }) => {
                let secant = load / emt;
                if lt > 1.0 || lt <= 1.0 / 3.0 {
                    return Err(YarnError::Linearity { direction, lt });
                }
                let (k, fifth) = if lt > 0.5 { (2.0 * lt - 1.0, 0.0) } else { (0.5 * (3.0 * lt - 1.0), 1.0) };
                Ok((StiffeningCurve::to_end(k * secant, [emt, load], fifth), 0.0))
            }
            Self::Fast(Fast { e5, e20, e100 }) => {
                let points = [[e5, 5.0], [e20, 20.0], [e100, 100.0]].map(|[e, load]| [e, load * GRAM_FORCE_PER_CM]);
                fitted(&points, direction, "fast")
            }
            Self::Curve(ref points) => fitted(points, direction, "curve"),
        }
    }
}

impl Shear {
    /// Returns the curve over the sine of the angle of shear, and the largest misfit, as [`Tension::curve`] does.
    ///
    /// # Errors
    /// Returns an error if the points do not ascend.
    pub fn curve(&self) -> Result<(StiffeningCurve, f64), YarnError> {
        match self {
            Self::Modulus(modulus) => Ok((StiffeningCurve::straight(*modulus), 0.0)),
            Self::Curve(points) => fitted(points, "shear", "curve"),
        }
    }
}

/// The largest strain of a curve. Larger numbers are percentages by mistake.
const LARGEST_STRAIN: f64 = 2.0;

fn fitted(
    points: &[[f64; 2]],
    direction: &'static str,
    key: &'static str,
) -> Result<(StiffeningCurve, f64), YarnError> {
    let Some([strain, _]) = points.last() else { return Err(YarnError::NoPoints { direction, key }) };
    if let Some(number) = (1..points.len()).find(|&i| (0..2).any(|axis| points[i][axis] <= points[i - 1][axis])) {
        let [before, point] = [points[number - 1], points[number]];
        return Err(YarnError::NotAscending { direction, key, number: number + 1, point, before });
    }
    if *strain > LARGEST_STRAIN {
        return Err(YarnError::Percent { direction, key, strain: *strain });
    }
    let curve = StiffeningCurve::fitted(points);
    Ok((curve, curve.misfit(points)))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The work until a strain, over half of load times strain.
    fn linearity(curve: &StiffeningCurve, strain: f64, load: f64) -> f64 {
        let steps = 10_000;
        let width = strain / f64::from(steps);
        let work: f64 = (0..steps).map(|i| width * curve.tension((f64::from(i) + 0.5) * width)).sum();
        2.0 * work / (load * strain)
    }

    #[test]
    fn kes_numbers_are_reproduced_with_the_third_and_the_fifth_power() {
        for (emt, lt, load) in [(0.047, 0.6, 490.3), (0.07, 1.0, 490.3), (0.3, 0.45, 49.0), (0.12, 0.5, 490.3)] {
            let (curve, misfit) = Tension::Kes(Kes { emt, lt, load }).curve("warp").unwrap();
            assert!((curve.tension(emt) / load - 1.0).abs() < 1e-12 && misfit == 0.0);
            assert!((linearity(&curve, emt, load) - lt).abs() < 1e-6, "{lt}: {}", linearity(&curve, emt, load));
            assert!(curve.k > 0.0 && curve.a >= 0.0 && curve.b >= 0.0, "{curve:?}");
        }
    }

    #[test]
    fn fast_numbers_are_three_points_of_a_curve() {
        let truth = StiffeningCurve { k: 900.0, a: 2e5, b: 0.0, m: 0.07 };
        // The strains at the three loads, by bisection.
        let strain = |load: f64| {
            let halve = |(low, high): (f64, f64), _: i32| {
                let middle = 0.5 * (low + high);
                if truth.tension(middle) < load { (middle, high) } else { (low, middle) }
            };
            (0..60).fold((0.0, 0.2), halve).0
        };
        let [e5, e20, e100] = [4.903_325, 19.6133, 98.0665].map(strain);
        let (curve, misfit) = Tension::Fast(Fast { e5, e20, e100 }).curve("weft").unwrap();
        assert!(misfit < 1e-9 && (curve.k / truth.k - 1.0).abs() < 1e-6, "{curve:?} {misfit}");
    }

    #[test]
    fn numbers_that_no_law_has_are_refused_with_a_remedy() {
        let kes = |lt| Tension::Kes(Kes { emt: 0.05, lt, load: 490.0 });
        let law = |tension| Tension::Law(TensionLaw { modulus: 1000.0, strain: 0.1, tension });
        let curve = |points: &[[f64; 2]]| Tension::Curve(points.to_vec());
        for (tension, message) in [
            (kes(1.0 / 3.0), "warp.kes.lt: expected a linearity above 1/3"),
            (kes(1.2), "got 1.2; give points of the curve as `warp.curve`"),
            (law(99.0), "warp.law: expected a tension of at least modulus × strain = 100.0000 N/m, got 99"),
            (curve(&[]), "warp.curve: expected at least one point"),
            (curve(&[[0.1, 5.0], [0.2, 4.0]]), "warp.curve: point 2 [0.2, 4.0] must exceed point 1 [0.1, 5.0]"),
            (curve(&[[0.1, 5.0], [0.1, 6.0]]), "sort the points"),
            (curve(&[[1.0, 5.0], [7.1, 490.0]]), "expected strains of at most 2, got 7.1; write 0.07 for 7 %"),
            (Tension::Fast(Fast { e5: 0.02, e20: 0.01, e100: 0.03 }), "warp.fast: point 2"),
        ] {
            let error = tension.curve("warp").unwrap_err().to_string();
            assert!(error.contains(message), "{error}");
        }
        assert!(law(100.0).curve("warp").is_ok() && kes(0.34).curve("warp").is_ok());
        assert!(Shear::Curve(vec![[0.2, 1.0], [0.1, 2.0]]).curve().unwrap_err().to_string().starts_with("shear.curve"));
    }
}
