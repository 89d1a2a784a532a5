//! Parses expressions by precedence.

use super::ast::{Body, Expression, ExpressionKind, Sum};
use super::habits;
use super::name::Name;
use super::parse::{Parsed, Parser, is_keyword};
use super::tokens::{Kind as TokenKind, Token};
use crate::diagnostic::{Diagnostic, Span};
use crate::functions;

/// Operators of one precedence in a row: a chain is as deep as it is long, and the compiler recurses over it.
const LONGEST_CHAIN: usize = 500;

impl<'a> Parser<'a> {
    /// Parses an expression of any precedence.
    pub(super) fn expression(&mut self) -> Parsed<Expression> {
        self.binary(0)
    }

    /// Parses left-associative operators, by increasing precedence.
    fn binary(&mut self, level: usize) -> Parsed<Expression> {
        const LEVELS: &[&[&str]] =
            &[&["||"], &["&&"], &["<", "<=", ">", ">=", "==", "!="], &["+", "-"], &["*", "/", "%", "·", "×", "⊗"]];
        let Some(operators) = LEVELS.get(level) else { return self.unary() };
        let mut left = self.binary(level + 1)?;
        for length in 0.. {
            let span = self.span();
            if length == LONGEST_CHAIN {
                let message = format!("more than {LONGEST_CHAIN} operators follow each other");
                let help = "name parts with `let`, or sum over an index: sum(j in 0..4, …)";
                return Err(Box::new(Diagnostic::new(&span, message).help(help)));
            }
            let operator = operators.iter().find(|o| self.is(o)).copied();
            let operator = match operator {
                Some(operator) => {
                    self.at += 1;
                    if operator == "*" && self.is("*") {
                        let power = Diagnostic::new(&span, "`**` is no operator here");
                        return Err(Box::new(power.help("a power is written x^2")));
                    }
                    operator
                }
                None if level + 1 == LEVELS.len() && self.starts_factor() => "*",
                None => return Ok(left),
            };
            let right = self.binary(level + 1)?;
            let function = match operator {
                "·" => "dot",
                "×" => "cross",
                "⊗" => "outer",
                other => other,
            };
            left = call(function, span, vec![left, right]);
        }
        Ok(left)
    }

    /// Returns whether a factor follows without an operator. In notation that is a product.
    fn starts_factor(&self) -> bool {
        let Some(token) = self.peek().filter(|t| t.notation) else { return false };
        match &token.kind {
            TokenKind::Name(name) => !is_keyword(name),
            TokenKind::Symbol(symbol) => match symbol.as_str() {
                "(" | "√" | "hat" | "frac" => true,
                "‖" | "|" => self.bars.last() != Some(symbol),
                _ => false,
            },
            _ => false,
        }
    }

    fn unary(&mut self) -> Parsed<Expression> {
        self.nested(Self::signed)
    }

    /// Bounds the nesting of expressions, because the compiler recurses over them. Every nested expression passes here.
    fn nested(&mut self, parse: fn(&mut Self) -> Parsed<Expression>) -> Parsed<Expression> {
        const DEEPEST: usize = 100;
        if self.depth >= DEEPEST {
            let message = format!("the formula is nested more than {DEEPEST} levels deep");
            return Err(Box::new(Diagnostic::new(&self.span(), message).help("name subexpressions with `let`")));
        }
        self.depth += 1;
        let operand = parse(self);
        self.depth -= 1;
        operand
    }

