//! Dimensions: powers of kilogram, metre, second and kelvin, known or not yet known.

use std::collections::BTreeMap;
use std::fmt;

/// Exponents of kg, m, s and K.
type Exponents = [f64; 4];

/// A product of powers of base units and unknown dimensions.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Dimension {
    pub(super) base: Exponents,
    /// Unknown dimensions by number, with their exponents.
    pub(super) unknown: BTreeMap<usize, f64>,
}

/// Exponents are small fractions. Smaller differences are rounding.
const TOLERANCE: f64 = 1e-9;

pub(super) fn is_zero(exponent: f64) -> bool {
    exponent.abs() < TOLERANCE
}

pub(super) const NUMBER: Exponents = [0.0, 0.0, 0.0, 0.0];
pub(super) const LENGTH: Exponents = [0.0, 1.0, 0.0, 0.0];
pub(super) const VELOCITY: Exponents = [0.0, 1.0, -1.0, 0.0];
pub(super) const TIME: Exponents = [0.0, 0.0, 1.0, 0.0];
pub(super) const FORCE: Exponents = [1.0, 1.0, -2.0, 0.0];
pub(super) const ENERGY: Exponents = [1.0, 2.0, -2.0, 0.0];

/// Units that a text can use.
const UNITS: &[(&str, Exponents)] = &[
    ("kg", [1.0, 0.0, 0.0, 0.0]),
    ("m", LENGTH),
    ("s", TIME),
    ("N", FORCE),
    ("J", ENERGY),
    ("Pa", [1.0, -1.0, -2.0, 0.0]),
    ("W", [1.0, 2.0, -3.0, 0.0]),
    ("Hz", [0.0, 0.0, -1.0, 0.0]),
    ("K", [0.0, 0.0, 0.0, 1.0]),
    ("rad", NUMBER),
    ("1", NUMBER),
];

/// Names and units of common quantities, for messages.
const QUANTITIES: &[(&str, &str, Exponents)] = &[
    ("a number", "1", NUMBER),
    ("a mass", "kg", [1.0, 0.0, 0.0, 0.0]),
    ("a length", "m", LENGTH),
    ("a time", "s", [0.0, 0.0, 1.0, 0.0]),
    ("a temperature", "K", [0.0, 0.0, 0.0, 1.0]),
    ("an area", "m²", [0.0, 2.0, 0.0, 0.0]),
    ("a volume", "m³", [0.0, 3.0, 0.0, 0.0]),
    ("a velocity", "m/s", VELOCITY),
    ("an acceleration", "m/s²", [0.0, 1.0, -2.0, 0.0]),
    ("a force", "N", FORCE),
    ("an energy", "J", ENERGY),
    ("a power", "W", [1.0, 2.0, -3.0, 0.0]),
    ("a pressure", "Pa", [1.0, -1.0, -2.0, 0.0]),
    ("a stiffness", "N/m", [1.0, 0.0, -2.0, 0.0]),
    ("a damping", "N·s/m", [1.0, 0.0, -1.0, 0.0]),
    ("a frequency", "1/s", [0.0, 0.0, -1.0, 0.0]),
    ("a curvature", "1/m", [0.0, -1.0, 0.0, 0.0]),
    ("a density", "kg/m³", [1.0, -3.0, 0.0, 0.0]),
    ("a mass for an area", "kg/m²", [1.0, -2.0, 0.0, 0.0]),
];

impl Dimension {
    pub(super) fn of(base: Exponents) -> Self {
        Self { base, unknown: BTreeMap::new() }
    }

    pub(super) fn unknown(number: usize) -> Self {
        Self { base: NUMBER, unknown: BTreeMap::from([(number, 1.0)]) }
    }

    /// Returns self · otherᵖ.
    pub(super) fn times_power(&self, other: &Self, power: f64) -> Self {
        let mut product = self.clone();
        for (mine, theirs) in product.base.iter_mut().zip(other.base) {
            *mine += power * theirs;
        }
        for (&number, exponent) in &other.unknown {
            *product.unknown.entry(number).or_default() += power * exponent;
        }
        product.unknown.retain(|_, exponent| !is_zero(*exponent));
        product
    }

