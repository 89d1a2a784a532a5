//! Parses `next { … }`: how the state of an element goes on.

use super::ast::{Expression, ExpressionKind, Let, Next, Sum};
use super::parse::{Parsed, Parser};
use crate::diagnostic::Diagnostic;

impl Parser<'_> {
    /// Parses `next { a = …; … }`, if it is here.
    pub(super) fn next_block(&mut self, is_second: bool) -> Parsed<Option<Next>> {
        if !self.is_word("next") || self.tokens.get(self.at + 1).is_none_or(|token| token.text != "{") {
            return Ok(None);
        }
        let span = self.span();
        if is_second {
            return Err(Box::new(
                Diagnostic::new(&span, "a body has one `next` block").help("put all new states into it"),
            ));
        }
        self.at += 2;
        let mut next = Next { lets: Vec::new(), assignments: Vec::new(), span };
        while !self.take("}") {
            if self.is_word("let") {
                next.lets.push(self.statement(false)?);
                continue;
            }
            if self.take_word_before_name("for") {
                next.assignments.extend(self.each_entry()?);
                continue;
            }
            self.count_definition()?;
            let name = self.name("the name of a state, as in next { a = b; }, or `let`")?;
            self.expect("=", "and the new value of the state")?;
            let value = self.expression()?;
            self.expect(";", "after the new value")?;
            next.assignments.push(Let { name, value, rest: false });
        }
        Ok(Some(next))
    }

    /// Parses `j in 0..4 { a[j] = …; … }` after the word `for`.
    fn each_entry(&mut self) -> Parsed<Vec<Let>> {
        const FORM: &str = "as in for j in 0..4 { a[j] = b[j]; }";
        let (index, first, end) = self.index_range(FORM)?;
        self.expect("{", FORM)?;
        let mut assignments = Vec::new();
        while !self.take("}") {
            self.count_definition()?;
            let (span, name) = (self.span(), self.name(&format!("the name of an array, {FORM}"))?);
            self.expect("[", &format!("and the index, {FORM}"))?;
            let place = self.name(&format!("the index `{}`, {FORM}", index.text))?;
            if place.canonical() != index.canonical() {
                let message = format!("the entry must be that of the index `{}`", index.text);
                return Err(Box::new(
                    Diagnostic::new(&place.span, message).help("a loop gives each entry its own value"),
                ));
            }
            self.expect("]", FORM)?;
            self.expect("=", "and the new value of the entry")?;
            let term = self.expression()?;
            self.expect(";", "after the new value")?;
            let each = Sum { index: index.clone(), first: first.clone(), end: end.clone(), term };
            let value = Expression { kind: ExpressionKind::Each(Box::new(each)), span };
            assignments.push(Let { name, value, rest: false });
        }
        Ok(assignments)
    }
}
