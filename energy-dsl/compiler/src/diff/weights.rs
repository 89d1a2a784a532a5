//! Weighted sums of numbered things, with exact tests for zero.

use std::collections::BTreeMap;

/// A weight. Beside its value it has its residue modulo a prime, which sums, products and quotients determine without
/// rounding: the weight is 0 where the residue is. (Its numerator might be a multiple of the prime instead. For weights
/// that were not made for it, the chance is 10⁻¹⁸.)
#[derive(Clone, Copy, Debug)]
pub(super) struct Weight {
    value: f64,
    residue: u64,
}

/// The prime 2⁶² − 57.
const PRIME: u64 = (1 << 62) - 57;
/// The largest denominator of a fraction that is looked for behind a rounded number.
const LARGEST: u32 = 1000;

fn product(a: u64, b: u64) -> u64 {
    (u128::from(a) * u128::from(b) % u128::from(PRIME)) as u64
}

fn power(base: u64, exponent: u64) -> u64 {
    let square = |x| product(x, x);
    let bits = (0..u64::BITS - exponent.leading_zeros()).rev();
    bits.fold(1, |x, bit| if exponent >> bit & 1 == 1 { product(square(x), base) } else { square(x) })
}

fn inverse(a: u64) -> u64 {
    power(a, PRIME - 2)
}

/// Returns the residue of an integer.
fn residue(integer: f64) -> u64 {
    (integer as i128).rem_euclid(PRIME.into()) as u64
}

impl Weight {
    pub(super) const ONE: Self = Self { value: 1.0, residue: 1 };
    pub(super) const MINUS_ONE: Self = Self { value: -1.0, residue: PRIME - 1 };

    /// Creates the weight that rounds to `value`: a fraction of a small denominator, or else the number itself. `None`
    /// unless it is of moderate size.
    pub(super) fn of(value: f64) -> Option<Self> {
        let moderate = 2f64.powi(50);
        let fraction = Self::fraction(value);
        let exact = || {
            // The last digit of a number above 2⁻⁵⁰ is 2⁻¹⁰² or more.
            let scale = 2f64.powi(102);
            let integer = value * scale;
            Self { value, residue: product(residue(integer), inverse(power(2, 102))) }
        };
        (value == 0.0 || (1.0 / moderate..moderate).contains(&value.abs())).then(|| fraction.unwrap_or_else(exact))
    }

    /// Returns the fraction of a small denominator that rounds to `value`.
    fn fraction(value: f64) -> Option<Self> {
        (1..=LARGEST).map(f64::from).find_map(|denominator| {
            let numerator = (value * denominator).round();
            let residue = || product(residue(numerator), inverse(denominator as u64));
            (numerator.abs() < 2f64.powi(53) && numerator / denominator == value)
                .then(|| Self { value, residue: residue() })
        })
    }

    /// Returns the value. If it is a fraction of a small denominator, that is rounded once.
    pub(super) fn value(self) -> f64 {
        let near = (1..=LARGEST).map(f64::from).find_map(|denominator| {
            let fraction = (self.value * denominator).round() / denominator;
            // A residue takes long to compute, and few denominators fit.
            let is_near = (fraction - self.value).abs() <= 1e-12 * self.value.abs();
            let fraction = is_near.then(|| Self::fraction(fraction)).flatten();
            fraction.filter(|fraction| fraction.residue == self.residue)
        });
        near.map_or(self.value, |fraction| fraction.value)
    }

    fn plus(self, other: Self) -> Self {
        Self { value: self.value + other.value, residue: (self.residue + other.residue) % PRIME }
    }

    pub(super) fn times(self, other: Self) -> Self {
        Self { value: self.value * other.value, residue: product(self.residue, other.residue) }
    }

    /// Returns 1/a.
    pub(super) fn reciprocal(self) -> Self {
        Self { value: 1.0 / self.value, residue: inverse(self.residue) }
    }
}

/// Weights of numbered things, without zeros.
#[derive(Clone, Debug, Default)]
pub(super) struct Sum(BTreeMap<usize, Weight>);

