//! Lays generated code out for reading, roughly as `rustfmt` does. Only code that the compiler emits needs to look
//! good.

use proc_macro2::{Delimiter, Spacing, TokenStream, TokenTree};

/// Maximum width of a line.
const WIDTH: usize = 110;
const INDENT: &str = "    ";

/// A token, with the characters of an operator or a lifetime in one piece.
#[derive(Clone, Debug)]
enum Piece {
    Word(String),
    Symbol(String),
    Group(Delimiter, Vec<Piece>),
}

/// Lays out items or methods.
pub(super) fn layout(code: &TokenStream) -> String {
    let mut text = String::new();
    write_statements(&pieces(code.clone()), 0, &mut text);
    text
}

/// Returns the methods of all implementations in `code`: name and layout.
pub(super) fn methods(code: &TokenStream) -> Vec<(String, String)> {
    let mut methods = Vec::new();
    let items = pieces(code.clone());
    for item in statements(&items) {
        let Some(Piece::Group(_, body)) = item.last().filter(|_| item.iter().any(|piece| is_word(piece, "impl")))
        else {
            continue;
        };
        let mut text = String::new();
        for statement in statements(body) {
            let mut line = String::new();
            write_statement(statement, 0, &mut line);
            text += &line;
            let function = statement.iter().position(|piece| is_word(piece, "fn"));
            if let Some(Piece::Word(name)) = function.and_then(|place| statement.get(place + 1)) {
                methods.push((name.clone(), std::mem::take(&mut text)));
            } else if !is_attribute(statement) {
                text.clear();
            }
        }
    }
    methods
}

fn pieces(code: TokenStream) -> Vec<Piece> {
    let mut pieces = Vec::new();
    let mut joint = false;
    for token in code {
        let was_joint = std::mem::replace(&mut joint, false);
        match token {
            TokenTree::Group(group) => pieces.push(Piece::Group(group.delimiter(), self::pieces(group.stream()))),
            TokenTree::Punct(symbol) => {
                joint = symbol.spacing() == Spacing::Joint;
                match pieces.last_mut() {
                    Some(Piece::Symbol(before)) if was_joint && is_operator(before, symbol.as_char()) => {
                        before.push(symbol.as_char());
                    }
                    _ => pieces.push(Piece::Symbol(symbol.as_char().into())),
                }
            }
            TokenTree::Ident(name) => match pieces.last_mut() {
                Some(Piece::Symbol(quote)) if quote == "'" => *quote = format!("'{name}"),
                _ => pieces.push(Piece::Word(name.to_string())),
            },
            TokenTree::Literal(literal) => {
                let text = literal.to_string();
                // The bytes of a general path say nothing to a reader.
                let is_data = text.starts_with("b\"");
                pieces.push(Piece::Word(if is_data { "b\"…\"".into() } else { without_type(&text) }));
            }
        }
    }
    pieces
}

/// Whether two symbols form one operator.
fn is_operator(first: &str, second: char) -> bool {
    ["::", "->", "=>", "==", "!=", "<=", ">=", "..", "&&", "||"].contains(&format!("{first}{second}").as_str())
}

/// Returns a number without the suffix of its type.
fn without_type(literal: &str) -> String {
    if !literal.starts_with(|c: char| c.is_ascii_digit()) {
        return literal.to_owned();
    }
    match literal.strip_suffix("f64") {
        Some(number) if number.contains(['.', 'e']) => number.to_owned(),
        Some(number) => format!("{number}.0"),
        None => literal.trim_end_matches("usize").trim_end_matches("u32").trim_end_matches("u8").to_owned(),
    }
}

fn is_word(piece: &Piece, word: &str) -> bool {
    matches!(piece, Piece::Word(name) if name == word)
}

fn is_symbol(piece: Option<&Piece>, symbols: &[&str]) -> bool {
    matches!(piece, Some(Piece::Symbol(symbol)) if symbols.contains(&symbol.as_str()))
}

fn is_braces(piece: &Piece) -> bool {
    matches!(piece, Piece::Group(Delimiter::Brace, _))
}

fn is_attribute(statement: &[Piece]) -> bool {
    matches!(statement, [Piece::Symbol(hash), Piece::Group(Delimiter::Bracket, _)] if hash == "#")
}

/// Splits code after each `;` and `,`, after attributes, and after braces that end a statement.
fn statements(code: &[Piece]) -> Vec<&[Piece]> {
    let (mut list, mut start, mut angles) = (Vec::new(), 0, 0);
    for end in 1..=code.len() {
        let (last, next) = (&code[end - 1], code.get(end));
        angles += i32::from(is_symbol(Some(last), &["<"])) - i32::from(is_symbol(Some(last), &[">"]));
        let goes_on = is_symbol(next, &[";", ",", ".", "?", "=", "=="]) || next.is_some_and(|n| is_word(n, "else"));
        let ends = is_symbol(Some(last), &[";"])
            || angles == 0 && is_symbol(Some(last), &[","])
            || is_braces(last) && !goes_on
            || is_attribute(&code[start..end]);
        if ends || end == code.len() {
            list.push(&code[start..end]);
            start = end;
        }
    }
    list
}

/// Writes one statement, field or item per line.
fn write_statements(code: &[Piece], depth: usize, text: &mut String) {
    for statement in statements(code) {
        write_statement(statement, depth, text);
    }
}

