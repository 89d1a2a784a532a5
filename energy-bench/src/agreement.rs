//! Comparison of all contenders' results before they are timed.

use std::marker::PhantomData;

use energy_dsl::{LevelName, available, dispatch_at};

use crate::run::Collect;
use crate::sample::{Answer, Sample};
use crate::subject::Subject;
use crate::work::{Doubles, One, Width, lanes, packed};

/// Largest accepted difference, relative to the largest number of the same order of derivative.
pub const TOLERANCE: f64 = 1e-9;

/// The results of the generated plain method, one list of numbers per element. They are the reference for all others.
#[must_use]
pub fn expected<K: Subject>(samples: &[Sample]) -> Vec<Vec<f64>> {
    let numbers = |sample: &Sample| K::generated_plain(&K::element(&sample.generated), &sample.unknowns).numbers();
    samples.iter().map(numbers).collect()
}

/// Returns the largest difference of any contender's results from the generated ones, relative to the largest number of
/// the same order of derivative of the same element.
///
/// # Errors
/// Names the contender and the element if a difference exceeds [`TOLERANCE`] or is NaN.
///
/// # Panics
/// Panics if a SIMD level becomes unavailable while the program runs.
pub fn agreement<K: Subject>(samples: &[Sample]) -> Result<f64, String> {
    let expected = expected::<K>(samples);
    let mut worst = 0.0_f64;
    let mut compare = |contender: &str, found: &[Vec<f64>]| -> Result<(), String> {
        for (element, (found, expected)) in found.iter().zip(&expected).enumerate() {
            let difference = difference(found, expected, samples[element].unknowns.len());
            if difference.is_nan() || difference > TOLERANCE {
                return Err(format!(
                    "{} {contender}: element {element} differs from the generated code by {difference:e}, \
                     expected at most {TOLERANCE:e}",
                    K::KEY
                ));
            }
            worst = worst.max(difference);
        }
        Ok(())
    };
    let dual: Vec<Vec<f64>> = samples.iter().map(|sample| K::dual(&sample.textbook).numbers()).collect();
    compare("num-dual", &dual)?;
    if let Some(uncompensated) = K::uncompensated(samples) {
        compare("uncompensated", &uncompensated.answers)?;
    }
    for level in available() {
        compare(&format!("hand-derived, scalar, {level}"), &collect::<K, One>(samples, level, true))?;
        compare(&format!("hand-derived, f64 lanes, {level}"), &collect::<K, Doubles>(samples, level, true))?;
        compare(&format!("generated, f64 lanes, {level}"), &collect::<K, Doubles>(samples, level, false))?;
    }
    Ok(worst)
}

/// The results of hand-derived (`hand`) or generated code at a level, one list of numbers per element.
pub(crate) fn collect<K: Subject, W: Width<Scalar = f64>>(
    samples: &[Sample],
    level: LevelName,
    hand: bool,
) -> Vec<Vec<f64>> {
    let width = lanes::<W>(level).expect("the level is available");
    let numbers = packed(samples, width, |sample| if hand { &sample.hand } else { &sample.generated });
    dispatch_at(level, Collect::<K, W> { numbers: &numbers, hand, kernel: PhantomData })
        .expect("the level is available")
}

/// The largest difference of two results. Value, gradient and Hessian are each relative to their largest number.
pub(crate) fn difference(found: &[f64], expected: &[f64], unknowns: usize) -> f64 {
    assert_eq!(found.len(), expected.len(), "all results have the same length");
    let gradient = 1..1 + unknowns;
    [0..1, gradient.clone(), gradient.end..found.len()].into_iter().fold(0.0, |worst: f64, range| {
        let size = expected[range.clone()].iter().fold(f64::MIN_POSITIVE, |size, x| size.max(x.abs()));
        let largest = range.map(|i| (found[i] - expected[i]).abs()).fold(0.0, max_or_nan);
        max_or_nan(worst, largest / size)
    })
}

fn max_or_nan(a: f64, b: f64) -> f64 {
    if b.is_nan() || b > a { b } else { a }
}
