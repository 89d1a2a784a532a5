use energy_dsl::Vector3;

use super::{InverseFactor, PerDomain, Precision, scaled};

/// The scale by which a right-hand side is divided, so that its components are at most 1: single precision has a
/// smaller range than double precision.
#[derive(Debug)]
pub(crate) struct RightHandScale {
    largest: PerDomain,
    finite: PerDomain,
}

impl RightHandScale {
    /// Creates the scale for `domains` domains.
    pub(crate) fn new(domains: usize) -> Self {
        Self { largest: PerDomain::new(domains), finite: PerDomain::new(domains) }
    }

    /// Records the largest component of a domain's C⁻¹ b.
    #[inline(always)]
    pub(crate) fn note<T: Precision>(&self, domain: usize, inverses: &[InverseFactor<T>], b: &[Vector3<f64>]) {
        let (mut largest, mut sums) = ([0.0_f64; 3], [0.0; 3]);
        for row in 0..b.len() {
            let components = scaled(&inverses[row], &b[row]);
            for axis in 0..3 {
                // A comparison ignores NaN, but a sum keeps it.
                let size = components[axis].abs();
                largest[axis] = if size > largest[axis] { size } else { largest[axis] };
                sums[axis] += components[axis];
            }
        }
        self.largest.put(domain, largest.into_iter().fold(0.0, f64::max));
        self.finite.put(domain, sums.iter().sum());
    }

    /// Returns the largest component of C⁻¹ b over all domains, to be called after a barrier. Returns 1 if the
    /// components are zero or too small for a reciprocal, and a non-finite number if b is not finite.
    pub(crate) fn combined(&self) -> f64 {
        let largest = self.largest.largest();
        let unit = if largest >= f64::MIN_POSITIVE { largest } else { 1.0 };
        unit + 0.0 * self.finite.sum()
    }
}
