use energy_dsl::Vector3;

use super::{InverseFactor, Precision, Shared, scaled};

/// What a right-hand side is divided by: then numbers are of the order of one whatever the unit. Single precision has less range than doubles.
#[derive(Debug)]
pub(crate) struct Unit {
    largest: Shared,
    finite: Shared,
}

impl Unit {
    /// For so many domains.
    pub(crate) fn new(domains: usize) -> Self {
        Self { largest: Shared::new(domains), finite: Shared::new(domains) }
    }

    /// Takes note of a domain's rows of b.
    #[inline(always)]
    pub(crate) fn note<T: Precision>(&self, domain: usize, inverses: &[InverseFactor<T>], b: &[Vector3<f64>]) {
        let (mut largest, mut sum) = (0.0_f64, 0.0);
        for row in 0..b.len() {
            for component in scaled(&inverses[row], &b[row]) {
                largest = largest.max(component.abs());
                // A NaN is not the larger of two numbers, but it spoils a sum.
                sum += component;
            }
        }
        self.largest.put(domain, largest);
        self.finite.put(domain, sum);
    }

    /// The largest component of C⁻¹ b of all domains, when their threads have met, or 1 if all are zero; not finite where b is not.
    pub(crate) fn agreed(&self) -> f64 {
        let largest = self.largest.largest();
        let unit = if largest > 0.0 { largest } else { 1.0 };
        unit + 0.0 * self.finite.sum()
    }
}
