//! Synchronisation of the threads that solve one system.

use std::sync::atomic::{AtomicU64, AtomicUsize, Ordering};

/// Number of spins before a waiting thread yields.
const PATIENCE: u32 = 1 << 12;

/// Spin barrier for waits of a few microseconds, in which threads do not sleep.
#[derive(Debug)]
pub(crate) struct SpinBarrier {
    participants: usize,
    arrived: AtomicUsize,
    round: AtomicUsize,
}

impl SpinBarrier {
    /// Creates a barrier for `participants` threads.
    pub(crate) fn new(participants: usize) -> Self {
        Self { participants, arrived: AtomicUsize::new(0), round: AtomicUsize::new(0) }
    }

    /// Waits until all threads have called this. Everything they wrote before is visible afterwards.
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

/// One number per domain. A number written before a barrier can be read after it.
#[derive(Debug)]
pub(crate) struct PerDomain(Vec<AtomicU64>);

impl PerDomain {
    /// Creates zeros for `domains` domains.
    pub(crate) fn new(domains: usize) -> Self {
        Self((0..domains).map(|_| AtomicU64::new(0)).collect())
    }

    /// Sets the number of a domain.
    pub(crate) fn put(&self, domain: usize, number: f64) {
        self.0[domain].store(number.to_bits(), Ordering::Relaxed);
    }

    fn numbers(&self) -> impl Iterator<Item = f64> {
        self.0.iter().map(|number| f64::from_bits(number.load(Ordering::Relaxed)))
    }

    /// Returns the sum in the order of the domains, so that it does not depend on the threads.
    pub(crate) fn sum(&self) -> f64 {
        self.numbers().sum()
    }

    /// Returns the largest number, or 0 if none is positive.
    pub(crate) fn largest(&self) -> f64 {
        self.numbers().fold(0.0, f64::max)
    }
}
