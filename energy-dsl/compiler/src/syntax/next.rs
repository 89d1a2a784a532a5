//! Parses `next { … }`: how the state of an element goes on.

use super::ast::{Assignment, Next};
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
            next.assignments.push(self.assignment("the name of a state, as in next { a = b; }, or `let`")?);
        }
        Ok(Some(next))
    }

    /// Parses `a = value;` or `a[i] = value;`.
    fn assignment(&mut self, expected: &str) -> Parsed<Assignment> {
        self.count_definition()?;
        let name = self.name(expected)?;
        let entry = if self.take("[") {
            let index = self.expression()?;
            self.expect("]", "after the index of the entry")?;
            Some(index)
        } else {
            None
        };
        self.expect("=", "and the new value")?;
        let value = self.expression()?;
        self.expect(";", "after the new value")?;
        Ok(Assignment { name, entry, range: None, value })
    }

    /// Parses `j in 0..4 { a[j] = …; … }` after the word `for`.
    fn each_entry(&mut self) -> Parsed<Vec<Assignment>> {
        const FORM: &str = "as in for j in 0..4 { a[j] = b[j]; }";
        let range = self.index_range(FORM)?;
        self.expect("{", FORM)?;
        let mut assignments = Vec::new();
        while !self.take("}") {
            let assignment = self.assignment(&format!("the name of an array, {FORM}"))?;
            if assignment.entry.is_none() {
                let message = format!("a loop gives new values to entries of `{}`", assignment.name.text);
                return Err(Box::new(Diagnostic::new(&assignment.name.span, message).help(FORM)));
            }
            assignments.push(Assignment { range: Some(range.clone()), ..assignment });
        }
        Ok(assignments)
    }
}
