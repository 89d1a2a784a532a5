//! Splits the text of a file into tokens with their places, as the Rust compiler does for the input of a macro.

use std::rc::Rc;

use super::tokens::{Kind, OPERATORS, Token, literal_kind};
use super::{characters, notation};
use crate::diagnostic::{Diagnostic, Excerpt, Span};

/// Splits a file into tokens. `at` is the place in Rust code that names the file.
pub(super) fn tokens(text: &str, file: &str, at: &Span) -> Vec<Token> {
    let excerpt = Excerpt { text: text.into(), start: 0, end: 0, file: Some(file.into()) };
    let whole = Span { token: at.token, excerpt: Some(excerpt.clone()) };
    let mut lexer = Lexer { text: excerpt.text, whole: &whole, at: 0, tokens: Vec::new(), attribute: Attribute::No };
    while let Some(c) = lexer.peek() {
        lexer.token(c);
    }
    lexer.tokens
}

/// Tracks whether the lexer is inside `#[…]`, where strings are not formulas.
#[derive(Clone, Copy, PartialEq)]
enum Attribute {
    No,
    Hash,
    Inside(usize),
}

struct Lexer<'a> {
    text: Rc<str>,
    whole: &'a Span,
    at: usize,
    tokens: Vec<Token>,
    attribute: Attribute,
}

impl Lexer<'_> {
    fn rest(&self) -> &str {
        &self.text[self.at..]
    }

    fn peek(&self) -> Option<char> {
        self.rest().chars().next()
    }

    fn span(&self, start: usize) -> Span {
        self.whole.within(start, self.at)
    }

    fn push(&mut self, kind: Kind, start: usize, text: String) {
        let span = self.span(start);
        self.tokens.push(Token { kind, span, notation: false, text });
    }

    /// Adds a token that reports an error.
    fn error(&mut self, start: usize, message: impl Into<String>, help: impl Into<String>) {
        let error = Diagnostic::new(&self.span(start), message).help(help);
        let text = self.text[start..self.at].to_owned();
        self.push(error.into(), start, text);
    }

    /// Consumes characters while `part` holds, and returns them.
    fn take_while(&mut self, part: impl Fn(char) -> bool) -> String {
        let rest = self.rest();
        let taken = rest[..rest.find(|c| !part(c)).unwrap_or(rest.len())].to_owned();
        self.at += taken.len();
        taken
    }

    fn token(&mut self, c: char) {
        let start = self.at;
        // A byte order mark may begin a file.
        if c.is_whitespace() || start == 0 && c == '\u{feff}' {
            self.at += c.len_utf8();
        } else if self.rest().starts_with("//") {
            self.comment();
        } else if self.rest().starts_with("/*") {
            let end = self.rest().find("*/");
            self.at += end.map_or(2, |end| end + 2);
            if end.is_none() {
                self.error(start, "this comment has no end", "close it with `*/`");
                self.at = self.text.len();
            }
        } else if c == '"' {
            self.string();
        } else if is_letter(c) || c == '_' {
            let name = self.take_while(|c| is_letter(c) || c.is_ascii_digit() || c == '_' || characters::is_accent(c));
            self.push(Kind::Name(name.clone()), start, name);
        } else if c.is_ascii_digit() {
            self.number();
        } else {
            self.symbol(c);
        }
    }

    /// Reads a comment. `///` is documentation.
    fn comment(&mut self) {
        let start = self.at;
        let line = self.take_while(|c| c != '\n');
        let Some(docs) = line.strip_prefix("///").filter(|docs| !docs.starts_with('/')) else { return };
        let docs = docs.trim_end_matches('\r').to_owned();
        let symbol = |s: &str| (Kind::Symbol(s.into()), s.to_owned());
        let quoted = format!("{docs:?}");
        for (kind, text) in [
            symbol("#"),
            symbol("["),
            (Kind::Name("doc".into()), "doc".into()),
            symbol("="),
            (Kind::Text(docs), quoted),
            symbol("]"),
        ] {
            self.push(kind, start, text);
        }
    }

    /// Reads a formula in quotes. A backslash is a backslash.
    fn string(&mut self) {
        let start = self.at;
        self.at += 1;
        let content = self.take_while(|c| c != '"');
        let inside = (start + 1, self.at);
        if self.peek().is_none() {
            self.at = start + 1;
            self.error(start, "this string has no end", "close it with `\"`");
            self.at = self.text.len();
            return;
        }
        self.at += 1;
        let quoted = format!("{content:?}");
        let kind = match self.attribute {
            Attribute::Inside(_) => Kind::Text(content),
            _ => Kind::Notation(notation::tokens_within(&self.text, inside, self.whole)),
        };
        self.push(kind, start, quoted);
    }

    fn number(&mut self) {
        let start = self.at;
        let digit = |c: char| c.is_ascii_digit() || c == '_';
        self.take_while(digit);
        // Excludes the first dot of a range.
        if self.rest().starts_with('.') && !self.rest().starts_with("..") {
            self.at += 1;
            self.take_while(digit);
        }
        let exponent = self.rest().strip_prefix(['e', 'E']);
        if exponent.is_some_and(|e| e.trim_start_matches(['+', '-']).starts_with(|c: char| c.is_ascii_digit())) {
            self.at += 1;
            self.take_while(|c| c == '+' || c == '-');
            self.take_while(digit);
        }
        self.take_while(|c| c.is_alphanumeric() || c == '_');
        let text = self.text[start..self.at].to_owned();
        let span = self.span(start);
        let kind = literal_kind(&text, &span, false);
        self.push(kind, start, text);
    }

    fn symbol(&mut self, c: char) {
        let start = self.at;
        let pair = OPERATORS.iter().find(|pair| self.rest().starts_with(**pair));
        let symbol = pair.map_or_else(|| c.to_string(), |pair| (*pair).to_owned());
        self.at += symbol.len();
        if c == '#' && !self.rest().trim_start().starts_with('[') {
            self.error(start, "`#` begins no comment", "comments begin with `//`");
            self.take_while(|c| c != '\n');
            return;
        }
        if !"#[](){}<>=!&|+-*/%^,;:.".contains(c) {
            let (message, help) = characters::misplaced(c);
            let help = help.or_else(|| super::habits::symbol(&symbol).map(str::to_owned));
            let help = help.unwrap_or_else(|| "put mathematical notation in a string: \"‖p − q‖ − L\"".into());
            self.error(start, message, help);
            return;
        }
        self.attribute = match (self.attribute, c) {
            (Attribute::No, '#') => Attribute::Hash,
            (Attribute::Hash, '[') => Attribute::Inside(1),
            (Attribute::Inside(depth), '[') => Attribute::Inside(depth + 1),
            (Attribute::Inside(1) | Attribute::Hash, _) if c == ']' || self.attribute == Attribute::Hash => {
                Attribute::No
            }
            (Attribute::Inside(depth), ']') => Attribute::Inside(depth - 1),
            (same, _) => same,
        };
        self.push(Kind::Symbol(symbol.clone()), start, symbol);
    }
}

/// Returns whether a character belongs to names.
fn is_letter(c: char) -> bool {
    c.is_alphabetic() && characters::halfwidth(c).is_none()
}
