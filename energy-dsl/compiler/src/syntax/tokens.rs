use proc_macro2::{Delimiter, Spacing, TokenStream, TokenTree};

use super::notation;
use crate::diagnostic::{Diagnostic, Span};

/// The kind of a token.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Kind {
    Name(String),
    Number(f64),
    /// A string literal, split into the tokens of its notation.
    Notation(Vec<Token>),
    /// A string literal of an attribute.
    Text(String),
    /// An operator, bracket or separator.
    Symbol(String),
    /// Characters that do not form a token. The parser reports the error where it meets them, and nothing else of the
    /// same declaration.
    Broken(Fault),
}

/// Describes characters that do not form a token.
#[derive(Clone, Debug)]
pub(super) struct Fault(pub(super) Box<Diagnostic>);

impl PartialEq for Fault {
    /// Two faults are never the same token.
    fn eq(&self, _: &Self) -> bool {
        false
    }
}

impl From<Diagnostic> for Kind {
    fn from(error: Diagnostic) -> Self {
        Self::Broken(Fault(Box::new(error)))
    }
}

/// A token and its place.
#[derive(Clone, Debug)]
pub(super) struct Token {
    pub(super) kind: Kind,
    pub(super) span: Span,
    /// Whether it comes from mathematical notation, where juxtaposition is a product.
    pub(super) notation: bool,
    /// Text of the token.
    pub(super) text: String,
}

/// Returns the text of a unit. A space is a product.
pub(super) fn unit_text(tokens: &[Token]) -> String {
    let mut unit = String::new();
    for token in tokens {
        // Units with characters that are not Rust tokens are written as strings.
        if let Ok(text) = syn::parse_str::<syn::LitStr>(&token.text) {
            unit.push_str(&text.value());
            continue;
        }
        let is_name = matches!(token.kind, Kind::Name(_));
        if is_name && unit.ends_with(char::is_alphanumeric) {
            unit.push(' ');
        }
        unit.push_str(&token.text);
    }
    unit
}

/// Returns readable text that splits into the same tokens.
pub(super) fn text(tokens: &[Token]) -> String {
    let mut text = String::new();
    let mut glue = true;
    let mut previous: Option<&Token> = None;
    for token in tokens {
        let closing = matches!(token.text.as_str(), ")" | "]" | "," | ";" | ":" | ".");
        let opening = matches!(token.text.as_str(), "(" | "[" | ".");
        let after_name = text.ends_with(|c: char| c.is_alphanumeric() || c == '_');
        if !(glue || closing || opening && after_name) {
            text.push(' ');
        }
        text.push_str(&token.text);
        let operand_before =
            previous.is_some_and(|t| matches!(t.text.as_str(), ")" | "]") || !matches!(t.kind, Kind::Symbol(_)));
        glue = opening || token.text == "-" && !operand_before;
        previous = Some(token);
    }
    text
}

impl PartialEq for Token {
    fn eq(&self, other: &Self) -> bool {
        self.kind == other.kind
    }
}

pub(super) const OPERATORS: &[&str] = &["==", "!=", "<=", ">=", "&&", "||", "->", ".."];

/// Converts Rust tokens. Strings in attributes stay text; all others are notation.
pub(super) fn from_rust(stream: TokenStream) -> Vec<Token> {
    let mut tokens = Vec::new();
    flatten(stream, &mut tokens, (false, 0));
    tokens
}

/// Nested brackets are walked by recursion, so their depth is bounded. The parser refuses far shallower nesting.
const DEEPEST: usize = 1000;

