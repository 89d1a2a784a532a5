//! Attributes of declarations: documentation, audit, claimed properties and accuracy.

use super::ast::{AuditRange, AuditScope};
use super::name::Name;
use super::parse::{Parsed, Parser};
use super::tokens::{Kind as TokenKind, Token};
use crate::budget::Limits;
use crate::diagnostic::{Diagnostic, Span};
use energy_runtime::Property;

/// All attributes of a declaration.
#[derive(Default)]
pub(super) struct Attributes {
    pub(super) docs: Vec<String>,
    pub(super) audit_samples: Option<usize>,
    pub(super) audit_scope: AuditScope,
    pub(super) properties: Vec<(Property, Span)>,
    pub(super) uncompensated: bool,
    pub(super) vertices: bool,
    pub(super) limits: Option<Limits>,
    pub(super) time_step: Option<Box<Name>>,
}

impl Parser<'_> {
    /// Parses an attribute after its `#`: `[doc = "…"]`, `[audit]`, `[audit(samples = n, …)]`, `[invariant(translation,
    /// rotation)]`, `[rest_state(zero_force)]`, `[even]`, `[uncompensated]`, `[vertex]`, `[time_step(h)]` or `[limits(steps = n,
    /// bytes = n)]`.
    pub(super) fn attribute(&mut self, attributes: &mut Attributes) -> Parsed<()> {
        if self.fault().is_none() && !self.is("[") {
            let comment =
                Diagnostic::new(&self.span(), format!("expected an attribute after `#`, found {}", self.found()));
            return Err(Box::new(comment.help("write #[audit], or begin a comment with `//`")));
        }
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
            "audit" => self.audit(attributes)?,
            "invariant" => {
                let known =
                    [("translation", Property::TranslationInvariant), ("rotation", Property::RotationInvariant)];
                self.properties(&known, attributes)?;
            }
            "rest_state" => self.properties(&[("zero_force", Property::ZeroForceAtRest)], attributes)?,
            "even" => attributes.properties.push((Property::Even, name.span)),
            "uncompensated" => attributes.uncompensated = true,
            "vertex" => attributes.vertices = true,
            "time_step" => {
                self.expect("(", "and the parameter that is the time step, as in #[time_step(h)]")?;
                attributes.time_step = Some(Box::new(self.name("the parameter that is the time step")?));
                self.expect(")", "after the name of the time step")?;
            }
            "limits" => attributes.limits = Some(self.limits()?),
            other => {
                return Err(Box::new(Diagnostic::new(&name.span, format!("unknown attribute `{other}`")).help(
                    "a declaration takes doc comments, #[audit], #[audit(samples = 200)], \
                     #[audit(domain(k = 1..10), tolerance = 1e-6)], #[invariant(translation, rotation)], \
                     #[rest_state(zero_force)], #[even], #[uncompensated], #[vertex], #[time_step(h)] and \
                     #[limits(steps = 1e9, bytes = 2e9)]",
                )));
            }
        }
        self.expect("]", "to close the attribute")
    }

    /// Parses `(samples = n, domain(name = a..b, …), tolerance = x)`, in any order, or nothing.
    fn audit(&mut self, attributes: &mut Attributes) -> Parsed<()> {
        attributes.audit_samples.get_or_insert(200);
        if !self.take("(") {
            return Ok(());
        }
        while !self.take(")") {
            let option = self.name("`samples`, `domain` or `tolerance`")?;
            match option.text.as_str() {
                "samples" => attributes.audit_samples = Some(self.count("samples")?),
                "tolerance" => attributes.audit_scope.tolerance = Some(self.tolerance()?),
                "domain" => self.domain(&mut attributes.audit_scope.ranges)?,
                other => {
                    let message = format!("unknown option `{other}`; expected `samples = …`");
                    return Err(Box::new(Diagnostic::new(&option.span, message).help(
                        "an audit takes samples = 200, domain(k = 1..10, scale = 0.1..1, strain = 0.5..2) and \
                         tolerance = 1e-6",
                    )));
                }
            }
            if !self.take(",") && !self.is(")") {
                return self.fail("`,` or `)` after an option of the audit");
            }
        }
        Ok(())
    }

    /// Parses `(steps = n, bytes = n)`. What is not named keeps its default.
    fn limits(&mut self) -> Parsed<Limits> {
        self.expect("(", "before the limits, as in #[limits(steps = 1e9)]")?;
        let mut limits = Limits::default();
        while !self.take(")") {
            let name = self.name("`steps` or `bytes`")?;
            let limit = match name.text.as_str() {
                "steps" => &mut limits.steps,
                "bytes" => &mut limits.bytes,
                other => {
                    let message = format!("unknown limit `{other}`; expected `steps = …` or `bytes = …`");
                    return Err(Box::new(Diagnostic::new(&name.span, message)));
                }
            };
            *limit = self.count(&name.text)? as u64;
            if !self.take(",") && !self.is(")") {
                return self.fail("`,` or `)` after a limit");
            }
        }
        Ok(limits)
    }

    /// Parses `= n`.
    fn count(&mut self, of: &str) -> Parsed<usize> {
        self.expect("=", &format!("after {of}"))?;
        let count = match self.peek() {
            Some(Token { kind: TokenKind::Number(n), .. }) if *n >= 1.0 && n.fract() == 0.0 => *n as usize,
            _ => return self.fail(&format!("the number of {of}")),
        };
        self.at += 1;
        Ok(count)
    }

    /// Parses `= x`. Errors above 1e-3 would pass any derivative.
    fn tolerance(&mut self) -> Parsed<f64> {
        self.expect("=", "after tolerance")?;
        match self.peek() {
            Some(Token { kind: TokenKind::Number(x), .. }) if *x > 0.0 && *x <= 1e-3 => {
                let tolerance = *x;
                self.at += 1;
                Ok(tolerance)
            }
            _ => self.fail("a relative error from 0 to 1e-3"),
        }
    }

    /// Parses `(name = a..b, …)`.
    fn domain(&mut self, ranges: &mut Vec<AuditRange>) -> Parsed<()> {
        self.expect("(", "before the ranges of the domain")?;
        while !self.take(")") {
            let name = self.name("an input, `scale` or `strain`")?;
            self.expect("=", "between a name and its range")?;
            let low = self.signed_number()?;
            self.expect("..", "between the ends of the range, as in strain = 0.5..2.0")?;
            let high = self.signed_number()?;
            if low >= high {
                let message = format!("the range of `{}` is empty: {low} is not below {high}", name.text);
                return Err(Box::new(Diagnostic::new(&name.span, message).help("write the lower end first")));
            }
            if ranges.iter().any(|range| range.name.text == name.text) {
                let message = format!("`{}` has two ranges", name.text);
                return Err(Box::new(Diagnostic::new(&name.span, message).help("remove one of them")));
            }
            ranges.push(AuditRange { name, low, high });
            if !self.take(",") && !self.is(")") {
                return self.fail("`,` or `)` after a range");
            }
        }
        Ok(())
    }

    fn signed_number(&mut self) -> Parsed<f64> {
        let sign = if self.take("-") { -1.0 } else { 1.0 };
        match self.peek() {
            Some(Token { kind: TokenKind::Number(x), .. }) if x.is_finite() => {
                let number = sign * x;
                self.at += 1;
                Ok(number)
            }
            _ => self.fail("a number"),
        }
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
