//! Arrays of variable length, `[Point; 3..=9]`: one declaration for each length, with the length at the end of its name.

use super::parse::is_kind_of_declaration;
use super::tokens::{Kind as TokenKind, Token};
use crate::diagnostic::{Diagnostic, Diagnostics};

/// Maximum number of lengths of an array.
const MOST_LENGTHS: usize = 64;

/// Replaces each item that has an array of variable length by one item for each length.
pub(super) fn expand(tokens: Vec<Token>, diagnostics: &mut Diagnostics) -> Vec<Token> {
    if !(0..tokens.len()).any(|at| Lengths::at(&tokens, at).is_some()) {
        return tokens;
    }
    let mut expanded = Vec::with_capacity(tokens.len());
    for item in items(&tokens) {
        let found: Vec<Lengths> = (0..item.len()).filter_map(|at| Lengths::at(item, at)).collect();
        match found[..] {
            [] => expanded.extend_from_slice(item),
            [ref lengths] => lengths.expand(item, &mut expanded, diagnostics),
            [_, ref second, ..] => {
                let message = "two arrays of variable length: their lengths would not belong together";
                let help = "give one of them the length of the other, as in [Scalar; len(ring)]";
                diagnostics.push(Diagnostic::new(&item[second.first].span, message).help(help));
            }
        }
    }
    expanded
}

/// Splits tokens into items: each ends with a `;` or a closing brace that is in no bracket.
fn items(tokens: &[Token]) -> Vec<&[Token]> {
    let (mut items, mut start, mut depth) = (Vec::new(), 0, 0_usize);
    for (at, token) in tokens.iter().enumerate() {
        let TokenKind::Symbol(symbol) = &token.kind else { continue };
        match symbol.as_str() {
            "{" | "(" | "[" => depth += 1,
            "}" | ")" | "]" => depth = depth.saturating_sub(1),
            _ => {}
        }
        if depth == 0 && matches!(symbol.as_str(), "}" | ";") {
            items.push(&tokens[start..=at]);
            start = at + 1;
        }
    }
    items.push(&tokens[start..]);
    items
}

/// The range of lengths in the type of an array.
struct Lengths {
    /// Index of its first token.
    first: usize,
    /// Number of its tokens.
    tokens: usize,
    low: usize,
    /// The largest length.
    high: usize,
}

impl Lengths {
    /// Reads `low..high` or `low..=high` after the semicolon at an index, up to the closing bracket.
    fn at(tokens: &[Token], at: usize) -> Option<Self> {
        let symbol = |at: usize, text: &str| matches!(tokens.get(at), Some(Token { kind: TokenKind::Symbol(symbol), .. }) if symbol == text);
        let number = |at: usize| match tokens.get(at)?.kind {
            TokenKind::Number(value) if value.fract() == 0.0 && (0.0..1e6).contains(&value) => Some(value as usize),
            _ => None,
        };
        if !symbol(at, ";") || !symbol(at + 2, "..") {
            return None;
        }
        let inclusive = symbol(at + 3, "=");
        let end = at + 3 + usize::from(inclusive);
        let (low, end_value) = (number(at + 1)?, number(end)?);
        let high = if inclusive { end_value } else { end_value.checked_sub(1)? };
        symbol(end + 1, "]").then_some(Self { first: at + 1, tokens: end - at, low, high })
    }

    fn expand(&self, item: &[Token], expanded: &mut Vec<Token>, diagnostics: &mut Diagnostics) {
        let Self { first, tokens, low, high } = *self;
        let span = &item[first].span;
        if low > high || low == 0 {
            diagnostics.push(
                Diagnostic::new(span, "this range of lengths is empty, or begins at 0")
                    .help("write [Point; 3..=9] for the lengths 3 to 9"),
            );
            return;
        }
        if high - low >= MOST_LENGTHS {
            let message = format!("an array has at most {MOST_LENGTHS} lengths, each of which is compiled");
            diagnostics.push(Diagnostic::new(span, message).help("narrow the range"));
            return;
        }
        let is_kind = |token: &Token| matches!(&token.kind, TokenKind::Name(word) if is_kind_of_declaration(word));
        let Some(name) = item.iter().position(is_kind).map(|kind| kind + 1).filter(|&name| name < first) else {
            return expanded.extend_from_slice(item);
        };
        for length in low..=high {
            let mut copy = item.to_vec();
            let called = format!("{}{length}", item[name].text);
            copy[name] = Token { kind: TokenKind::Name(called.clone()), text: called, ..item[name].clone() };
            let number =
                Token { kind: TokenKind::Number(length as f64), text: length.to_string(), ..copy[first].clone() };
            copy.splice(first..first + tokens, [number]);
            expanded.append(&mut copy);
        }
    }
}
