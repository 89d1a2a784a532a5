//! Everything that is measured for a kernel.

use std::marker::PhantomData;

use energy_dsl::{LevelName, available, dispatch_at};

pub use crate::contender::Contender;
use crate::run::{Hand, Library, dual, hand_plain, library_plain};
use crate::sample::Sample;
use crate::subject::Subject;
use crate::work::{Doubles, One, Singles, Width, Work, lanes, packed};

/// Every contender that this program runs itself, with its work on all elements.
#[must_use]
pub fn contenders<K: Subject>(samples: &[Sample]) -> Vec<(Contender, Work)> {
    let elements: Vec<K::Element> = samples.iter().map(|sample| K::element(&sample.library)).collect();
    let unknowns = packed::<f64>(samples, 1, |sample| &sample.unknowns);
    let hand_numbers = packed::<f64>(samples, 1, |sample| &sample.hand);
    let mut all: Vec<(Contender, Work)> = vec![
        (Contender::LibraryPlain, Box::new(move || library_plain::<K>(&elements, &unknowns))),
        (Contender::HandPlain, Box::new(move || hand_plain::<K>(&hand_numbers))),
    ];
    for level in available() {
        all.extend([
            (Contender::LibraryScalar(level), library::<K, One>(samples, level)),
            (Contender::HandScalar(level), hand::<K, One>(samples, level)),
            (Contender::LibraryLanes(level), library::<K, Doubles>(samples, level)),
            (Contender::HandLanes(level), hand::<K, Doubles>(samples, level)),
            (Contender::LibrarySingles(level), library::<K, Singles>(samples, level)),
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
            (Contender::Sums, assembled.sums),
            (Contender::Clamped, assembled.clamped),
        ]);
    }
    all
}

fn library<K: Subject, W: Width>(samples: &[Sample], level: LevelName) -> Work {
    let width = lanes::<W>(level).expect("the level is available");
    let numbers = packed::<W::Scalar>(samples, width, |sample| &sample.library);
    Box::new(move || dispatch_at(level, Library::<K, W>(&numbers, PhantomData)).expect("the level is available"))
}

fn hand<K: Subject, W: Width>(samples: &[Sample], level: LevelName) -> Work {
    let width = lanes::<W>(level).expect("the level is available");
    let numbers = packed::<W::Scalar>(samples, width, |sample| &sample.hand);
    Box::new(move || dispatch_at(level, Hand::<K, W>(&numbers, PhantomData)).expect("the level is available"))
}