fn flatten(stream: TokenStream, tokens: &mut Vec<Token>, (attribute, depth): (bool, usize)) {
    let mut trees = stream.into_iter().peekable();
    let mut after_hash = false;
    while let Some(tree) = trees.next() {
        let span = Span::of(tree.span());
        let mut push = |kind, span, text| tokens.push(Token { kind, span, notation: false, text });
        let hash = matches!(&tree, TokenTree::Punct(p) if p.as_char() == '#');
        match tree {
            TokenTree::Ident(name) => push(Kind::Name(name.to_string()), span, name.to_string()),
            TokenTree::Literal(literal) => {
                let kind = literal_kind(&literal.to_string(), &span, attribute);
                push(kind, span, literal.to_string());
            }
            TokenTree::Punct(first) => {
                let mut symbol = first.as_char().to_string();
                if let (Spacing::Joint, Some(TokenTree::Punct(second))) = (first.spacing(), trees.peek()) {
                    let pair = format!("{symbol}{}", second.as_char());
                    if OPERATORS.contains(&pair.as_str()) {
                        symbol = pair;
                        trees.next();
                    }
                }
                push(Kind::Symbol(symbol.clone()), span, symbol);
            }
            TokenTree::Group(group) => {
                let (open, close) = match group.delimiter() {
                    Delimiter::Parenthesis => ("(", ")"),
                    Delimiter::Brace => ("{", "}"),
                    Delimiter::Bracket => ("[", "]"),
                    Delimiter::None => ("", ""),
                };
                if !open.is_empty() {
                    push(Kind::Symbol(open.into()), Span::of(group.span_open()), open.into());
                }
                if depth < DEEPEST {
                    flatten(group.stream(), tokens, (attribute || after_hash, depth + 1));
                }
                if !close.is_empty() {
                    tokens.push(Token {
                        kind: Kind::Symbol(close.into()),
                        span: Span::of(group.span_close()),
                        notation: false,
                        text: close.into(),
                    });
                }
            }
        }
        after_hash = hash;
    }
}

/// Longest number in characters. It holds all digits of any double.
const LONGEST_NUMBER: usize = 1100;

/// Returns the token of a number, or of a string with notation.
pub(super) fn literal_kind(text: &str, span: &Span, attribute: bool) -> Kind {
    // Literals that begin with a digit are not strings. Parsing them takes the square of their length.
    let is_number = text.starts_with(|c: char| c.is_ascii_digit());
    if !is_number && let Ok(string) = syn::parse_str::<syn::LitStr>(text) {
        let content = string.value();
        return if attribute { Kind::Text(content) } else { Kind::Notation(notation::tokens(&content, span)) };
    }
    if text.starts_with('"') {
        // Only rustc passes on a string that is not a token.
        return Diagnostic::known_to_rustc(span).into();
    }
    if text.len() > LONGEST_NUMBER {
        let message = format!("a number of {} characters, and numbers may have {LONGEST_NUMBER}", text.len());
        return Diagnostic::new(span, message).help("write it as 1.5e10").into();
    }
    let plain = text.replace('_', "");
    let plain = plain.trim_end_matches("f64").trim_end_matches("f32");
    if plain.parse::<f64>().is_ok() {
        return number(plain, span);
    }
    let message = format!("expected a number or a string with a formula, found the literal {text}");
    Diagnostic::new(span, message).help("write numbers as 2, 0.5 or 1e-3").into()
}

/// Returns the token of a number as written. Numbers that no double holds are refused.
pub(super) fn number(text: &str, span: &Span) -> Kind {
    let significand = text.split(['e', 'E']).next().unwrap_or_default();
    match text.parse::<f64>() {
        Err(_) => Diagnostic::new(span, format!("`{text}` is not a number")).into(),
        Ok(value) if value.is_infinite() => {
            let message = format!("the number {text} is too large: numbers end at {:e}", f64::MAX);
            Diagnostic::new(span, message).help("write `infinity` for an infinite value").into()
        }
        Ok(0.0) if significand.contains(|c: char| ('1'..='9').contains(&c)) => {
            let message = format!("the number {text} is too small: it would be rounded to 0");
            Diagnostic::new(span, message).help("choose a unit in which it is larger, or write 0").into()
        }
        Ok(value) => Kind::Number(value),
    }
}
