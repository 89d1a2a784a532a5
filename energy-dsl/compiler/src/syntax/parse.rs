//! Parses items, in both spellings.

use proc_macro2::TokenStream;

use super::ast::{Constant, Declaration, ElementType, Expression, InputGroup, Item, Section, Unit, UserFunction};
use super::attribute::Attributes;
use super::habits;
use super::lengths;
use super::name::Name;
use super::specialise::{Specialisation, specialise};
use super::text;
use super::tokens::{self, Kind as TokenKind, Token};
use crate::diagnostic::{Diagnostic, Diagnostics, Span, nearest};
use energy_runtime::Kind;

/// Parses all items. After an error in one item, parsing continues with the next.
pub fn parse(stream: TokenStream, diagnostics: &mut Diagnostics) -> Vec<Item> {
    let tokens = tokens::from_rust(stream);
    if let Some(beyond) = tokens.get(LARGEST_TEXT) {
        let message = "this text has more than 262,144 words and signs";
        diagnostics.push(Diagnostic::new(&beyond.span, message).help("split it into several texts"));
        return Vec::new();
    }
    items(&lengths::expand(tokens, diagnostics), diagnostics)
}

/// Parses the text of a file. `at` is the place in Rust code that names the file.
pub fn parse_file(text: &str, file: &str, at: &Span, diagnostics: &mut Diagnostics) -> Vec<Item> {
    if let Err(errors) = check_size(text, file, at) {
        diagnostics.append(errors);
        return Vec::new();
    }
    let tokens = text::tokens(text, file, at);
    items(&lengths::expand(tokens, diagnostics), diagnostics)
}

/// Maximum number of definitions in a text.
const MOST_DEFINITIONS: usize = 4096;

/// Maximum size of a text in bytes. Its tokens take some hundred bytes each.
const LARGEST_TEXT: usize = 1 << 18;

/// Refuses a text that is too large.
///
/// # Errors
/// The error at the start of the text.
pub fn check_size(text: &str, file: &str, at: &Span) -> Result<(), Diagnostics> {
    if text.len() <= LARGEST_TEXT {
        return Ok(());
    }
    let message = format!("{file} has {} bytes, and a text may have 262,144", text.len());
    Err(Diagnostic::new(at, message).help("split it into several texts").into())
}

fn items(tokens: &[Token], diagnostics: &mut Diagnostics) -> Vec<Item> {
    let user_functions = tokens
        .windows(2)
        .filter(|pair| pair[0].kind == TokenKind::Name("fn".into()))
        .filter_map(|pair| if let TokenKind::Name(name) = &pair[1].kind { Some(name.clone()) } else { None })
        .collect();
    let end = tokens.last().map_or_else(|| Span::of(proc_macro2::Span::call_site()), |t| t.span.clone());
    let mut parser =
        Parser { tokens, at: 0, end, bars: Vec::new(), depth: 0, user_functions, definitions: 0, errors: Vec::new() };
    let mut items = Vec::new();
    while parser.at < tokens.len() && parser.definitions <= MOST_DEFINITIONS {
        match parser.item() {
            Ok(item) => items.push(item),
            Err(diagnostic) => {
                diagnostics.push(*diagnostic);
                parser.skip_item();
            }
        }
    }
    parser.errors.into_iter().for_each(|error| diagnostics.push(error));
    specialise(items, diagnostics)
}

pub(super) type Parsed<T> = Result<T, Box<Diagnostic>>;

pub(super) struct Parser<'a> {
    pub(super) tokens: &'a [Token],
    pub(super) at: usize,
    /// End of the text.
    pub(super) end: Span,
    /// Open bars `‖` and `|`. A bracket hides the bars outside it.
    pub(super) bars: Vec<String>,
    /// Nesting depth of the current expression.
    pub(super) depth: usize,
    pub(super) user_functions: Vec<String>,
    /// Number of definitions so far.
    pub(super) definitions: usize,
    /// Errors that do not prevent the declaration from being understood.
    pub(super) errors: Vec<Diagnostic>,
}

