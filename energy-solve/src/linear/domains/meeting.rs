//! Where threads that solve one system together wait for each other, and sums that all of them know.

use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};

/// Looks before a thread that waits lets others run.
const PATIENCE: u32 = 1 << 12;

/// A barrier for waits of a few microseconds, in which no thread goes to sleep.
#[derive(Debug)]
pub(crate) struct Meeting {
    participants: usize,
    arrived: AtomicUsize,
    round: AtomicUsize,
}

impl Meeting {
    /// For so many threads.
    pub(crate) fn new(participants: usize) -> Self {
        Self { participants, arrived: AtomicUsize::new(0), round: AtomicUsize::new(0) }
    }

    /// Returns when all threads have called it. What they wrote before, all can read.
    pub(crate) fn wait(&self) {
        if self.participants == 1 {
            return;
        }
        let round = self.round.load(Ordering::Acquire);
        if self.arrived.fetch_add(1, Ordering::AcqRel) + 1 == self.participants {
            self.arrived.store(0, Ordering::Relaxed);
            self.round.store(round.wrapping_add(1), Ordering::Release);
            return;
        }
        let mut looks = 0;
        while self.round.load(Ordering::Acquire) == round {
            looks += 1;
            if looks < PATIENCE { std::hint::spin_loop() } else { std::thread::yield_now() }
        }
    }
}

/// One number of each domain. Written before a meeting, it can be read after it.
#[derive(Debug)]
pub(crate) struct Shared(Vec<AtomicU64>);

impl Shared {
    /// For so many domains.
    pub(crate) fn new(domains: usize) -> Self {
        Self((0..domains).map(|_| AtomicU64::new(0)).collect())
    }

    /// A domain's number.
    pub(crate) fn put(&self, domain: usize, number: f64) {
        self.0[domain].store(number.to_bits(), Ordering::Relaxed);
    }

    fn numbers(&self) -> impl Iterator<Item = f64> {
        self.0.iter().map(|number| f64::from_bits(number.load(Ordering::Relaxed)))
    }

    /// The sum, in the order of the domains, whoever wrote them.
    pub(crate) fn sum(&self) -> f64 {
        self.numbers().sum()
    }

    /// The largest.
    pub(crate) fn largest(&self) -> f64 {
        self.numbers().fold(0.0, f64::max)
    }
}
