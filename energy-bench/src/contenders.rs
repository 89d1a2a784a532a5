//! List of all contenders of a kernel.

use std::marker::PhantomData;

use energy_dsl::{LevelName, available, dispatch_at};

pub use crate::contender::Contender;
use crate::run::{Generated, Hand, dual, generated_plain, hand_plain};
use crate::sample::Sample;
use crate::subject::Subject;
use crate::work::{Doubles, One, Singles, Width, Work, lanes, packed};

/// Returns every contender that is compiled into this program, with its work on all elements.
#[must_use]
pub fn contenders<K: Subject>(samples: &[Sample]) -> Vec<(Contender, Work)> {
    let elements: Vec<K::Element> = samples.iter().map(|sample| K::element(&sample.generated)).collect();
    let unknowns = packed::<f64>(samples, 1, |sample| &sample.unknowns);
    let hand_numbers = packed::<f64>(samples, 1, |sample| &sample.hand);
    let mut all: Vec<(Contender, Work)> = vec![
        (Contender::GeneratedPlain, Box::new(move || generated_plain::<K>(&elements, &unknowns))),
        (Contender::HandPlain, Box::new(move || hand_plain::<K>(&hand_numbers))),
    ];
    for level in available() {
        all.extend([
            (Contender::GeneratedScalar(level), generated::<K, One>(samples, level)),
            (Contender::HandScalar(level), hand::<K, One>(samples, level)),
            (Contender::GeneratedLanes(level), generated::<K, Doubles>(samples, level)),
            (Contender::HandLanes(level), hand::<K, Doubles>(samples, level)),
            (Contender::GeneratedSingles(level), generated::<K, Singles>(samples, level)),
            (Contender::HandSingles(level), hand::<K, Singles>(samples, level)),
        ]);
    }
    let size = samples[0].textbook.len();
    let numbers = packed::<f64>(samples, 1, |sample| &sample.textbook);
    all.push((Contender::Dual, Box::new(move || dual::<K>(&numbers, size))));
    all.extend(K::uncompensated(samples).into_iter().flat_map(|uncompensated| uncompensated.contenders));
    if let Some(assembled) = K::assembled(samples) {
        all.extend([
            (Contender::Batches, assembled.batches),
            (Contender::System, assembled.exact),
            (Contender::ScatterOnly, assembled.scatter_only),
            (Contender::Clamped, assembled.clamped),
        ]);
    }
    all
}

fn generated<K: Subject, W: Width>(samples: &[Sample], level: LevelName) -> Work {
    let width = lanes::<W>(level).expect("the level is available");
    let numbers = packed::<W::Scalar>(samples, width, |sample| &sample.generated);
    Box::new(move || dispatch_at(level, Generated::<K, W>(&numbers, PhantomData)).expect("the level is available"))
}

fn hand<K: Subject, W: Width>(samples: &[Sample], level: LevelName) -> Work {
    let width = lanes::<W>(level).expect("the level is available");
    let numbers = packed::<W::Scalar>(samples, width, |sample| &sample.hand);
    Box::new(move || dispatch_at(level, Hand::<K, W>(&numbers, PhantomData)).expect("the level is available"))
}
