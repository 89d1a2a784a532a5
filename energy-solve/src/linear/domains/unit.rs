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
        let (mut largest, mut sums) = ([0.0_f64; 3], [0.0; 3]);
        for row in 0..b.len() {
            let components = scaled(&inverses[row], &b[row]);
            for axis in 0..3 {
                // A NaN is not larger than any number, but it spoils a sum.
                let size = components[axis].abs();
                largest[axis] = if size > largest[axis] { size } else { largest[axis] };
                sums[axis] += components[axis];
            }
        }
        self.largest.put(domain, largest.into_iter().fold(0.0, f64::max));
        self.finite.put(domain, sums.iter().sum());
    }

    /// The largest component of C⁻¹ b of all domains, when their threads have met, or 1 if all are zero, or have no reciprocal; not finite where b is not.
    pub(crate) fn agreed(&self) -> f64 {
        let largest = self.largest.largest();
        let unit = if largest >= f64::MIN_POSITIVE { largest } else { 1.0 };
        unit + 0.0 * self.finite.sum()
    }
}
