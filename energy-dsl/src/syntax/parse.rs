//! One parser for both spellings.

use proc_macro2::TokenStream;

use super::ast::{
    Body, Declaration, Expression, ExpressionKind, InputGroup, InputType, Item, Let, Section, UserFunction,
};
use super::name::Name;
use super::tokens::{self, Kind as TokenKind, Token};
use crate::diagnostic::{Diagnostic, Diagnostics, Span, nearest};
use crate::functions;
use crate::runtime::Kind;

/// Parses all items. After an error in one item it goes on with the next.
pub fn parse(stream: TokenStream, diagnostics: &mut Diagnostics) -> Vec<Item> {
    let tokens = tokens::from_rust(stream, diagnostics);
    let user_functions = tokens
        .windows(2)
        .filter(|pair| pair[0].kind == TokenKind::Name("fn".into()))
        .filter_map(|pair| if let TokenKind::Name(name) = &pair[1].kind { Some(name.clone()) } else { None })
        .collect();
    let end = tokens.last().map_or_else(|| Span::of(proc_macro2::Span::call_site()), |t| t.span.clone());
    let mut parser = Parser { tokens: &tokens, at: 0, end, bars: Vec::new(), user_functions, errors: Vec::new() };
    let mut items = Vec::new();
    while parser.at < tokens.len() {
        match parser.item() {
            Ok(item) => items.push(item),
            Err(diagnostic) => {
                diagnostics.push(*diagnostic);
                parser.skip_item();
            }
        }
    }
    parser.errors.into_iter().for_each(|error| diagnostics.push(error));
    items
}

type Parsed<T> = Result<T, Box<Diagnostic>>;

struct Parser<'a> {
    tokens: &'a [Token],
    at: usize,
    /// Where the text ends.
    end: Span,
    /// Open bars `‖` and `|`; a bracket between hides those outside it.
    bars: Vec<String>,
    user_functions: Vec<String>,
    /// Errors after which the declaration could still be made out.
    errors: Vec<Diagnostic>,
}

const KINDS: [Kind; 4] = [Kind::Energy, Kind::Constraint, Kind::Force, Kind::Residual];
const TYPES: &[(&str, InputType)] = &[
    ("Point", InputType::Point),
    ("Velocity", InputType::Velocity),
    ("Scalar", InputType::Scalar),
    ("Vec2", InputType::Vector(2)),
    ("Vec3", InputType::Vector(3)),
    ("Vec4", InputType::Vector(4)),
];

