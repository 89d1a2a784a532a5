//! Whether all contenders compute the same.

use std::marker::PhantomData;

use energy_dsl::{available, dispatch_at};

use crate::run::Collect;
use crate::sample::{Answer, Sample};
use crate::subject::Subject;
use crate::work::{Doubles, One, Width, lanes, packed};

/// How far results may be apart, relative to the largest number of the same order of derivative.
pub const TOLERANCE: f64 = 1e-9;

/// The library's results by its plain method: what the others are compared with.
#[must_use]
pub fn expected<K: Subject>(samples: &[Sample]) -> Vec<Vec<f64>> {
    samples.iter().map(|sample| K::library_plain(&K::element(&sample.library), &sample.unknowns).numbers()).collect()
}

/// The largest difference of any contender's results from the library's, relative to the largest number of the same
/// order of derivative of the element.
///
/// # Errors
/// When it is beyond [`TOLERANCE`], with the contender and the element.
///
/// # Panics
/// When the levels of the machine change while it runs.
pub fn agreement<K: Subject>(samples: &[Sample]) -> Result<f64, String> {
    let expected = expected::<K>(samples);
    let mut worst = 0.0_f64;
    let mut compare = |what: &str, found: &[Vec<f64>]| -> Result<(), String> {
        for (element, (found, expected)) in found.iter().zip(&expected).enumerate() {
            let difference = difference::<K>(found, expected);
            if difference.is_nan() || difference > TOLERANCE {
                return Err(format!("{} {what}: element {element} is off by {difference:e}", K::KEY));
            }
            worst = worst.max(difference);
        }
        Ok(())
    };
    let dual: Vec<Vec<f64>> = samples.iter().map(|sample| K::dual(&sample.textbook).numbers()).collect();
    compare("by dual numbers", &dual)?;
    if let Some(uncompensated) = K::uncompensated(samples) {
        compare("uncompensated", &uncompensated.answers)?;
    }
    for level in available() {
        compare(&format!("by hand at {level}"), &collect::<K, One>(samples, level, true))?;
        compare(&format!("by hand over lanes at {level}"), &collect::<K, Doubles>(samples, level, true))?;
        compare(&format!("by the library over lanes at {level}"), &collect::<K, Doubles>(samples, level, false))?;
    }
    Ok(worst)
}

fn collect<K: Subject, W: Width<Scalar = f64>>(
    samples: &[Sample],
    level: energy_dsl::LevelName,
    hand: bool,
) -> Vec<Vec<f64>> {
    let width = lanes::<W>(level).expect("the level is available");
    let numbers = packed(samples, width, |sample| if hand { &sample.hand } else { &sample.library });
    dispatch_at(level, Collect::<K, W> { numbers: &numbers, hand, of: PhantomData }).expect("the level is available")
}

/// The largest difference of two results, by order of derivative relative to the largest number.
fn difference<K: Subject>(found: &[f64], expected: &[f64]) -> f64 {
    assert_eq!(found.len(), expected.len(), "{}: all results have the same numbers", K::KEY);
    let unknowns: usize = K::DECLARATION.points.iter().map(|field| field.size).sum();
    let gradient = 1..1 + unknowns;
    [0..1, gradient.clone(), gradient.end..found.len()].into_iter().fold(0.0, |worst: f64, range| {
        let size = expected[range.clone()].iter().fold(f64::MIN_POSITIVE, |size, x| size.max(x.abs()));
        let apart = range.map(|i| (found[i] - expected[i]).abs()).fold(0.0, max_or_nan);
        max_or_nan(worst, apart / size)
    })
}

fn max_or_nan(a: f64, b: f64) -> f64 {
    if b.is_nan() || b > a { b } else { a }
}

// Within the library: tests beside it would have the program compiled, kernels and all, only to be at hand.
#[cfg(test)]
mod tests {
    use super::agreement;
    use crate::kernels::{HairBendKernel, HingeKernel, PointToPlaneKernel, SpringKernel, StVKKernel};
    use crate::{Subject, samples};

    /// A multiple of every number of lanes.
    const ELEMENTS: usize = 320;

    fn check<K: Subject>() {
        let difference = agreement::<K>(&samples::<K>(ELEMENTS)).unwrap_or_else(|difference| panic!("{difference}"));
        assert!(difference > 0.0, "different code rounds differently: was anything compared?");
    }

    #[test]
    fn springs_agree() {
        check::<SpringKernel>();
    }

    #[test]
    fn hair_bends_agree() {
        check::<HairBendKernel>();
    }

    #[test]
    fn hinges_agree() {
        check::<HingeKernel>();
    }

    #[test]
    fn membranes_agree() {
        check::<StVKKernel>();
    }

    #[test]
    fn points_to_planes_agree() {
        check::<PointToPlaneKernel>();
    }
}
