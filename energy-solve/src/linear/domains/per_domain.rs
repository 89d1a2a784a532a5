use std::sync::atomic::{AtomicU64, Ordering};

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