const KINDS: [Kind; 4] = [Kind::Energy, Kind::Constraint, Kind::Force, Kind::Residual];
const TYPES: &[(&str, ElementType)] = &[
    ("Point", ElementType::Point),
    ("Point2", ElementType::Point2),
    ("Velocity", ElementType::Velocity),
    ("Scalar", ElementType::Scalar),
    ("Vec2", ElementType::Vector(2)),
    ("Vec3", ElementType::Vector(3)),
    ("Vec4", ElementType::Vector(4)),
    ("Mat2x2", ElementType::Matrix(2, 2)),
    ("Mat2x3", ElementType::Matrix(2, 3)),
    ("Mat3x2", ElementType::Matrix(3, 2)),
    ("Mat3x3", ElementType::Matrix(3, 3)),
    ("Mat4x4", ElementType::Matrix(4, 4)),
    ("Quat", ElementType::Quat),
    ("Rotation", ElementType::Rotation),
    ("Motion", ElementType::Motion),
    ("DualQuat", ElementType::DualQuat),
    ("Twist", ElementType::Twist),
];

impl<'a> Parser<'a> {
    pub(super) fn peek(&self) -> Option<&'a Token> {
        self.tokens.get(self.at)
    }

    pub(super) fn span(&self) -> Span {
        self.peek().map_or_else(|| self.end.clone(), |t| t.span.clone())
    }

    pub(super) fn is(&self, symbol: &str) -> bool {
        matches!(self.peek(), Some(Token { kind: TokenKind::Symbol(s), .. }) if s == symbol)
    }

    pub(super) fn is_word(&self, word: &str) -> bool {
        matches!(self.peek(), Some(Token { kind: TokenKind::Name(n), .. }) if n == word)
    }

    pub(super) fn take(&mut self, symbol: &str) -> bool {
        let found = self.is(symbol);
        self.at += usize::from(found);
        found
    }

    pub(super) fn take_word(&mut self, word: &str) -> bool {
        let found = self.is_word(word);
        self.at += usize::from(found);
        found
    }

    pub(super) fn found(&self) -> String {
        match self.peek() {
            None => "the end".into(),
            Some(token) => format!("`{}`", token.text),
        }
    }

    /// Returns the error of the next token if its characters do not form a token.
    pub(super) fn fault(&self) -> Option<Box<Diagnostic>> {
        match &self.peek()?.kind {
            TokenKind::Broken(fault) => Some(fault.0.clone()),
            _ => None,
        }
    }

    pub(super) fn fail<T>(&self, expected: &str) -> Parsed<T> {
        if let Some(fault) = self.fault() {
            return Err(fault);
        }
        let diagnostic = Diagnostic::new(&self.span(), format!("expected {expected}, found {}", self.found()));
        Err(Box::new(match self.remedy() {
            Some(remedy) => diagnostic.help(remedy),
            None => diagnostic,
        }))
    }

    /// Returns the remedy for the next token, where other languages would allow it.
    fn remedy(&self) -> Option<&'static str> {
        let token = self.peek()?;
        let operand = |token: &Token| match &token.kind {
            TokenKind::Name(word) => !is_keyword(word),
            TokenKind::Number(_) => true,
            TokenKind::Symbol(symbol) => symbol == "(",
            _ => false,
        };
        let before = self.at.checked_sub(1).and_then(|at| self.tokens.get(at));
        if !token.notation && operand(token) && before.is_some_and(|token| operand(token) || token.text == ")") {
            return Some("write a product with `*`, as in 2 * k * x; only strings such as \"2 k x\" leave it out");
        }
        match &token.kind {
            TokenKind::Symbol(symbol) => habits::symbol(symbol),
            _ => None,
        }
    }

    pub(super) fn expect(&mut self, symbol: &str, context: &str) -> Parsed<()> {
        if self.take(symbol) { Ok(()) } else { self.fail(&format!("`{symbol}` {context}")) }
    }

    pub(super) fn name(&mut self, what: &str) -> Parsed<Name> {
        match self.peek() {
            Some(Token { kind: TokenKind::Name(text), span, .. }) if !is_keyword(text) => {
                self.at += 1;
                Ok(Name { text: text.clone(), span: span.clone() })
            }
            _ => self.fail(what),
        }
    }

    /// Skips past the next `;` or closing brace that ends an item.
    fn skip_item(&mut self) {
        let mut depth = 0_i32;
        self.bars.clear();
        while let Some(token) = self.peek() {
            self.at += 1;
            let TokenKind::Symbol(symbol) = &token.kind else { continue };
            match symbol.as_str() {
                "{" | "(" | "[" => depth += 1,
                "}" | ")" | "]" => {
                    // The error can be inside brackets whose start was already read.
                    depth = (depth - 1).max(0);
                    if depth == 0 && symbol == "}" {
                        return;
                    }
                }
                ";" if depth == 0 => return,
                _ => {}
            }
        }
    }

    /// Counts a definition. Checking compares each with all others.
    pub(super) fn count_definition(&mut self) -> Parsed<()> {
        self.definitions += 1;
        if self.definitions <= MOST_DEFINITIONS {
            return Ok(());
        }
        let message = format!("a text may have {MOST_DEFINITIONS} declarations, functions and statements");
        Err(Box::new(Diagnostic::new(&self.span(), message).help("split it into several texts")))
    }

    fn item(&mut self) -> Parsed<Item> {
        self.count_definition()?;
        let mut attributes = Attributes::default();
        while self.take("#") {
            self.attribute(&mut attributes)?;
        }
        let Attributes { docs, audit_samples, audit_scope, properties, uncompensated, vertices, limits, time_step } =
            attributes;
        let uncompensated_prefix = if uncompensated { "#[uncompensated] " } else { "" };
        let limits_prefix = limits.map_or_else(String::new, |limits| format!("{} ", limits.attribute()));
        let vertex_prefix = if vertices { "#[vertex] " } else { "" };
        let step_prefix = time_step.as_ref().map_or_else(String::new, |h| format!("#[time_step({})] ", h.text));
        let prefix =
            &format!("{}{uncompensated_prefix}{vertex_prefix}{step_prefix}{limits_prefix}", audit_scope.attribute());
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
        let claims = audit_samples.is_some()
            || uncompensated
            || vertices
            || limits.is_some()
            || time_step.is_some()
            || !properties.is_empty();
        if claims && (self.is_word("fn") || self.is_word("const")) {
            return self.fail("a declaration after its attributes (functions and constants have only documentation)");
        }
        if self.take_word("fn") {
            return self.user_function().map(Item::Function);
        }
        if self.take_word("const") {
            return self.constant().map(Item::Constant);
        }
        let start = self.at;
        let kind = self.kind()?;
        let name = self.name("a name for the declaration")?;
        if syn::parse_str::<syn::Ident>(&name.text).is_err() {
            let message = format!("`{}` cannot name a declaration: it is a word of Rust", name.text);
            return Err(Box::new(Diagnostic::new(&name.span, message).help("choose another name")));
        }
        if self.is("=") {
            let declaration = Declaration {
                docs,
                visibility,
                audit_samples,
                audit_scope,
                properties,
                uncompensated,
                vertices,
                time_step,
                limits,
                kind,
                name,
                inputs: Vec::new(),
                body: None,
                source: String::new(),
                formula: String::new(),
            };
            let mut specialisation = self.specialisation(start, declaration)?;
            specialisation.declaration.source.insert_str(0, prefix);
            return Ok(Item::Specialisation(Box::new(specialisation)));
        }
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
        let source = format!("{prefix}{}", tokens::text(&self.tokens[start..self.at]));
        Ok(Item::Declaration(Declaration {
            docs,
            visibility,
            audit_samples,
            audit_scope,
            properties,
            uncompensated,
            vertices,
            time_step,
            limits,
            kind,
            name,
            inputs,
            body,
            source,
            formula,
        }))
    }

    /// Parses `= Other(k = 100, L = 0.1);`.
    fn specialisation(&mut self, start: usize, mut declaration: Declaration) -> Parsed<Specialisation> {
        const FORM: &str = "as in energy Stiff = Spring(k = 100);";
        self.expect("=", FORM)?;
        let of = self.name(&format!("the name of another declaration, {FORM}"))?;
        self.expect("(", FORM)?;
        let values_start = self.at;
        let mut values = Vec::new();
        while !self.take(")") {
            let name = self.name(&format!("the name of a parameter, {FORM}"))?;
            self.expect("=", FORM)?;
            values.push((name, self.expression()?));
            if !self.take(",") && !self.is(")") {
                return self.fail("`,` or `)` after a value");
            }
        }
        declaration.formula = tokens::text(&self.tokens[values_start..self.at - 1]);
        self.expect(";", "after the parameters")?;
        declaration.source = tokens::text(&self.tokens[start..self.at]);
        Ok(Specialisation { declaration, of, values })
    }

    fn kind(&mut self) -> Parsed<Kind> {
        if let Some(fault) = self.fault() {
            return Err(fault);
        }
        if let Some(kind) = KINDS.into_iter().find(|k| self.is_word(k.keyword())) {
            self.at += 1;
            return Ok(kind);
        }
        let found = self.found();
        let mut diagnostic = Diagnostic::new(
            &self.span(),
            format!("expected energy, constraint, force, residual, fn or const, found {found}"),
        );
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
        let mut marked = self.section_word();
        while !self.take(")") {
            let shared = self.take_word_before_name("shared");
            let mut names = vec![self.name("the name of an input")?];
            while self.take(",") {
                if shared {
                    self.take_word_before_name("shared");
                }
                names.push(self.name("the name of an input")?);
            }
            self.expect(":", "and the type of the input")?;
            let type_span = self.span();
            let (element, unit, length) = self.input_type()?;
            let section_here = marked.unwrap_or_else(|| section_of(section, element));
            let has_initial = section_here == Section::State && self.take("=");
            let initial = has_initial.then(|| self.expression()).transpose()?;
            groups.push(InputGroup { section: section_here, shared, names, element, length, initial, type_span, unit });
            if self.take(";") {
                section = Section::Parameter;
                marked = self.section_word();
            } else if !self.take(",") && !self.is(")") {
                return self.fail("`,`, `;` or `)` after an input");
            }
        }
        Ok(groups)
    }

    /// Parses the word that marks the inputs up to the next `;`.
    fn section_word(&mut self) -> Option<Section> {
        if self.take_word("rest") {
            return Some(Section::Rest);
        }
        self.take_word_before_name("state").then_some(Section::State)
    }

    /// Takes a word that is also a legal name, if another name follows it.
    pub(super) fn take_word_before_name(&mut self, word: &str) -> bool {
        let names_follow = matches!(self.tokens.get(self.at + 1), Some(Token { kind: TokenKind::Name(_), .. }));
        let found = self.is_word(word) && names_follow;
        self.at += usize::from(found);
        found
    }

    /// Parses `Type[unit]` or `[Type[unit]; length]`.
    fn input_type(&mut self) -> Parsed<(ElementType, Unit, Option<Expression>)> {
        if !self.take("[") {
            let element = self.element_type()?;
            return Ok((element, self.unit()?, None));
        }
        let element = self.element_type()?;
        let unit = self.unit()?;
        self.expect(";", "and the length of the array, as in [Point; 4]")?;
        let length = self.expression()?;
        self.expect("]", "after the length of the array")?;
        Ok((element, unit, Some(length)))
    }

    fn element_type(&mut self) -> Parsed<ElementType> {
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

    /// Parses `[unit]`; returns an empty unit without one.
    fn unit(&mut self) -> Parsed<Unit> {
        if !self.take("[") {
            return Ok(Unit::default());
        }
        let (start, span) = (self.at, self.span());
        while !self.is("]") {
            if self.peek().is_none() {
                return self.fail("`]` to close the unit");
            }
            self.at += 1;
        }
        let text = tokens::unit_text(&self.tokens[start..self.at]);
        self.at += 1;
        Ok(Unit { text, span: Some(span) })
    }

    /// Parses `name: Scalar[unit] = value;` after the word `const`.
    pub(super) fn constant(&mut self) -> Parsed<Constant> {
        let start = self.at - 1;
        let name = self.name("the name of the constant")?;
        let unit = if self.take(":") {
            let span = self.span();
            if self.element_type()? != ElementType::Scalar {
                return Err(Box::new(
                    Diagnostic::new(&span, "a constant is a Scalar").help("as in const K: Scalar = 4;"),
                ));
            }
            self.unit()?
        } else {
            Unit::default()
        };
        self.expect("=", "and the value of the constant, as in const K: Scalar = 4;")?;
        let value = self.expression()?;
        self.expect(";", "after the value")?;
        Ok(Constant { name, unit, value, source: tokens::text(&self.tokens[start..self.at]) })
    }

    pub(super) fn user_function(&mut self) -> Parsed<UserFunction> {
        self.count_definition()?;
        let start = self.at - 1;
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
        Ok(UserFunction { name, parameters, body, source: tokens::text(&self.tokens[start..self.at]) })
    }
}

/// Returns the section of an input. Velocities are those of the moving points, wherever they are declared.
fn section_of(section: Section, element: ElementType) -> Section {
    match element {
        ElementType::Velocity => Section::Moving,
        _ => section,
    }
}

/// Returns whether a word begins a declaration.
pub(super) fn is_kind_of_declaration(word: &str) -> bool {
    KINDS.iter().any(|kind| kind.keyword() == word)
}

/// Returns whether a word is reserved by the language.
pub(super) fn is_keyword(word: &str) -> bool {
    matches!(word, "let" | "if" | "else" | "fn" | "for" | "rest" | "pub" | "const")
}

/// Returns the body as a reader would write it: the contents of a string, or the statements without braces.
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
