//! Converts mathematical notation, as papers print it, to the tokens of the Rust-like spelling.

use std::rc::Rc;

use super::characters;
use super::name::GREEK;
use super::tokens::{self, Kind, Token};
use crate::diagnostic::{Diagnostic, Excerpt, Span, nearest};

/// Splits a formula into tokens. `literal` is the place of the string.
pub(super) fn tokens(text: &str, literal: &Span) -> Vec<Token> {
    let excerpt = Excerpt { text: text.into(), start: 0, end: 0, file: None };
    let whole = Span { token: literal.token, excerpt: Some(excerpt.clone()) };
    tokens_within(&excerpt.text, (0, text.len()), &whole)
}

/// Splits the formula between two places of the text `whole` into tokens.
pub(super) fn tokens_within(text: &Rc<str>, (start, end): (usize, usize), whole: &Span) -> Vec<Token> {
    let mut lexer = Lexer { text: text.clone(), at: start, end, whole, tokens: Vec::new() };
    while let Some(c) = lexer.peek() {
        let start = lexer.at;
        if let Err((message, help)) = lexer.token(c) {
            let error = Diagnostic { help, ..Diagnostic::new(&lexer.span(start), message) };
            if lexer.at == start {
                lexer.advance();
            }
            lexer.push(error.into(), start);
        }
    }
    lexer.tokens
}

/// A message, and the remedy; `None` without one.
type Complaint = (String, Option<String>);

struct Lexer<'a> {
    text: Rc<str>,
    at: usize,
    end: usize,
    whole: &'a Span,
    tokens: Vec<Token>,
}

const HAT: char = '\u{302}';

impl Lexer<'_> {
    fn peek(&self) -> Option<char> {
        self.text[self.at..self.end].chars().next()
    }

    fn advance(&mut self) {
        self.at += self.peek().map_or(0, char::len_utf8);
    }

    fn span(&self, start: usize) -> Span {
        self.whole.within(start, self.at.max(start))
    }

    fn push(&mut self, kind: Kind, start: usize) {
        let span = self.span(start);
        let text = self.text[start..self.at].to_owned();
        self.tokens.push(Token { kind, span, notation: true, text });
    }

    fn symbol(&mut self, symbol: &str, start: usize) {
        self.push(Kind::Symbol(symbol.into()), start);
    }

    fn token(&mut self, c: char) -> Result<(), Complaint> {
        let start = self.at;
        if c.is_ascii_digit() {
            self.number();
            return Ok(());
        }
        if c == '\\' {
            return self.command();
        }
        if is_name_start(c) {
            self.name(false);
            return Ok(());
        }
        self.advance();
        match c {
            ' ' | '\t' | '\r' | '\n' | '\u{a0}' | '\u{2009}' | '\u{202f}' => {}
            '−' | '–' => self.symbol("-", start),
            '·' | 'ᐧ' | '⋅' | '∙' => self.symbol("·", start),
            '×' => self.symbol("×", start),
            '⊗' => self.symbol("⊗", start),
            '∗' => self.symbol("*", start),
            '÷' | '∕' | '⁄' => self.symbol("/", start),
            '≤' => self.symbol("<=", start),
            '≥' => self.symbol(">=", start),
            '≠' => self.symbol("!=", start),
            '½' => self.push(Kind::Number(0.5), start),
            '¼' => self.push(Kind::Number(0.25), start),
            '¾' => self.push(Kind::Number(0.75), start),
            '⅓' => self.push(Kind::Number(1.0 / 3.0), start),
            '⅔' => self.push(Kind::Number(2.0 / 3.0), start),
            '⅛' => self.push(Kind::Number(0.125), start),
            'ᵀ' => self.symbol("ᵀ", start),
            '∞' => self.push(Kind::Name("infinity".into()), start),
            '√' | '‖' | '|' | '+' | '-' | '*' | '/' | '%' | '^' | '(' | ')' | '[' | ']' | '{' | '}' | ',' | ';'
            | ':' | '=' | '<' | '>' | '!' | '&' | '.' => {
                let mut symbol = c.to_string();
                if let Some(next) = self.peek() {
                    let pair = format!("{c}{next}");
                    if ["==", "!=", "<=", ">=", "&&", ".."].contains(&pair.as_str()) {
                        symbol = pair;
                        self.advance();
                    }
                }
                self.symbol(&symbol, start);
            }
            '⁻' | '⁰' | '¹' | '²' | '³' | '⁴'..='⁹' => {
                let mut digits = superscript(c).to_string();
                while let Some(next) = self.peek().filter(|&n| superscript(n) != ' ') {
                    digits.push(superscript(next));
                    self.advance();
                }
                let power = digits.parse().map_err(|_| (format!("`{digits}` is not a superscript number"), None))?;
                self.symbol("^", start);
                self.push(Kind::Number(power), start);
            }
            other => return Err(characters::misplaced(other)),
        }
        Ok(())
    }

    fn number(&mut self) {
        let start = self.at;
        let rest = &self.text[start..self.end];
        let mut end = rest.find(|c: char| !c.is_ascii_digit() && c != '.').unwrap_or(rest.len());
        // `0..4` is a range.
        end = rest.find("..").map_or(end, |range| range.min(end));
        // Digits after `e` make it an exponent; otherwise `e` is a name.
        let bytes = rest.as_bytes();
        if bytes.get(end).is_some_and(|b| b.eq_ignore_ascii_case(&b'e')) {
            let sign = usize::from(bytes.get(end + 1).is_some_and(|b| b"+-".contains(b)));
            let digits = rest[end + 1 + sign..].bytes().take_while(u8::is_ascii_digit).count();
            if digits > 0 {
                end += 1 + sign + digits;
            }
        }
        self.at += end;
        let number = tokens::number(&self.text[start..self.at], &self.span(start));
        self.push(number, start);
    }

    /// Reads a LaTeX command: `\hat a`, `\cdot`, `\times`, `\theta`, ….
    fn command(&mut self) -> Result<(), Complaint> {
        let start = self.at;
        self.advance();
        let name_start = self.at;
        while self.peek().is_some_and(|c| c.is_ascii_alphabetic()) {
            self.advance();
        }
        let command = self.text[name_start..self.at].to_owned();
        match command.as_str() {
            "hat" => {
                let mut braced = false;
                while let Some(c) = self.peek().filter(|&c| c == ' ' || c == '{') {
                    braced |= c == '{';
                    self.advance();
                }
                if !self.peek().is_some_and(is_name_start) {
                    return Err(("expected the name of a vector after \\hat".into(), None));
                }
                self.symbol("hat", start);
                self.name(braced);
            }
            "cdot" => self.symbol("·", start),
            "times" => self.symbol("×", start),
            "otimes" => self.symbol("⊗", start),
            "frac" => self.symbol("frac", start),
            "sqrt" => self.symbol("√", start),
            "lVert" | "rVert" => self.symbol("‖", start),
            "lvert" | "rvert" => self.symbol("|", start),
            "le" => self.symbol("<=", start),
            "ge" => self.symbol(">=", start),
            // These only size the bracket that follows.
            "left" | "right" => {}
            function if crate::functions::find(function).is_some() => self.push(Kind::Name(command), start),
            "pi" => self.push(Kind::Name("π".into()), start),
            other => match GREEK.iter().find(|(_, spelled)| *spelled == other) {
                Some((letter, _)) => {
                    let mut name = letter.to_string();
                    while let Some(c) = self.peek().filter(|&c| is_name_part(c)) {
                        name.push(c);
                        self.advance();
                    }
                    self.push(Kind::Name(name), start);
                }
                None => {
                    return Err((format!("the command \\{other} has no meaning in a formula"), near_command(other)));
                }
            },
        }
        Ok(())
    }

    /// Reads a name. Parts in braces belong to it, as in `p_{kl}` and `\hat{n}_1`.
    fn name(&mut self, mut braced: bool) {
        let start = self.at;
        let mut name = String::new();
        let mut hat = false;
        while let Some(c) = self.peek() {
            match unhatted(c) {
                _ if c == HAT => hat = true,
                _ if c == '{' && name.ends_with('_') && !braced => braced = true,
                _ if c == '}' && braced => {
                    braced = false;
                    self.advance();
                    if self.peek().is_some_and(|c| c == '_' || ('₀'..='₉').contains(&c)) {
                        continue;
                    }
                    break;
                }
                Some(plain) => {
                    hat = true;
                    name.push(plain);
                }
                None if is_name_part(c) => name.push(c),
                None => break,
            }
            self.advance();
        }
        if hat {
            self.symbol("hat", start);
        }
        self.push(Kind::Name(name), start);
    }
}

