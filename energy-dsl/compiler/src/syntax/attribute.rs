//! Attributes of declarations: documentation, audit, claimed properties and accuracy.

use super::parse::{Parsed, Parser};
use super::tokens::{Kind as TokenKind, Token};
use crate::diagnostic::{Diagnostic, Span};
use energy_runtime::Property;

/// All attributes of a declaration.
#[derive(Default)]
pub(super) struct Attributes {
    pub(super) docs: Vec<String>,
    pub(super) audit_samples: Option<usize>,
    pub(super) properties: Vec<(Property, Span)>,
    pub(super) uncompensated: bool,
}

impl Parser<'_> {
    /// Parses an attribute after its `#`: `[doc = "…"]`, `[audit]`, `[audit(samples = n)]`, `[invariant(translation,
    /// rotation)]`, `[rest_state(zero_force)]`, `[even]` or `[uncompensated]`.
    pub(super) fn attribute(&mut self, attributes: &mut Attributes) -> Parsed<()> {
        self.expect("[", "to open the attribute")?;
        let name = self.name("`doc`, `audit` or a property")?;
        match name.text.as_str() {
            "doc" => {
                self.expect("=", "after doc")?;
                match self.peek().map(|t| &t.kind) {
                    Some(TokenKind::Text(text)) => attributes.docs.push(text.clone()),
                    _ => return self.fail("the documentation as a string"),
                }
                self.at += 1;
            }
            "audit" => attributes.audit_samples = Some(self.samples()?),
            "invariant" => {
                let known =
                    [("translation", Property::TranslationInvariant), ("rotation", Property::RotationInvariant)];
                self.properties(&known, attributes)?;
            }
            "rest_state" => self.properties(&[("zero_force", Property::ZeroForceAtRest)], attributes)?,
            "even" => attributes.properties.push((Property::Even, name.span)),
            "uncompensated" => attributes.uncompensated = true,
            other => {
                return Err(Box::new(Diagnostic::new(&name.span, format!("unknown attribute `{other}`")).help(
                    "a declaration takes doc comments, #[audit], #[audit(samples = 200)], #[invariant(translation, \
                     rotation)], \
                     #[rest_state(zero_force)], #[even] and #[uncompensated]",
                )));
            }
        }
        self.expect("]", "to close the attribute")
    }

    /// Parses `(samples = n)`; returns the default count if there are no parentheses.
    fn samples(&mut self) -> Parsed<usize> {
        if !self.take("(") {
            return Ok(200);
        }
        if !self.take_word("samples") {
            return self.fail("`samples = …`");
        }
        self.expect("=", "after samples")?;
        let samples = match self.peek() {
            Some(Token { kind: TokenKind::Number(n), .. }) if *n >= 1.0 && n.fract() == 0.0 => *n as usize,
            _ => return self.fail("the number of samples"),
        };
        self.at += 1;
        self.expect(")", "after the number of samples")?;
        Ok(samples)
    }

    /// Parses `(name, name)` with known names.
    fn properties(&mut self, known: &[(&str, Property)], attributes: &mut Attributes) -> Parsed<()> {
        let names = known.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(", ");
        self.expect("(", &format!("and one of: {names}"))?;
        while !self.take(")") {
            let name = self.name(&format!("one of: {names}"))?;
            let Some((_, property)) = known.iter().find(|(known, _)| *known == name.text) else {
                let message = format!("unknown property `{}`; expected one of: {names}", name.text);
                return Err(Box::new(Diagnostic::new(&name.span, message)));
            };
            attributes.properties.push((*property, name.span));
            if !self.take(",") && !self.is(")") {
                return self.fail("`,` or `)` after a property");
            }
        }
        Ok(())
    }
}