    pub(super) fn times(&self, other: &Self) -> Self {
        self.times_power(other, 1.0)
    }

    pub(super) fn over(&self, other: &Self) -> Self {
        self.times_power(other, -1.0)
    }

    pub(super) fn power(&self, power: f64) -> Self {
        Self::default().times_power(self, power)
    }

    pub(super) fn is_number(&self) -> bool {
        self.unknown.is_empty() && self.base.iter().all(|&e| is_zero(e))
    }
}

impl fmt::Display for Dimension {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let same = |exponents: &Exponents| exponents.iter().zip(self.base).all(|(a, b)| is_zero(a - b));
        if let Some((name, unit, _)) = QUANTITIES.iter().find(|(_, _, exponents)| same(exponents)) {
            return write!(f, "{name} ({unit})");
        }
        let factors: Vec<String> = ["kg", "m", "s", "K"]
            .iter()
            .zip(self.base)
            .filter(|(_, exponent)| !is_zero(*exponent))
            .map(
                |(unit, exponent)| {
                    if is_zero(exponent - 1.0) { (*unit).into() } else { format!("{unit}^{}", Power(exponent)) }
                },
            )
            .collect();
        write!(f, "a quantity in {}", factors.join("·"))
    }
}

/// An exponent, displayed as a small fraction if it is one.
struct Power(f64);

impl fmt::Display for Power {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let whole = |denominator: &f64| is_zero((self.0 * denominator).round() - self.0 * denominator);
        match [1.0, 2.0, 3.0, 4.0, 6.0].into_iter().find(whole) {
            Some(1.0) => write!(f, "{}", self.0.round()),
            Some(denominator) => write!(f, "({}/{denominator})", (self.0 * denominator).round()),
            None => write!(f, "{}", self.0),
        }
    }
}

/// Parses a unit: names with powers, combined by `·`, `*`, `/` or a space, with parentheses.
///
/// # Errors
/// A message if the text is not a unit.
pub(super) fn parse(text: &str) -> Result<Dimension, String> {
    let characters: Vec<char> = text.chars().collect();
    let mut parser = Parser { characters: &characters, at: 0 };
    let unit = parser.product()?;
    match parser.next() {
        None => Ok(unit),
        Some(c) => Err(format!("unexpected `{c}` in the unit {text}")),
    }
}

struct Parser<'a> {
    characters: &'a [char],
    at: usize,
}