/// Returns a remedy that names the command which `command` is probably a misspelling of.
fn near_command(command: &str) -> Option<String> {
    const COMMANDS: &[&str] = &["hat", "cdot", "times", "otimes", "frac", "sqrt", "lVert", "rVert", "le", "ge", "pi"];
    let functions = crate::functions::all().map(|function| function.name);
    let known = COMMANDS.iter().copied().chain(GREEK.iter().map(|(_, name)| *name)).chain(functions);
    nearest(command, known).map(|near| format!("did you mean \\{near}?"))
}

/// Returns the name below a hat: `p` of `p̂`. `None` if the name has no hat.
pub(crate) fn without_hat(name: &str) -> Option<String> {
    let mut plain = String::new();
    let mut hat = false;
    for c in name.chars() {
        match unhatted(c) {
            _ if c == '\u{302}' => hat = true,
            Some(letter) => {
                hat = true;
                plain.push(letter);
            }
            None => plain.push(c),
        }
    }
    hat.then_some(plain)
}

/// Returns the letter under a precomposed hat.
fn unhatted(c: char) -> Option<char> {
    Some(match c {
        'â' => 'a',
        'ê' => 'e',
        'î' => 'i',
        'ô' => 'o',
        'û' => 'u',
        'ŵ' => 'w',
        'ŷ' => 'y',
        'ẑ' => 'z',
        'ĉ' => 'c',
        'ĝ' => 'g',
        'ĥ' => 'h',
        'ĵ' => 'j',
        'ŝ' => 's',
        'Â' => 'A',
        'Ĉ' => 'C',
        'Ê' => 'E',
        'Ĝ' => 'G',
        'Ĥ' => 'H',
        'Î' => 'I',
        'Ĵ' => 'J',
        'Ô' => 'O',
        'Ŝ' => 'S',
        'Û' => 'U',
        'Ŵ' => 'W',
        'Ŷ' => 'Y',
        'Ẑ' => 'Z',
        _ => return None,
    })
}

fn is_name_start(c: char) -> bool {
    (c.is_alphabetic() && !"ᵀᐧ".contains(c) && characters::halfwidth(c).is_none()) || c == '_'
}

fn is_name_part(c: char) -> bool {
    is_name_start(c) || c.is_ascii_digit() || c == '′' || c == '\'' || ('₀'..='₉').contains(&c)
}

fn superscript(c: char) -> char {
    match c {
        '⁻' => '-',
        '⁰' => '0',
        '¹' => '1',
        '²' => '2',
        '³' => '3',
        '⁴'..='⁹' => char::from(b'4' + (c as u32 - '⁴' as u32) as u8),
        _ => ' ',
    }
}
