//! Parses bodies: statements and a result.

use super::ast::{Body, ExpressionKind, Let};
use super::parse::{Parsed, Parser};
use super::tokens::{Kind as TokenKind, Token};
use crate::diagnostic::Diagnostic;

impl Parser<'_> {
    /// Parses what follows the head of a declaration: `{ … }` or `= "…";`.
    pub(super) fn declaration_body(&mut self) -> Parsed<Body> {
        if self.take("=") {
            let result = self.expression()?;
            self.expect(";", "after the formula")?;
            return Ok(match result.kind {
                ExpressionKind::Body(body) => *body,
                _ => Body::of(result),
            });
        }
        if !self.is("{") {
            return self.fail("`{` and the formula, or `= \"…\";`");
        }
        self.braced_body()
    }

    pub(super) fn braced_body(&mut self) -> Parsed<Body> {
        self.expect("{", "to open the body")?;
        let body = self.body(true)?;
        self.expect("}", "after the result")?;
        Ok(body)
    }

    /// Parses statements and a result, up to the closing brace or the end of a string.
    pub(super) fn body(&mut self, braced: bool) -> Parsed<Body> {
        let mut constants = Vec::new();
        let mut body = (Vec::new(), Vec::new());
        let mut next = None;
        loop {
            if braced && let Some(block) = self.next_block(next.is_some())? {
                next = Some(block);
                continue;
            }
            if self.take_word("fn") {
                body.0.push(self.user_function()?);
            } else if self.take_word("const") {
                constants.push(self.constant()?);
            } else if self.is_word("rest") && self.tokens.get(self.at + 1).is_some_and(|t| t.text == "{") {
                self.at += 2;
                while !self.take("}") {
                    let statement = self.statement(true)?;
                    body.1.push(statement);
                }
            } else if self.is_word("let") || (!braced && self.next_is_definition()) {
                let statement = self.statement(false)?;
                body.1.push(statement);
            } else {
                break;
            }
        }
        if (braced && self.is("}")) || self.peek().is_none() {
            return self.fail("the result of the body, an expression without `;`");
        }
        if braced && self.next_is_definition() {
            let name = self.found();
            let message = format!("expected `let` before the definition of {name}");
            return Err(Box::new(
                Diagnostic::new(&self.span(), message).help(format!("write let {} = …;", name.trim_matches('`'))),
            ));
        }
        let result = self.expression()?;
        if self.is(";") {
            return Err(Box::new(
                Diagnostic::new(&self.span(), "expected the result to be the last expression, found `;`")
                    .help("put the result last, without `;`; name intermediate values with `let name = …;`"),
            ));
        }
        if braced && let Some(block) = self.next_block(next.is_some())? {
            next = Some(block);
        }
        Ok(Body { constants, functions: body.0, lets: body.1, next, result: Box::new(result) })
    }

    fn next_is_definition(&self) -> bool {
        matches!(self.peek(), Some(Token { kind: TokenKind::Name(_), .. }))
            && self.tokens.get(self.at + 1).is_some_and(|t| t.kind == TokenKind::Symbol("=".into()))
    }

    pub(super) fn statement(&mut self, rest: bool) -> Parsed<Let> {
        self.count_definition()?;
        let has_let = self.take_word("let");
        if has_let && self.is_word("mut") && matches!(self.tokens.get(self.at + 1), Some(t) if t.text != "=") {
            let mutable = Diagnostic::new(&self.span(), "values never change, found `let mut`");
            return Err(Box::new(mutable.help("write `let x = …;`, and give a new value a new name")));
        }
        if !has_let && !self.next_is_definition() {
            return self.fail("`let name = …;`");
        }
        let name = self.name("a name after `let`")?;
        self.expect("=", "after the name")?;
        let value = self.expression()?;
        self.expect(";", "after the value")?;
        Ok(Let { name, value, rest })
    }
}
