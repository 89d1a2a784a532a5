//! Errors as values: what was expected, what was found, where, and what would fix it.

use std::fmt;
use std::rc::Rc;

use proc_macro2::Span as TokenSpan;

/// A place in the declaration. Inside a string literal, where the compiler has no spans, also the characters of the literal.
#[derive(Clone, Debug)]
pub struct Span {
    /// The token.
    pub token: TokenSpan,
    /// Characters start..end of a text, if the place is inside one.
    pub excerpt: Option<Excerpt>,
}

/// Part of a text.
#[derive(Clone, Debug)]
pub struct Excerpt {
    /// The whole text.
    pub text: Rc<str>,
    /// First byte.
    pub start: usize,
    /// Past the last byte.
    pub end: usize,
    /// The file that the text is, if it is one.
    pub file: Option<Rc<str>>,
}

impl Excerpt {
    /// The line of the place, and its line and column from 0.
    fn line(&self) -> (&str, usize, usize) {
        let before = &self.text[..self.start];
        let line_start = before.rfind('\n').map_or(0, |at| at + 1);
        let line = self.text[line_start..].lines().next().unwrap_or("");
        (line, before.matches('\n').count(), before[line_start..].chars().count())
    }
}

impl Span {
    /// The place of a token.
    #[must_use]
    pub fn of(token: TokenSpan) -> Self {
        Self { token, excerpt: None }
    }

    /// A part of the text that this is the place of.
    #[must_use]
    pub fn within(&self, start: usize, end: usize) -> Self {
        let excerpt = self.excerpt.as_ref().map(|e| Excerpt { start, end, ..e.clone() });
        Self { token: self.token, excerpt }
    }

    /// The file that it is in, with line and column, if it is in one.
    fn place_in_file(&self) -> Option<String> {
        let excerpt = self.excerpt.as_ref()?;
        let (file, (_, line, column)) = (excerpt.file.as_ref()?, excerpt.line());
        Some(format!("{file}:{}:{}", line + 1, column + 1))
    }
}

/// One error.
#[derive(Clone, Debug)]
pub struct Diagnostic {
    /// What is wrong: what was expected and what was found.
    pub message: String,
    /// What would fix it.
    pub help: Option<String>,
    /// Where.
    pub span: Span,
}

impl Diagnostic {
    /// An error at a place.
    pub fn new(span: &Span, message: impl Into<String>) -> Self {
        Self { message: message.into(), help: None, span: span.clone() }
    }

    /// Adds what would fix it.
    #[must_use]
    pub fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }
}

impl fmt::Display for Diagnostic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(place) = self.span.place_in_file() {
            write!(f, "{place}: ")?;
        }
        f.write_str(&self.message)?;
        if let Some(excerpt) = &self.span.excerpt {
            let (line, _, column) = excerpt.line();
            let marked = excerpt.text[excerpt.start..excerpt.end.max(excerpt.start)].lines().next().unwrap_or("");
            let width = marked.chars().count();
            write!(f, "\n  | {line}\n  | {}{}", " ".repeat(column), "^".repeat(width.max(1)))?;
        }
        if let Some(help) = &self.help {
            write!(f, "\nhelp: {help}")?;
        }
        Ok(())
    }
}

/// All errors of a text, in the order they were found. Displayed with line:column in the text.
#[derive(Clone, Debug, Default)]
pub struct Diagnostics(pub Vec<Diagnostic>);

impl Diagnostics {
    /// Notes an error.
    pub fn push(&mut self, diagnostic: Diagnostic) {
        self.0.push(diagnostic);
    }

    /// `value` if there was no error.
    ///
    /// # Errors
    /// Whatever was noted.
    pub fn finish<T>(self, value: T) -> Result<T, Self> {
        if self.0.is_empty() { Ok(value) } else { Err(self) }
    }
}

impl From<Diagnostic> for Diagnostics {
    fn from(diagnostic: Diagnostic) -> Self {
        Self(vec![diagnostic])
    }
}

impl fmt::Display for Diagnostics {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (number, diagnostic) in self.0.iter().enumerate() {
            if number > 0 {
                f.write_str("\n\n")?;
            }
            if diagnostic.span.place_in_file().is_some() {
                write!(f, "{diagnostic}")?;
                continue;
            }
            let start = diagnostic.span.token.start();
            write!(f, "{}:{}: {diagnostic}", start.line, start.column + 1)?;
        }
        Ok(())
    }
}

impl std::error::Error for Diagnostics {}

/// The name among `known` that `name` was likely meant to be.
#[must_use]
pub fn nearest<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    // A single letter is like every other single letter.
    let length = name.chars().count();
    let limit = (1 + length / 4).min(length.saturating_sub(1));
    known.into_iter().map(|k| (edit_distance(name, k), k)).filter(|&(d, _)| d <= limit).min().map(|(_, k)| k)
}

fn edit_distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, x) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for (j, y) in b.iter().enumerate() {
            let substituted = diagonal + usize::from(x != *y);
            diagonal = row[j + 1];
            row[j + 1] = substituted.min(row[j] + 1).min(diagonal + 1);
        }
    }
    row[b.len()]
}