fn write_statement(statement: &[Piece], depth: usize, text: &mut String) {
    text.push_str(&INDENT.repeat(depth));
    match documentation(statement) {
        Some(docs) => text.push_str(&docs),
        None => write(statement, depth, text),
    }
    text.push('\n');
}

/// Returns `#[doc = "…"]` as a doc comment.
fn documentation(statement: &[Piece]) -> Option<String> {
    let Piece::Group(_, inner) = statement.last().filter(|_| is_attribute(statement))? else { return None };
    let [Piece::Word(doc), Piece::Symbol(_), Piece::Word(literal)] = &inner[..] else { return None };
    let docs = syn::parse_str::<syn::LitStr>(literal).ok().filter(|_| doc == "doc")?.value();
    Some(format!("/// {}", docs.trim()).trim_end().to_owned())
}

/// Writes pieces on one line. Braces break it, and so do brackets that do not fit.
fn write(pieces: &[Piece], depth: usize, text: &mut String) {
    for (place, piece) in pieces.iter().enumerate() {
        if place > 0 && has_space(&pieces[..place], piece) {
            text.push(' ');
        }
        match piece {
            Piece::Word(name) => text.push_str(name),
            Piece::Symbol(symbol) => text.push_str(symbol),
            Piece::Group(delimiter, inner) => write_group(*delimiter, inner, depth, text),
        }
    }
}

fn write_group(delimiter: Delimiter, inner: &[Piece], depth: usize, text: &mut String) {
    let (open, close) = match delimiter {
        Delimiter::Parenthesis => ("(", ")"),
        Delimiter::Bracket => ("[", "]"),
        Delimiter::Brace => ("{", "}"),
        Delimiter::None => ("", ""),
    };
    let column = text.rsplit('\n').next().map_or(0, |line| line.chars().count());
    let is_array_type = delimiter == Delimiter::Bracket && inner.iter().any(|piece| is_symbol(Some(piece), &[";"]));
    let is_list = delimiter != Delimiter::Brace || statements(inner).iter().any(|s| is_symbol(s.last(), &[","]));
    let mut short = String::new();
    if is_list {
        write(inner, depth + 1, &mut short);
    }
    let fits = is_list && !short.contains('\n') && column + short.chars().count() < WIDTH;
    text.push_str(open);
    if inner.is_empty() || is_array_type || fits {
        let space = if delimiter == Delimiter::Brace && !inner.is_empty() { " " } else { "" };
        text.push_str(&format!("{space}{short}{space}"));
    } else {
        text.push('\n');
        write_statements(inner, depth + 1, text);
        text.push_str(&INDENT.repeat(depth));
    }
    text.push_str(close);
}

/// Whether a space belongs before a piece.
fn has_space(before: &[Piece], piece: &Piece) -> bool {
    let last = before.last();
    let is_keyword =
        |word: &str| ["if", "in", "match", "return", "let", "else", "for", "impl", "mut", "as"].contains(&word);
    let operand = |piece: Option<&Piece>| match piece {
        Some(Piece::Word(word)) => !is_keyword(word),
        Some(Piece::Group(..)) => true,
        _ => false,
    };
    let prefix = is_symbol(last, &["-", "&", "!", "*"]) && !operand(before.len().checked_sub(2).map(|i| &before[i]));
    if prefix || is_symbol(last, &["::", ".", "<", "#", ".."]) {
        return false;
    }
    match piece {
        Piece::Symbol(symbol) => match symbol.as_str() {
            "," | ";" | "." | "?" | ">" | ":" | ".." => false,
            "<" => is_symbol(last, &[":", ","]),
            "::" => !operand(last) && !is_symbol(last, &[">"]),
            "!" => !operand(last),
            _ => true,
        },
        Piece::Group(Delimiter::Brace, _) => true,
        Piece::Group(..) => {
            let keyword = matches!(last, Some(Piece::Word(word)) if is_keyword(word));
            keyword || matches!(last, Some(Piece::Symbol(symbol)) if symbol != ">" && symbol != "!")
        }
        Piece::Word(_) => true,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn laid_out(code: &str) -> String {
        layout(&code.parse().unwrap())
    }

    #[test]
    fn code_is_spaced_as_people_write_it() {
        assert_eq!(laid_out("f (1f64 , 2usize , 0.5f64)"), "f(1.0, 2, 0.5)\n");
        assert_eq!(
            laid_out("let a : :: x :: Y < T > = - b * c . d :: < L > ( e , - f ) ;"),
            "let a: ::x::Y<T> = -b * c.d::<L>(e, -f);\n"
        );
        assert_eq!(
            laid_out("# [ doc = \" Adds.\" ] fn f ( & self ) -> [ T ; 3 ] { if ! a { b } else { c } }"),
            "/// Adds.\nfn f(&self) -> [T; 3] {\n    if !a {\n        b\n    } else {\n        c\n    }\n}\n"
        );
    }

    #[test]
    fn long_brackets_are_broken_at_commas() {
        let entries = ["a_long_name_of_an_entry"; 8].join(" , ");
        let text = laid_out(&format!("f ( [ {entries} ] )"));
        assert!(text.lines().all(|line| line.chars().count() <= 120) && text.lines().count() > 8, "{text}");
    }
}
