//! Synchronisation of the threads that solve one system.

use std::sync::atomic::{AtomicBool, AtomicU64, AtomicUsize, Ordering};

/// Number of spins before a waiting thread yields.
const PATIENCE: u32 = 1 << 12;

/// Spin barrier for waits of a few microseconds, in which threads do not sleep.
#[derive(Debug)]
pub(crate) struct SpinBarrier {
    participants: usize,
    arrived: AtomicUsize,
    round: AtomicUsize,
    /// Whether a thread panicked, for which the others would wait forever.
    is_broken: AtomicBool,
}

/// The time in which a thread may wait at a barrier.
#[derive(Debug)]
pub(crate) struct Participation<'a>(&'a SpinBarrier);

impl Drop for Participation<'_> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            self.0.is_broken.store(true, Ordering::Release);
        }
    }
}

impl SpinBarrier {
    /// Creates a barrier for `participants` threads.
    pub(crate) fn new(participants: usize) -> Self {
        let (arrived, round) = (AtomicUsize::new(0), AtomicUsize::new(0));
        Self { participants, arrived, round, is_broken: AtomicBool::new(false) }
    }

    /// Begins the participation of a thread. If it panics meanwhile, the other threads panic instead of waiting.
    pub(crate) fn participate(&self) -> Participation<'_> {
        Participation(self)
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
            assert!(!self.is_broken.load(Ordering::Acquire), "another thread of the solver panicked");
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::threads::in_parts;

    #[test]
    #[should_panic(expected = "panicked")]
    fn a_panic_keeps_no_thread_waiting() {
        let barrier = SpinBarrier::new(2);
        in_parts(2, vec![0, 1], |parts| {
            let _participation = barrier.participate();
            assert!(parts != [1], "one panicked");
            barrier.wait();
        });
    }
}