impl Parser<'_> {
    /// Returns the next character that is not a space.
    fn next(&mut self) -> Option<char> {
        while self.characters.get(self.at) == Some(&' ') {
            self.at += 1;
        }
        self.characters.get(self.at).copied()
    }

    fn take(&mut self, wanted: &[char]) -> bool {
        let found = self.next().is_some_and(|c| wanted.contains(&c));
        self.at += usize::from(found);
        found
    }

    fn product(&mut self) -> Result<Dimension, String> {
        let mut product = self.factor()?;
        loop {
            let divide = self.take(&['/', '÷']);
            if !divide
                && !self.take(&['·', '*', '⋅', '×'])
                && !self.next().is_some_and(|c| c.is_alphanumeric() || c == '(')
            {
                return Ok(product);
            }
            let factor = self.factor()?;
            product = if divide { product.over(&factor) } else { product.times(&factor) };
        }
    }

    fn factor(&mut self) -> Result<Dimension, String> {
        let unit = if self.take(&['(']) {
            let inner = self.product()?;
            if !self.take(&[')']) {
                return Err("unbalanced `(` in a unit".into());
            }
            inner
        } else {
            self.unit()?
        };
        if self.take(&['^']) {
            return Ok(unit.power(self.exponent()?));
        }
        let digits = self.superscript();
        if digits.is_empty() { Ok(unit) } else { Ok(unit.power(number(&digits)?)) }
    }

    fn unit(&mut self) -> Result<Dimension, String> {
        if self.take(&['1']) {
            return Ok(Dimension::default());
        }
        self.next();
        let letters = self.characters[self.at..].iter().take_while(|c| c.is_ascii_alphabetic());
        let name: String = letters.collect();
        self.at += name.len();
        if name.is_empty() {
            return Err(self
                .next()
                .map_or("expected a unit, found the end".into(), |c| format!("expected a unit, found `{c}`")));
        }
        let known = UNITS.iter().find(|(unit, _)| *unit == name);
        known.map(|(_, base)| Dimension::of(*base)).ok_or_else(|| format!("unknown unit `{name}`"))
    }

    /// Parses `2`, `-1`, `0.5` or `(1/2)`.
    fn exponent(&mut self) -> Result<f64, String> {
        if !self.take(&['(']) {
            return self.signed();
        }
        let mut value = self.signed()?;
        if self.take(&['/']) {
            value /= self.signed()?;
        }
        if self.take(&[')']) && value.is_finite() { Ok(value) } else { Err("expected a power like (1/2)".into()) }
    }

    fn signed(&mut self) -> Result<f64, String> {
        let sign = if self.take(&['-', '−']) { -1.0 } else { 1.0 };
        self.next();
        let digits: String =
            self.characters[self.at..].iter().take_while(|c| c.is_ascii_digit() || **c == '.').collect();
        self.at += digits.len();
        Ok(sign * number(&digits)?)
    }

    fn superscript(&mut self) -> String {
        const DIGITS: &str = "⁰¹²³⁴⁵⁶⁷⁸⁹";
        let mut digits = String::new();
        while let Some(&c) = self.characters.get(self.at) {
            match DIGITS.chars().position(|d| d == c) {
                Some(digit) => digits.push(char::from(b'0' + digit as u8)),
                None if c == '⁻' => digits.push('-'),
                None => break,
            }
            self.at += 1;
        }
        digits
    }
}

fn number(digits: &str) -> Result<f64, String> {
    if digits.is_empty() {
        return Err("expected a power of a unit, as in m^2".into());
    }
    digits.parse().ok().filter(|power: &f64| power.abs() <= 16.0).ok_or_else(|| format!("`{digits}` is not a power"))
}

/// Lists the known units, for messages.
pub(super) fn known() -> String {
    UNITS.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_are_products_of_powers() {
        for (text, expected) in [
            ("N/m", [1.0, 0.0, -2.0, 0.0]),
            ("N m", ENERGY),
            ("kg·m²/s²", ENERGY),
            ("kg m^2 / s^2", ENERGY),
            ("N s/m", [1.0, 0.0, -1.0, 0.0]),
            ("J/(m s)", [1.0, 1.0, -3.0, 0.0]),
            ("1/s", [0.0, 0.0, -1.0, 0.0]),
            ("m^(1/2)", [0.0, 0.5, 0.0, 0.0]),
            ("m⁻¹ Pa", [1.0, -2.0, -2.0, 0.0]),
            ("Hz rad", [0.0, 0.0, -1.0, 0.0]),
            ("m^-2", [0.0, -2.0, 0.0, 0.0]),
            ("J/(kg K)", [0.0, 2.0, -2.0, -1.0]),
        ] {
            assert_eq!(parse(text).unwrap(), Dimension::of(expected), "{text}");
        }
        for text in ["", "mm", "N//m", "(m", "m)", "m^", "m^x", "m^99", "N+m", "m^(1/0)"] {
            assert!(parse(text).is_err(), "{text}");
        }
    }

    #[test]
    fn quantities_have_names() {
        for (text, name) in
            [("N m", "an energy (J)"), ("m", "a length (m)"), ("kg^2/m^(1/2)", "a quantity in kg^2·m^(-1/2)")]
        {
            assert_eq!(parse(text).unwrap().to_string(), name);
        }
    }
}