    fn signed(&mut self) -> Parsed<Expression> {
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
            } else if self.take("[") {
                let index = self.bracketed("[", "]")?;
                base = Expression { kind: ExpressionKind::Index(Box::new(base), Box::new(index)), span };
            } else if self.take(".") {
                let name = self.name("the name of a component, as in v.x")?;
                if self.is("(") {
                    return Err(self.method(&name));
                }
                base = Expression { kind: ExpressionKind::Component(Box::new(base), name), span };
            } else if self.take("^") {
                let exponent = self.unary()?;
                base = call("^", span, vec![base, exponent]);
            } else {
                return Ok(base);
            }
        }
    }

    /// Describes a call such as `d.norm()`.
    fn method(&self, name: &Name) -> Box<Diagnostic> {
        let known = self.is_function(&name.text).then(|| format!("{}(…)", name.text));
        let written = habits::function(&name.text).map(str::to_owned).or(known);
        let written = written.unwrap_or_else(|| "norm(p - q)".into());
        let message = format!("a formula has no methods, found `.{}()`", name.text);
        Box::new(Diagnostic::new(&name.span, message).help(format!("functions come first: {written}")))
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
            TokenKind::Name(word) if !token.notation && habits::statement(word).is_some() => {
                let (message, help) = habits::statement(word).unwrap_or_default();
                return Err(Box::new(Diagnostic::new(&span, message).help(help)));
            }
            TokenKind::Name(word) if is_keyword(word) => return self.fail("a value"),
            TokenKind::Name(_) => return self.name_or_call(),
            TokenKind::Text(_) | TokenKind::Broken(_) => return self.fail("a value"),
            TokenKind::Symbol(symbol) => match symbol.as_str() {
                "(" => {
                    self.at += 1;
                    let inner = self.bracketed("(", ")")?;
                    return Ok(inner);
                }
                "[" => return self.array(),
                "{" => ExpressionKind::Body(Box::new(self.braced_body()?)),
                "‖" | "|" => return self.barred(symbol),
                "√" => {
                    self.at += 1;
                    let operand = self.nested(Self::primary)?;
                    return Ok(call("sqrt", span, vec![operand]));
                }
                "frac" => {
                    self.at += 1;
                    let (above, below) = (self.braced_body()?, self.braced_body()?);
                    let value = |body| Expression { kind: ExpressionKind::Body(Box::new(body)), span: span.clone() };
                    let parts = vec![value(above), value(below)];
                    return Ok(call("/", span, parts));
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

    /// Parses a bracketed expression after its opening bracket.
    fn bracketed(&mut self, open: &str, close: &str) -> Parsed<Expression> {
        let opened = self.tokens[self.at - 1].span.clone();
        self.bars.push(open.into());
        let inner = self.expression()?;
        self.bars.pop();
        self.close(open, close, opened)?;
        Ok(inner)
    }

    /// Expects a closing bracket, and names the place of the opening one if it is missing.
    fn close(&mut self, open: &str, close: &str, opened: Span) -> Parsed<()> {
        if let Some(fault) = self.fault() {
            return Err(fault);
        }
        let closed = self.expect(close, &format!("to close `{open}`"));
        closed.map_err(|error| Box::new(error.see((format!("`{open}` is opened"), opened))))
    }

    fn list(&mut self, open: &str, close: &str) -> Parsed<Vec<Expression>> {
        let opened = self.span();
        self.expect(open, "to open the list")?;
        self.bars.push(open.into());
        self.items(Vec::new(), close, (open, opened))
    }

    /// Parses the items of a list, after some of them, up to its end.
    fn items(&mut self, mut items: Vec<Expression>, close: &str, opened: (&str, Span)) -> Parsed<Vec<Expression>> {
        while !self.is(close) {
            items.push(self.expression()?);
            self.separator(close, &opened)?;
        }
        self.at += 1;
        self.bars.pop();
        Ok(items)
    }

    fn separator(&mut self, close: &str, (open, opened): &(&str, Span)) -> Parsed<()> {
        if self.take(",") || self.is(close) {
            return Ok(());
        }
        if let Some(fault) = self.fault() {
            return Err(fault);
        }
        let opened = (format!("`{open}` is opened"), opened.clone());
        self.fail(&format!("`,` or `{close}`")).map_err(|error| Box::new(error.see(opened)))
    }

    /// Parses `[a, b, …]` or `[term for j in first..end]`.
    fn array(&mut self) -> Parsed<Expression> {
        const FORM: &str = "as in [2 * a[j] for j in 0..4]";
        let span = self.span();
        self.at += 1;
        self.bars.push("[".into());
        let mut items = Vec::new();
        if !self.is("]") {
            let term = self.expression()?;
            if self.take_word_before_name("for") {
                let (index, first, end) = self.index_range(FORM)?;
                self.bars.pop();
                self.expect("]", &format!("after the range, {FORM}"))?;
                let each = Sum { index, first, end, term };
                return Ok(Expression { kind: ExpressionKind::Each(Box::new(each)), span });
            }
            items.push(term);
            self.separator("]", &("[", span.clone()))?;
        }
        let items = self.items(items, "]", ("[", span.clone()))?;
        Ok(Expression { kind: ExpressionKind::List(items), span })
    }

    /// Parses `‖d‖`, a norm, or `|x|`, an absolute value.
    fn barred(&mut self, bar: &str) -> Parsed<Expression> {
        let span = self.span();
        self.at += 1;
        self.bars.push(bar.into());
        let inner = self.expression()?;
        self.bars.pop();
        if let Some(fault) = self.fault() {
            return Err(fault);
        }
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
        if name.text == "sum" && self.is("(") {
            return self.sum(span);
        }
        let function = self.is_function(&name.text);
        if self.is("(") && (function || !notation) {
            let arguments = self.list("(", ")")?;
            return Ok(Expression { kind: ExpressionKind::Call(name, arguments), span });
        }
        if function && notation && self.is("^") {
            // `sin² θ` as printed. `sin⁻¹` is refused: it has two meanings.
            if let Some(Token { kind: TokenKind::Number(power), span: at, .. }) = self.tokens.get(self.at + 1)
                && *power > 0.0
            {
                self.at += 2;
                let argument = self.nested(Self::power)?;
                let exponent = Expression { kind: ExpressionKind::Number(*power), span: at.clone() };
                let value = Expression { kind: ExpressionKind::Call(name, vec![argument]), span: span.clone() };
                return Ok(call("^", span, vec![value, exponent]));
            }
            return Err(Box::new(
                Diagnostic::new(&span, format!("`{}` needs its argument before this power", name.text))
                    .help(format!("write ({}(x))^p, or asin(x), acos(x), 1/{}(x)", name.text, name.text)),
            ));
        }
        if function && notation && self.starts_factor() {
            // `sin θ` as printed.
            let argument = self.nested(Self::power)?;
            return Ok(Expression { kind: ExpressionKind::Call(name, vec![argument]), span });
        }
        Ok(Expression { kind: ExpressionKind::Name(name), span })
    }

    /// Parses `sum(j in first..end, term)` after the name.
    fn sum(&mut self, span: Span) -> Parsed<Expression> {
        const FORM: &str = "as in sum(j in 0..4, w[j] * x[j])";
        self.expect("(", FORM)?;
        self.bars.push("(".into());
        let (index, first, end) = self.index_range(FORM)?;
        self.expect(",", &format!("and what is summed, {FORM}"))?;
        let term = self.expression()?;
        self.take(",");
        self.bars.pop();
        self.expect(")", "to close `sum(`")?;
        Ok(Expression { kind: ExpressionKind::Sum(Box::new(Sum { index, first, end, term })), span })
    }

    /// Parses `j in first..end`, part of an expression of the given form.
    pub(super) fn index_range(&mut self, form: &str) -> Parsed<(Name, Expression, Expression)> {
        let index = self.name(&format!("an index, {form}"))?;
        if !self.take_word("in") {
            return self.fail(&format!("`in` and a range, {form}"));
        }
        let first = self.expression()?;
        self.expect("..", &format!("between the ends of the range, {form}"))?;
        Ok((index, first, self.expression()?))
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
            let nested = self.nested(Self::conditional)?;
            Body::of(nested)
        } else {
            self.braced_body()?
        };
        Ok(Expression { kind: ExpressionKind::If(Box::new(condition), Box::new(yes), Box::new(no)), span })
    }

    /// Parses the contents of a string literal, which is a body.
    fn notation(&mut self, inner: &'a [Token], span: &Span) -> Parsed<Expression> {
        let end = inner.last().map_or_else(|| span.clone(), |t| t.span.clone());
        let mut parser = Parser {
            tokens: inner,
            at: 0,
            end,
            bars: Vec::new(),
            depth: self.depth,
            user_functions: self.user_functions.clone(),
            definitions: 0,
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