impl<'a> Parser<'a> {
    fn peek(&self) -> Option<&'a Token> {
        self.tokens.get(self.at)
    }

    fn span(&self) -> Span {
        self.peek().map_or_else(|| self.end.clone(), |t| t.span.clone())
    }

    fn is(&self, symbol: &str) -> bool {
        matches!(self.peek(), Some(Token { kind: TokenKind::Symbol(s), .. }) if s == symbol)
    }

    fn is_word(&self, word: &str) -> bool {
        matches!(self.peek(), Some(Token { kind: TokenKind::Name(n), .. }) if n == word)
    }

    fn take(&mut self, symbol: &str) -> bool {
        let found = self.is(symbol);
        self.at += usize::from(found);
        found
    }

    fn take_word(&mut self, word: &str) -> bool {
        let found = self.is_word(word);
        self.at += usize::from(found);
        found
    }

    fn found(&self) -> String {
        match self.peek() {
            None => "the end".into(),
            Some(token) => format!("`{}`", token.text),
        }
    }

    fn fail<T>(&self, expected: &str) -> Parsed<T> {
        Err(Box::new(Diagnostic::new(&self.span(), format!("expected {expected}, found {}", self.found()))))
    }

    fn expect(&mut self, symbol: &str, context: &str) -> Parsed<()> {
        if self.take(symbol) { Ok(()) } else { self.fail(&format!("`{symbol}` {context}")) }
    }

    fn name(&mut self, what: &str) -> Parsed<Name> {
        match self.peek() {
            Some(Token { kind: TokenKind::Name(text), span, .. }) if !is_keyword(text) => {
                self.at += 1;
                Ok(Name { text: text.clone(), span: span.clone() })
            }
            _ => self.fail(what),
        }
    }

    /// Goes on after the next `;` or closing brace that ends an item.
    fn skip_item(&mut self) {
        let mut depth = 0_i32;
        self.bars.clear();
        while let Some(token) = self.peek() {
            self.at += 1;
            let TokenKind::Symbol(symbol) = &token.kind else { continue };
            match symbol.as_str() {
                "{" | "(" | "[" => depth += 1,
                "}" | ")" | "]" => {
                    depth -= 1;
                    if depth <= 0 && symbol == "}" {
                        return;
                    }
                }
                ";" if depth <= 0 => return,
                _ => {}
            }
        }
    }

    fn item(&mut self) -> Parsed<Item> {
        let mut docs = Vec::new();
        let mut audit_samples = None;
        while self.take("#") {
            self.attribute(&mut docs, &mut audit_samples)?;
        }
        let visibility_start = self.at;
        if self.take_word("pub") && self.take("(") {
            while !self.take(")") {
                self.at += 1;
                if self.peek().is_none() {
                    return self.fail("`)`");
                }
            }
        }
        let visibility = tokens::text(&self.tokens[visibility_start..self.at]);
        if self.take_word("fn") {
            return self.user_function().map(Item::Function);
        }
        let start = self.at;
        let kind = self.kind()?;
        let name = self.name("a name for the declaration")?;
        let inputs = self.inputs()?;
        let body_start = self.at;
        let body = match self.declaration_body() {
            Ok(body) => Some(body),
            Err(error) => {
                self.errors.push(*error);
                self.at = body_start;
                self.skip_item();
                None
            }
        };
        let formula = formula(&self.tokens[body_start..self.at]);
        let source = tokens::text(&self.tokens[start..self.at]);
        Ok(Item::Declaration(Declaration {
            docs,
            visibility,
            audit_samples,
            kind,
            name,
            inputs,
            body,
            source,
            formula,
        }))
    }

    /// `[doc = "…"]`, `[audit]` or `[audit(samples = n)]`, after the `#`.
    fn attribute(&mut self, docs: &mut Vec<String>, audit_samples: &mut Option<usize>) -> Parsed<()> {
        self.expect("[", "to open the attribute")?;
        let name = self.name("`doc` or `audit`")?;
        match name.text.as_str() {
            "doc" => {
                self.expect("=", "after doc")?;
                match self.peek().map(|t| &t.kind) {
                    Some(TokenKind::Text(text)) => docs.push(text.clone()),
                    _ => return self.fail("the documentation as a string"),
                }
                self.at += 1;
            }
            "audit" => {
                *audit_samples = Some(200);
                if self.take("(") {
                    if !self.take_word("samples") {
                        return self.fail("`samples = …`");
                    }
                    self.expect("=", "after samples")?;
                    match self.peek().map(|t| &t.kind) {
                        Some(TokenKind::Number(n)) if *n >= 1.0 && n.fract() == 0.0 => {
                            *audit_samples = Some(*n as usize)
                        }
                        _ => return self.fail("the number of samples"),
                    }
                    self.at += 1;
                    self.expect(")", "after the number of samples")?;
                }
            }
            other => {
                return Err(Box::new(
                    Diagnostic::new(&name.span, format!("unknown attribute `{other}`"))
                        .help("a declaration takes doc comments and #[audit] or #[audit(samples = 200)]"),
                ));
            }
        }
        self.expect("]", "to close the attribute")
    }

    fn kind(&mut self) -> Parsed<Kind> {
        if let Some(kind) = KINDS.into_iter().find(|k| self.is_word(k.keyword())) {
            self.at += 1;
            return Ok(kind);
        }
        let found = self.found();
        let mut diagnostic =
            Diagnostic::new(&self.span(), format!("expected energy, constraint, force, residual or fn, found {found}"));
        if let Some(Token { kind: TokenKind::Name(name), .. }) = self.peek()
            && let Some(near) = nearest(name, KINDS.map(Kind::keyword))
        {
            diagnostic = diagnostic.help(format!("did you mean `{near}`?"));
        }
        Err(Box::new(diagnostic))
    }

    fn inputs(&mut self) -> Parsed<Vec<InputGroup>> {
        self.expect("(", "and the inputs, as in (p0, p1: Point; k: Scalar[N/m])")?;
        let mut groups = Vec::new();
        let mut section = Section::Moving;
        let mut rest = self.take_word("rest");
        while !self.take(")") {
            let mut names = vec![self.name("the name of an input")?];
            while self.take(",") {
                names.push(self.name("the name of an input")?);
            }
            self.expect(":", "and the type of the input")?;
            let type_span = self.span();
            let input_type = self.input_type()?;
            let unit = if self.is("[") { self.unit()? } else { String::new() };
            let place = if rest { Section::Rest } else { section_of(section, input_type) };
            groups.push(InputGroup { section: place, names, input_type, type_span, unit });
            if self.take(";") {
                section = Section::Parameter;
                rest = self.take_word("rest");
            } else if !self.take(",") && !self.is(")") {
                return self.fail("`,`, `;` or `)` after an input");
            }
        }
        Ok(groups)
    }

    fn input_type(&mut self) -> Parsed<InputType> {
        let known = TYPES.iter().map(|(name, _)| *name).collect::<Vec<_>>();
        let name = self.name(&format!("one of the types {}", known.join(", ")))?;
        TYPES.iter().find(|(known, _)| *known == name.text).map(|&(_, t)| t).ok_or_else(|| {
            let message = format!("unknown type `{}`; expected one of {}", name.text, known.join(", "));
            let mut diagnostic = Diagnostic::new(&name.span, message);
            if let Some(near) = nearest(&name.text, known) {
                diagnostic = diagnostic.help(format!("did you mean `{near}`?"));
            }
            Box::new(diagnostic)
        })
    }

    fn unit(&mut self) -> Parsed<String> {
        self.expect("[", "to open the unit")?;
        let start = self.at;
        while !self.is("]") {
            if self.peek().is_none() {
                return self.fail("`]` to close the unit");
            }
            self.at += 1;
        }
        let unit = self.tokens[start..self.at].iter().map(|t| t.text.as_str()).collect();
        self.at += 1;
        Ok(unit)
    }

    fn user_function(&mut self) -> Parsed<UserFunction> {
        let name = self.name("the name of the function")?;
        self.expect("(", "and the parameters of the function")?;
        let mut parameters = Vec::new();
        while !self.take(")") {
            parameters.push(self.name("the name of a parameter")?);
            if !self.take(",") && !self.is(")") {
                return self.fail("`,` or `)` after a parameter");
            }
        }
        let body = self.braced_body()?;
        Ok(UserFunction { name, parameters, body })
    }

    fn declaration_body(&mut self) -> Parsed<Body> {
        if self.take("=") {
            let result = self.expression()?;
            self.expect(";", "after the formula")?;
            return Ok(match result.kind {
                ExpressionKind::Body(body) => *body,
                _ => Body { functions: Vec::new(), lets: Vec::new(), result: Box::new(result) },
            });
        }
        if !self.is("{") {
            return self.fail("`{` and the formula, or `= \"…\";`");
        }
        self.braced_body()
    }

    fn braced_body(&mut self) -> Parsed<Body> {
        self.expect("{", "to open the body")?;
        let body = self.body(true)?;
        self.expect("}", "after the result")?;
        Ok(body)
    }

    /// Statements and a result, up to the closing brace or the end of a string.
    fn body(&mut self, braced: bool) -> Parsed<Body> {
        let mut body = (Vec::new(), Vec::new());
        loop {
            if self.take_word("fn") {
                body.0.push(self.user_function()?);
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
        let result = self.expression()?;
        if self.is(";") {
            return Err(Box::new(
                Diagnostic::new(&self.span(), "expected the result to be the last expression, found `;`")
                    .help("the result stands last and without `;`; name intermediate values with `let name = …;`"),
            ));
        }
        Ok(Body { functions: body.0, lets: body.1, result: Box::new(result) })
    }

    fn next_is_definition(&self) -> bool {
        matches!(self.peek(), Some(Token { kind: TokenKind::Name(_), .. }))
            && self.tokens.get(self.at + 1).is_some_and(|t| t.kind == TokenKind::Symbol("=".into()))
    }

    fn statement(&mut self, rest: bool) -> Parsed<Let> {
        let has_let = self.take_word("let");
        if !has_let && !self.next_is_definition() {
            return self.fail("`let name = …;`");
        }
        let name = self.name("a name after `let`")?;
        self.expect("=", "after the name")?;
        let value = self.expression()?;
        self.expect(";", "after the value")?;
        Ok(Let { name, value, rest })
    }

    fn expression(&mut self) -> Parsed<Expression> {
        self.binary(0)
    }

    /// Left-associative operators, by rising precedence.
    fn binary(&mut self, level: usize) -> Parsed<Expression> {
        const LEVELS: &[&[&str]] =
            &[&["||"], &["&&"], &["<", "<=", ">", ">=", "==", "!="], &["+", "-"], &["*", "/", "·", "×"]];
        let Some(operators) = LEVELS.get(level) else { return self.unary() };
        let mut left = self.binary(level + 1)?;
        loop {
            let span = self.span();
            let operator = operators.iter().find(|o| self.is(o)).copied();
            let operator = match operator {
                Some(operator) => {
                    self.at += 1;
                    operator
                }
                None if level + 1 == LEVELS.len() && self.starts_factor() => "*",
                None => return Ok(left),
            };
            let right = self.binary(level + 1)?;
            let function = match operator {
                "·" => "dot",
                "×" => "cross",
                other => other,
            };
            left = call(function, span, vec![left, right]);
        }
    }

    /// Whether a factor follows without an operator, which in notation is a product.
    fn starts_factor(&self) -> bool {
        let Some(token) = self.peek().filter(|t| t.notation) else { return false };
        match &token.kind {
            TokenKind::Name(name) => !is_keyword(name),
            TokenKind::Symbol(symbol) => match symbol.as_str() {
                "(" | "√" | "hat" => true,
                "‖" | "|" => self.bars.last() != Some(symbol),
                _ => false,
            },
            _ => false,
        }
    }

    fn unary(&mut self) -> Parsed<Expression> {
        let span = self.span();
        if self.take("-") {
            let operand = self.unary()?;
            return Ok(call("neg", span, vec![operand]));
        }
        if self.take("+") {
            return self.unary();
        }
        self.power()
    }

    fn power(&mut self) -> Parsed<Expression> {
        let mut base = self.primary()?;
        loop {
            let span = self.span();
            if self.take("ᵀ") {
                base = call("transpose", span, vec![base]);
            } else if self.take("^") {
                let exponent = if self.is("-") { self.unary()? } else { self.power()? };
                base = call("^", span, vec![base, exponent]);
            } else {
                return Ok(base);
            }
        }
    }

    fn primary(&mut self) -> Parsed<Expression> {
        let span = self.span();
        let Some(token) = self.peek() else { return self.fail("a value") };
        let kind = match &token.kind {
            TokenKind::Number(value) => {
                self.at += 1;
                ExpressionKind::Number(*value)
            }
            TokenKind::Notation(inner) => {
                self.at += 1;
                return self.notation(inner, &span);
            }
            TokenKind::Name(word) if word == "if" => return self.conditional(),
            TokenKind::Name(word) if is_keyword(word) => return self.fail("a value"),
            TokenKind::Name(_) => return self.name_or_call(),
            TokenKind::Text(_) => return self.fail("a value"),
            TokenKind::Symbol(symbol) => match symbol.as_str() {
                "(" => {
                    self.at += 1;
                    let inner = self.bracketed("(", ")")?;
                    return Ok(inner);
                }
                "[" => ExpressionKind::List(self.list("[", "]")?),
                "{" => ExpressionKind::Body(Box::new(self.braced_body()?)),
                "‖" | "|" => return self.barred(symbol),
                "√" => {
                    self.at += 1;
                    let operand = self.primary()?;
                    return Ok(call("sqrt", span, vec![operand]));
                }
                "hat" => {
                    self.at += 1;
                    let name = self.name("the vector under the hat")?;
                    let vector = Expression { span: name.span.clone(), kind: ExpressionKind::Name(name) };
                    return Ok(call("unit", span, vec![vector]));
                }
                _ => return self.fail("a value"),
            },
        };
        Ok(Expression { kind, span })
    }

    /// A bracketed expression after its opening bracket.
    fn bracketed(&mut self, open: &str, close: &str) -> Parsed<Expression> {
        self.bars.push(open.into());
        let inner = self.expression()?;
        self.bars.pop();
        self.expect(close, &format!("to close `{open}`"))?;
        Ok(inner)
    }

    fn list(&mut self, open: &str, close: &str) -> Parsed<Vec<Expression>> {
        self.expect(open, "to open the list")?;
        self.bars.push(open.into());
        let mut items = Vec::new();
        while !self.is(close) {
            items.push(self.expression()?);
            if !self.take(",") && !self.is(close) {
                return self.fail(&format!("`,` or `{close}`"));
            }
        }
        self.at += 1;
        self.bars.pop();
        Ok(items)
    }

    /// `‖d‖`, a norm, or `|x|`, an absolute value.
    fn barred(&mut self, bar: &str) -> Parsed<Expression> {
        let span = self.span();
        self.at += 1;
        self.bars.push(bar.into());
        let inner = self.expression()?;
        self.bars.pop();
        if !self.take(bar) {
            let message = format!("unbalanced `{bar}`: expected a second `{bar}`, found {}", self.found());
            return Err(Box::new(Diagnostic::new(&span, message).help(format!("close it, as in {bar}d{bar}"))));
        }
        let function = if bar == "‖" { "norm" } else { "abs" };
        Ok(call(function, span, vec![inner]))
    }

    fn is_function(&self, name: &str) -> bool {
        functions::find(name).is_some() || name == "gradient" || self.user_functions.iter().any(|f| f == name)
    }

    fn name_or_call(&mut self) -> Parsed<Expression> {
        let notation = self.peek().is_some_and(|t| t.notation);
        let name = self.name("a name")?;
        let span = name.span.clone();
        let function = self.is_function(&name.text);
        if self.is("(") && (function || !notation) {
            let arguments = self.list("(", ")")?;
            return Ok(Expression { kind: ExpressionKind::Call(name, arguments), span });
        }
        if function && notation && self.starts_factor() {
            // `sin θ`, as printed.
            let argument = self.power()?;
            return Ok(Expression { kind: ExpressionKind::Call(name, vec![argument]), span });
        }
        Ok(Expression { kind: ExpressionKind::Name(name), span })
    }

    fn conditional(&mut self) -> Parsed<Expression> {
        let span = self.span();
        self.at += 1;
        let condition = self.expression()?;
        let yes = self.braced_body()?;
        if !self.take_word("else") {
            return self.fail("`else { … }`: a formula has a value either way");
        }
        let no = if self.is_word("if") {
            let nested = self.conditional()?;
            Body { functions: Vec::new(), lets: Vec::new(), result: Box::new(nested) }
        } else {
            self.braced_body()?
        };
        Ok(Expression { kind: ExpressionKind::If(Box::new(condition), Box::new(yes), Box::new(no)), span })
    }

    /// The content of a string literal: a body of its own.
    fn notation(&mut self, inner: &'a [Token], span: &Span) -> Parsed<Expression> {
        let end = inner.last().map_or_else(|| span.clone(), |t| t.span.clone());
        let mut parser = Parser {
            tokens: inner,
            at: 0,
            end,
            bars: Vec::new(),
            user_functions: self.user_functions.clone(),
            errors: Vec::new(),
        };
        let body = parser.body(false)?;
        if parser.peek().is_some() {
            return parser.fail("an operator or the end of the formula");
        }
        Ok(Expression { kind: ExpressionKind::Body(Box::new(body)), span: span.clone() })
    }
}

fn call(function: &str, span: Span, arguments: Vec<Expression>) -> Expression {
    let name = Name { text: function.into(), span: span.clone() };
    Expression { kind: ExpressionKind::Call(name, arguments), span }
}

fn is_keyword(word: &str) -> bool {
    matches!(word, "let" | "if" | "else" | "fn" | "rest" | "pub")
}

fn section_of(section: Section, input_type: InputType) -> Section {
    match input_type {
        InputType::Point | InputType::Velocity => Section::Moving,
        _ => section,
    }
}

/// The body as a reader would write it: a string's content, or the statements without the braces.
fn formula(tokens: &[Token]) -> String {
    match tokens {
        [equals, Token { kind: TokenKind::Notation(_), text, .. }, _] if equals.text == "=" => {
            syn::parse_str::<syn::LitStr>(text).map_or_else(|_| text.clone(), |s| s.value())
        }
        [equals, inner @ .., _] if equals.text == "=" => tokens::text(inner),
        [_, inner @ .., _] => tokens::text(inner),
        _ => String::new(),
    }
}
