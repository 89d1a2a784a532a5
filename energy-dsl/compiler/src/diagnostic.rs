//! Errors as values: what was expected, what was found, where, and how to fix it.

use std::borrow::Cow;
use std::fmt;
use std::rc::Rc;

use proc_macro2::Span as TokenSpan;

/// A place in a declaration. Inside a string literal, where the compiler has no spans, it also records the characters.
#[derive(Clone, Debug)]
pub struct Span {
    /// Span of the token.
    pub token: TokenSpan,
    /// Characters within a text; `None` outside of texts.
    pub excerpt: Option<Excerpt>,
}

/// A range of a text.
#[derive(Clone, Debug)]
pub struct Excerpt {
    /// The whole text.
    pub text: Rc<str>,
    /// Offset of the first byte.
    pub start: usize,
    /// Offset past the last byte.
    pub end: usize,
    /// File name of the text; `None` if it does not come from a file.
    pub file: Option<Rc<str>>,
}

impl Excerpt {
    /// Returns the line that contains the range, and its line and column numbers from 0.
    fn line(&self) -> (&str, usize, usize) {
        let before = &self.text[..self.start];
        let line_start = before.rfind('\n').map_or(0, |at| at + 1);
        let line = self.text[line_start..].lines().next().unwrap_or("");
        (line, before.matches('\n').count(), before[line_start..].chars().count())
    }
}

impl Span {
    /// Creates the place of a token.
    #[must_use]
    pub fn of(token: TokenSpan) -> Self {
        Self { token, excerpt: None }
    }

    /// Creates a place within the text of this one.
    #[must_use]
    pub fn within(&self, start: usize, end: usize) -> Self {
        let excerpt = self.excerpt.as_ref().map(|e| Excerpt { start, end, ..e.clone() });
        Self { token: self.token, excerpt }
    }

    /// Returns the line that contains the place, with marks below the place; `None` outside of texts.
    fn marked(&self) -> Option<String> {
        let excerpt = self.excerpt.as_ref()?;
        let (line, _, column) = excerpt.line();
        let marked = excerpt.text[excerpt.start..excerpt.end.max(excerpt.start)].lines().next().unwrap_or("");
        let (line, column) = around(line, column);
        let width = marked.chars().count().min(line.chars().count().saturating_sub(column));
        Some(format!("\n  | {line}\n  | {}{}", " ".repeat(column), "^".repeat(width.max(1))))
    }

    /// Returns `file:line:column` if the place is in a file, and otherwise `line:column` of the token.
    fn place(&self) -> String {
        let start = self.token.start();
        self.place_in_file().unwrap_or_else(|| format!("{}:{}", start.line, start.column + 1))
    }

    /// Returns `file:line:column` if the place is in a file.
    fn place_in_file(&self) -> Option<String> {
        let excerpt = self.excerpt.as_ref()?;
        let (file, (_, line, column)) = (excerpt.file.as_ref()?, excerpt.line());
        Some(format!("{file}:{}:{}", line + 1, column + 1))
    }
}

/// Maximum number of characters of a message.
const LONGEST_MESSAGE: usize = 1000;

/// Leaves out the middle of a message that quotes a long text.
fn shortened(message: String) -> String {
    if message.len() <= LONGEST_MESSAGE {
        return message;
    }
    let (length, kept) = (message.chars().count(), LONGEST_MESSAGE / 2);
    let part = |from: usize| message.chars().skip(from).take(kept).collect::<String>();
    if length <= LONGEST_MESSAGE { message } else { format!("{} … {}", part(0), part(length - kept)) }
}

/// Maximum number of characters of a quoted line.
const LONGEST_LINE: usize = 400;

/// Returns the part of a long line around a column, and the column in it.
fn around(line: &str, column: usize) -> (Cow<'_, str>, usize) {
    if line.chars().count() <= LONGEST_LINE {
        return (line.into(), column);
    }
    let first = column.saturating_sub(LONGEST_LINE / 4);
    let part: String = line.chars().skip(first).take(LONGEST_LINE).collect();
    if first == 0 {
        (format!("{part}…").into(), column)
    } else {
        (format!("…{part}…").into(), column - first + 1)
    }
}

