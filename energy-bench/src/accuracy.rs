//! How exact gradients are near rest, where strains and angles are differences of nearly equal numbers.

use energy_compiler::Textbook;
use energy_dsl::{Array, Baseline};
use serde::Serialize;
use verify::BlockName;
use verify::multiprecision::{TrueBlock, truth};

use crate::sample::{Answer, Sample};
use crate::subject::Subject;

/// How far from rest: a strain, or an angle.
pub const STRAIN: f64 = 1e-6;

/// The largest error of any element's gradient, in units of roundoff of that gradient's largest number.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct NearRest {
    /// The library's.
    pub library: f64,
    /// That of the library's element without compensation.
    pub uncompensated: f64,
    /// That of hand-derived code.
    pub hand: f64,
    /// That of the textbook formula over dual numbers.
    pub dual: f64,
}

/// The errors of the first elements after they have been brought near rest, where the kernel has a rest.
#[must_use]
pub fn near_rest<K: Subject>(samples: &[Sample]) -> Option<NearRest> {
    const ELEMENTS: usize = 32;
    let near: Vec<Sample> = samples.iter().take(ELEMENTS).map(K::near_rest).collect::<Option<_>>()?;
    let uncompensated = K::uncompensated(&near)?.answers;
    let mut worst = NearRest::default();
    for (sample, uncompensated) in near.iter().zip(&uncompensated) {
        let gradient = true_gradient::<K>(sample);
        let keep = |worst: &mut f64, numbers: &[f64]| {
            *worst = worst.max(gradient.error_in_roundoffs(&numbers[1..=sample.unknowns.len()]));
        };
        let element = K::element(&sample.library);
        keep(&mut worst.library, &K::library_plain(&element, &sample.unknowns).numbers());
        keep(&mut worst.uncompensated, uncompensated);
        let inputs = K::Hand::<f64>::from_fn(|i| sample.hand[i]);
        keep(&mut worst.hand, &K::hand::<f64, Baseline>(&inputs).numbers());
        keep(&mut worst.dual, &K::dual(&sample.textbook).numbers());
    }
    Some(worst)
}

/// The gradient to 30 digits.
fn true_gradient<K: Subject>(sample: &Sample) -> TrueBlock {
    let formula = Textbook::from_source(K::DECLARATION.source).expect("the library's declarations are right");
    let own = sample.textbook.len() - sample.unknowns.len();
    let input = verify::Sample {
        parameters: sample.textbook[..own].to_vec(),
        rest: Vec::new(),
        positions: sample.unknowns.clone(),
        velocities: Vec::new(),
    };
    let blocks = truth(K::DECLARATION, &formula, &input, 30);
    blocks.into_iter().find(|block| block.block.name == BlockName::Gradient).expect("a potential has a gradient")
}

#[cfg(test)]
mod tests {
    use super::near_rest;
    use crate::kernels::{HairBendKernel, HingeKernel, SpringKernel};
    use crate::{Subject, samples};

    fn check<K: Subject>() {
        let errors = near_rest::<K>(&samples::<K>(16)).expect("it has a rest");
        assert!(errors.library <= 12.0, "{errors:?}");
        assert!(errors.hand > 1e3 && errors.dual > 1e3, "others cancel there: {errors:?}");
    }

    #[test]
    fn nearly_relaxed_springs_are_exact() {
        check::<SpringKernel>();
    }

    #[test]
    fn nearly_straight_hair_is_exact() {
        check::<HairBendKernel>();
    }

    #[test]
    fn nearly_flat_hinges_are_exact() {
        check::<HingeKernel>();
    }
}
