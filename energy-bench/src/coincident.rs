//! Results at coincident points, where textbook formulas divide 0 by 0.

use std::fmt::{self, Display};

use energy_dsl::{Array, Baseline, available};
use serde::Serialize;

use crate::agreement::{TOLERANCE, collect, difference};
use crate::contender::Source;
use crate::sample::{Answer, Coincident, Sample};
use crate::subject::Subject;
use crate::work::{Doubles, TOGETHER};

/// Judgement of a result at coincident points, from best to worst.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Verdict {
    /// The documented value.
    Right,
    /// At least one number is NaN or infinite.
    NotFinite,
    /// Finite numbers that differ from the documented ones.
    Wrong,
}

impl Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Right => "right",
            Self::NotFinite => "NaN",
            Self::Wrong => "wrong",
        })
    }
}

impl Serialize for Verdict {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

/// The verdict on one source.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Outcome {
    /// The code that computed the result.
    pub source: Source,
    /// Judgement of that result.
    pub verdict: Verdict,
}

impl Coincident {
    /// Creates the case of a singular potential: its documented gradient and Hessian are 0.
    pub(crate) fn singular(sample: Sample, value: f64) -> Self {
        let points = sample.unknowns.len() / 3;
        let mut expected = vec![0.0; 1 + 3 * points + 9 * points * (points + 1) / 2];
        expected[0] = value;
        Self { sample, expected }
    }

    /// Judges the value, gradient and Hessian blocks (or residual and Jacobian) in `numbers`.
    #[must_use]
    pub fn judge(&self, source: Source, numbers: &[f64]) -> Outcome {
        let verdict = if numbers.iter().any(|number| !number.is_finite()) {
            Verdict::NotFinite
        } else if difference(numbers, &self.expected, self.sample.unknowns.len()) <= TOLERANCE {
            Verdict::Right
        } else {
            Verdict::Wrong
        };
        Outcome { source, verdict }
    }

    /// The verdicts on all code that is compiled into this program. Generated code is judged by its worst result among
    /// the plain method and every lane at every level.
    #[must_use]
    pub fn verdicts<K: Subject>(&self) -> Vec<Outcome> {
        let sample = &self.sample;
        let copies = vec![sample.clone(); TOGETHER];
        let plain = K::generated_plain(&K::element(&sample.generated), &sample.unknowns).numbers();
        let lanes = available().flat_map(|level| collect::<K, Doubles>(&copies, level, false));
        let generated = std::iter::once(plain).chain(lanes).map(|numbers| self.judge(Source::Generated, &numbers));
        let mut outcomes = vec![generated.max_by_key(|outcome| outcome.verdict).expect("the plain method")];
        if let Some(uncompensated) = K::uncompensated(std::slice::from_ref(sample)) {
            outcomes.push(self.judge(Source::Uncompensated, &uncompensated.answers[0]));
        }
        let hand = K::hand::<f64, Baseline>(&K::Hand::<f64>::from_fn(|i| sample.hand[i]));
        outcomes.push(self.judge(Source::HandDerived, &hand.numbers()));
        outcomes.push(self.judge(Source::NumDual, &K::dual(&sample.textbook).numbers()));
        outcomes
    }
}
