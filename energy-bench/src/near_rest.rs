//! Gradient errors near rest, where strains and angles are differences of nearly equal numbers.

use energy_compiler::Textbook;
use energy_dsl::{Array, Baseline};
use serde::Serialize;
use verify::BlockName;
use verify::multiprecision::{TrueBlock, truth};

use crate::contender::Source;
use crate::sample::{Answer, Sample};
use crate::subject::Subject;

/// Distance from rest: a strain, or an angle in radians.
pub const STRAIN: f64 = 1e-6;

/// Largest gradient error of one source over all elements near rest.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct GradientError {
    /// The code that computed the gradient.
    pub source: Source,
    /// Error in units of the roundoff u = 2⁻⁵³ of the gradient's largest component.
    pub roundoffs: f64,
}

/// Elements near rest and their gradients to 30 digits.
#[derive(Debug)]
pub struct NearRest {
    samples: Vec<Sample>,
    gradients: Vec<TrueBlock>,
}

impl NearRest {
    /// Moves the first 32 elements near rest. Returns `None` if the kernel has no rest shape where differences cancel.
    #[must_use]
    pub fn new<K: Subject>(samples: &[Sample]) -> Option<Self> {
        const ELEMENTS: usize = 32;
        let samples: Vec<Sample> = samples.iter().take(ELEMENTS).map(K::near_rest).collect::<Option<_>>()?;
        let gradients = samples.iter().map(true_gradient::<K>).collect();
        Some(Self { samples, gradients })
    }

    /// The elements near rest.
    #[must_use]
    pub fn samples(&self) -> &[Sample] {
        &self.samples
    }

    /// The largest gradient error of `results`: for each element, its value, then its gradient, then anything else.
    #[must_use]
    pub fn error(&self, source: Source, results: &[Vec<f64>]) -> GradientError {
        assert_eq!(results.len(), self.samples.len(), "one result per element");
        let error = |((sample, gradient), numbers): ((&Sample, &TrueBlock), &Vec<f64>)| {
            gradient.error_in_roundoffs(&numbers[1..=sample.unknowns.len()])
        };
        let errors = self.samples.iter().zip(&self.gradients).zip(results).map(error);
        GradientError { source, roundoffs: errors.fold(0.0, f64::max) }
    }

    /// The gradient errors of all code that is compiled into this program.
    #[must_use]
    pub fn errors<K: Subject>(&self) -> Vec<GradientError> {
        let collect = |source, numbers: &dyn Fn(&Sample) -> Vec<f64>| {
            self.error(source, &self.samples.iter().map(numbers).collect::<Vec<_>>())
        };
        let mut errors = vec![collect(Source::Generated, &|sample| {
            K::generated_plain(&K::element(&sample.generated), &sample.unknowns).numbers()
        })];
        if let Some(uncompensated) = K::uncompensated(&self.samples) {
            errors.push(self.error(Source::Uncompensated, &uncompensated.answers));
        }
        errors.push(collect(Source::HandDerived, &|sample| {
            K::hand::<f64, Baseline>(&K::Hand::<f64>::from_fn(|i| sample.hand[i])).numbers()
        }));
        errors.push(collect(Source::NumDual, &|sample| K::dual(&sample.textbook).numbers()));
        errors
    }
}

/// The gradient to 30 digits.
fn true_gradient<K: Subject>(sample: &Sample) -> TrueBlock {
    let formula = Textbook::from_source(&K::DECLARATION.source).expect("the declaration compiles");
    let constants = sample.textbook.len() - sample.unknowns.len();
    let input = verify::Sample {
        parameters: sample.textbook[..constants].to_vec(),
        rest: Vec::new(),
        positions: sample.unknowns.clone(),
        velocities: Vec::new(),
    };
    let blocks = truth(K::DECLARATION, &formula, &input, 30);
    blocks.into_iter().find(|block| block.block.name == BlockName::Gradient).expect("a potential has a gradient")
}
