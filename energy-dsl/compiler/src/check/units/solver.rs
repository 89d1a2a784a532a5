//! Solves equations between dimensions. They are linear in the unknown exponents.

use super::dimension::Dimension;

/// Solutions of unknown dimensions.
#[derive(Default)]
pub(super) struct Solver {
    /// Each unknown in terms of others, once an equation determines it.
    solutions: Vec<Option<Dimension>>,
}

impl Solver {
    /// Creates an unknown dimension.
    pub(super) fn fresh(&mut self) -> Dimension {
        self.solutions.push(None);
        Dimension::unknown(self.solutions.len() - 1)
    }

    /// Substitutes all known solutions.
    pub(super) fn resolve(&self, dimension: &Dimension) -> Dimension {
        let mut resolved = dimension.clone();
        // A solution refers to dimensions that were unknown when it was found.
        while let Some((&number, &exponent)) = resolved.unknown.iter().find(|(n, _)| self.solutions[**n].is_some()) {
            let solution = self.solutions[number].clone().unwrap_or_default();
            resolved.unknown.remove(&number);
            resolved = resolved.times_power(&solution, exponent);
        }
        resolved
    }

    /// Requires equal dimensions. On failure, returns both resolved.
    pub(super) fn equal(&mut self, a: &Dimension, b: &Dimension) -> Result<(), (Dimension, Dimension)> {
        let ratio = self.resolve(&a.over(b));
        let Some((&number, &exponent)) = ratio.unknown.iter().next() else {
            return if ratio.is_number() { Ok(()) } else { Err((self.resolve(a), self.resolve(b))) };
        };
        // uᵉ · rest = 1: u = rest^(−1/e).
        let rest = ratio.times_power(&Dimension::unknown(number), -exponent);
        self.solutions[number] = Some(rest.power(-1.0 / exponent));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::super::dimension::{LENGTH, NUMBER};
    use super::*;

    #[test]
    fn unknown_dimensions_follow_from_equations() {
        let mut solver = Solver::default();
        let (a, b) = (solver.fresh(), solver.fresh());
        // a² b = m, a = b: a = b = m^(1/3).
        solver.equal(&a.power(2.0).times(&b), &Dimension::of(LENGTH)).unwrap();
        solver.equal(&a, &b).unwrap();
        assert!(solver.equal(&a.power(3.0), &Dimension::of(LENGTH)).is_ok());
        let (found, wanted) = solver.equal(&b, &Dimension::of(NUMBER)).unwrap_err();
        assert_eq!((found.to_string().as_str(), wanted.is_number()), ("a quantity in m^(1/3)", true));
    }
}