/// An error in a text.
#[derive(Clone, Debug)]
pub struct Diagnostic {
    /// Message: expected and found.
    pub message: String,
    /// How to fix it; `None` if unknown.
    pub help: Option<String>,
    /// Place of the error.
    pub span: Span,
    /// Another place that the error concerns, and a note on it.
    pub other: Option<(String, Span)>,
    /// Whether rustc has reported the error, as it does with a bad escape in a string. It is not reported again.
    pub known_to_rustc: bool,
    /// Whether compiling ended here. What is reported afterwards may be a consequence, and is left out.
    pub(crate) is_end: bool,
}

impl Diagnostic {
    /// Creates an error at a place.
    pub fn new(span: &Span, message: impl Into<String>) -> Self {
        Self {
            message: shortened(message.into()),
            help: None,
            span: span.clone(),
            other: None,
            known_to_rustc: false,
            is_end: false,
        }
    }

    /// Creates an error that rustc has reported already.
    pub(crate) fn known_to_rustc(span: &Span) -> Self {
        Self { known_to_rustc: true, ..Self::new(span, "an error of Rust") }
    }

    /// Adds another place, and a note on it.
    #[must_use]
    pub fn see(mut self, other: (String, Span)) -> Self {
        self.other = Some(other);
        self
    }

    /// Adds how to fix it.
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
        f.write_str(&self.span.marked().unwrap_or_default())?;
        if let Some((what, span)) = &self.other {
            write!(f, "\nnote: {what} at {}{}", span.place(), span.marked().unwrap_or_default())?;
        }
        if let Some(help) = &self.help {
            write!(f, "\nhelp: {help}")?;
        }
        Ok(())
    }
}

/// Maximum number of errors of a text; further ones are left out.
const MOST_ERRORS: usize = 100;

/// All errors of a text, in the order they were found. They are displayed with line:column.
#[derive(Clone, Debug, Default)]
pub struct Diagnostics(pub Vec<Diagnostic>);

impl Diagnostics {
    /// Adds an error, unless rustc has reported it.
    pub fn push(&mut self, diagnostic: Diagnostic) {
        let ended = self.0.len() >= MOST_ERRORS || self.0.last().is_some_and(|last| last.is_end);
        if !diagnostic.known_to_rustc && !ended {
            self.0.push(diagnostic);
        }
    }

    /// Adds all errors of a part.
    pub(crate) fn append(&mut self, part: Self) {
        part.0.into_iter().for_each(|diagnostic| self.push(diagnostic));
    }

    /// Returns `value` without errors.
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
            write!(f, "{}: {diagnostic}", diagnostic.span.place())?;
        }
        Ok(())
    }
}

impl std::error::Error for Diagnostics {}

/// Longest name that is compared with others.
const LONGEST_NAME: usize = 100;

/// Returns the known name that `name` is probably a misspelling of.
#[must_use]
pub fn nearest<'a>(name: &str, known: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    // Single letters are excluded: each is similar to every other.
    let length = name.chars().count();
    if length > LONGEST_NAME {
        return None;
    }
    let limit = (1 + length / 4).min(length.saturating_sub(1));
    let distance = |known: &str| match known.to_lowercase() == name.to_lowercase() {
        true => 0,
        false => edit_distance(name, known),
    };
    known.into_iter().map(|k| (distance(k), k)).filter(|&(d, _)| d <= limit).min().map(|(_, k)| k)
}

/// Counts the characters to insert, delete, replace or exchange with their neighbour (Damerau).
fn edit_distance(a: &str, b: &str) -> usize {
    let (a, b): (Vec<char>, Vec<char>) = (a.chars().collect(), b.chars().collect());
    let mut rows = vec![(0..=b.len()).collect::<Vec<usize>>()];
    for i in 1..=a.len() {
        let mut row = vec![i];
        for j in 1..=b.len() {
            let substituted = rows[i - 1][j - 1] + usize::from(a[i - 1] != b[j - 1]);
            let mut least = substituted.min(row[j - 1] + 1).min(rows[i - 1][j] + 1);
            if i > 1 && j > 1 && (a[i - 1], a[i - 2]) == (b[j - 2], b[j - 1]) {
                least = least.min(rows[i - 2][j - 2] + 1);
            }
            row.push(least);
        }
        rows.push(row);
    }
    rows[a.len()][b.len()]
}