impl Sum {
    /// Creates the sum that is one thing.
    pub(super) fn of(thing: usize) -> Self {
        Self(BTreeMap::from([(thing, Weight::ONE)]))
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = (usize, f64)> {
        self.0.iter().map(|(&thing, weight)| (thing, weight.value()))
    }

    pub(super) fn times(&self, factor: Weight) -> Self {
        Self::default().plus(factor, self)
    }

    /// Returns `self + factor · other`.
    pub(super) fn plus(&self, factor: Weight, other: &Self) -> Self {
        let mut sum = self.0.clone();
        for (&thing, &weight) in &other.0 {
            let term = factor.times(weight);
            let total = sum.get(&thing).map_or(term, |&known| known.plus(term));
            if total.residue == 0 {
                sum.remove(&thing);
            } else {
                sum.insert(thing, total);
            }
        }
        Self(sum)
    }

    /// Returns `self − other`.
    pub(super) fn minus(&self, other: &Self) -> Self {
        self.plus(Weight::MINUS_ONE, other)
    }

    /// Returns whether the weights of some things add up to 0.
    pub(super) fn cancels(&self, counts: impl Fn(usize) -> bool) -> bool {
        let counted = self.0.iter().filter(|(thing, _)| counts(**thing));
        counted.fold(0, |sum, (_, weight)| (sum + weight.residue) % PRIME) == 0
    }

    /// Returns the number of weights.
    pub(super) fn len(&self) -> u64 {
        self.0.len() as u64
    }

    /// Returns the size of the largest weight.
    pub(super) fn largest(&self) -> f64 {
        self.0.values().map(|weight| weight.value.abs()).fold(0.0, f64::max)
    }
}

/// Independent sums, and what they span.
#[derive(Default)]
pub(super) struct Span {
    /// The independent sums.
    pub(super) basis: Vec<Sum>,
    /// What remains of each after those before it were subtracted: a thing that it has, the weights, and the same as a
    /// sum of the basis.
    remainders: Vec<(usize, Sum, Sum)>,
}

impl Span {
    /// Returns a sum in terms of the basis. A sum that the basis does not span joins it.
    pub(super) fn in_basis(&mut self, sum: &Sum) -> Sum {
        let (mut remainder, mut known) = (sum.clone(), Sum::default());
        for (thing, other, in_basis) in &self.remainders {
            let Some(weight) = remainder.0.get(thing) else { continue };
            let factor = weight.times(other.0[thing].reciprocal());
            remainder = remainder.minus(&other.times(factor));
            known = known.plus(factor, in_basis);
        }
        let largest = remainder.0.iter().max_by(|a, b| a.1.value.abs().total_cmp(&b.1.value.abs()));
        let Some((&thing, _)) = largest else { return known };
        let own = Sum::of(self.basis.len());
        self.remainders.push((thing, remainder, own.minus(&known)));
        self.basis.push(sum.clone());
        own
    }
}

#[cfg(test)]
mod tests {
    use super::{Span, Sum, Weight};

    fn sum(weights: &[(usize, f64)]) -> Sum {
        let add = |sum: Sum, &(thing, weight): &(usize, f64)| sum.plus(Weight::of(weight).unwrap(), &Sum::of(thing));
        weights.iter().fold(Sum::default(), add)
    }

    fn weights(sum: &Sum) -> Vec<(usize, f64)> {
        sum.iter().collect()
    }

    const THIRD: f64 = 1.0 / 3.0;
    /// A number that is no fraction.
    const GAUSS: f64 = 0.211_324_865_405_187_1;

    #[test]
    fn sums_cancel_exactly() {
        assert!(sum(&[(0, THIRD), (1, THIRD), (2, THIRD), (3, -1.0)]).cancels(|_| true));
        assert!(sum(&[(0, 0.1), (1, 0.2), (2, -0.3)]).cancels(|_| true));
        assert!(sum(&[(0, GAUSS), (1, -GAUSS)]).cancels(|_| true));
        assert!(!sum(&[(0, 0.5), (1, -1.0)]).cancels(|_| true));
        assert!(!sum(&[(0, GAUSS), (1, -GAUSS.next_up())]).cancels(|_| true));
        assert_eq!(weights(&sum(&[(0, THIRD), (1, 2.0), (0, -THIRD)])), [(1, 2.0)]);
    }

    #[test]
    fn extreme_weights_are_refused() {
        for value in [1e-20, 1e20, f64::NAN, f64::INFINITY] {
            assert!(Weight::of(value).is_none(), "{value}");
        }
        assert_eq!(Weight::of(0.0).unwrap().residue, 0);
    }

    #[test]
    fn a_dependent_sum_is_found_in_the_basis() {
        let mut span = Span::default();
        let (mean, edge) = (sum(&[(0, 0.5), (1, 0.5), (2, -1.0)]), sum(&[(0, 1.0), (1, -1.0)]));
        assert_eq!(weights(&span.in_basis(&mean)), [(0, 1.0)]);
        assert_eq!(weights(&span.in_basis(&edge)), [(1, 1.0)]);
        // x₀ − x₂ is the first plus half the second.
        assert_eq!(weights(&span.in_basis(&sum(&[(0, 1.0), (2, -1.0)]))), [(0, 1.0), (1, 0.5)]);
        assert_eq!(span.basis.len(), 2);
    }

    #[test]
    fn weights_that_are_no_fractions_have_a_rank_too() {
        let mut span = Span::default();
        let [edge, other] = [(0, 1), (2, 3)].map(|(a, b)| sum(&[(a, 1.0), (b, -1.0)]));
        span.in_basis(&edge);
        span.in_basis(&other);
        let mixed = edge.times(Weight::of(GAUSS).unwrap()).plus(Weight::of(THIRD).unwrap(), &other);
        assert_eq!(weights(&span.in_basis(&mixed)), [(0, GAUSS), (1, THIRD)]);
        assert_eq!(span.basis.len(), 2);
    }
}
