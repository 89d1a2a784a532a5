//! The meaning of operations as expressions of C.

use std::cell::RefCell;
use std::fmt::Write as _;
use std::rc::Rc;

use rustc_hash::FxHashMap;
use syn::{BinOp, Expr, UnOp};

use super::dialect::{Dialect, Numbers};
use crate::graph::{NodeId, Op};

/// An expression of named functions.
#[derive(Debug)]
pub(super) enum Expression {
    Operand(usize),
    Call(String, Vec<Expression>),
}

/// The meanings that were needed so far, from the table of operations. Each is parsed once.
#[derive(Default)]
pub(super) struct Meanings(RefCell<FxHashMap<&'static str, Rc<Expression>>>);

impl Meanings {
    /// Returns the meaning of an operation of the table.
    pub(super) fn of(&self, op: Op) -> Rc<Expression> {
        let spelling =
            op.spelling().expect("compiler bug: inputs are read, rules resolved and caution decided elsewhere");
        let mut known = self.0.borrow_mut();
        let parsed = known
            .entry(spelling.meaning)
            .or_insert_with(|| Rc::new(Expression::of_text(spelling.meaning, spelling.operands)));
        Rc::clone(parsed)
    }
}

impl Expression {
    /// Reads the meaning of an operation.
    pub(super) fn of_text(meaning: &str, operands: &[&str]) -> Self {
        Self::parsed(&syn::parse_str(meaning).expect("the table of operations is Rust"), operands)
    }

    fn parsed(meaning: &Expr, operands: &[&str]) -> Self {
        let call = |name: &str, list: Vec<&Expr>| {
            Self::Call(name.to_owned(), list.into_iter().map(|inner| Self::parsed(inner, operands)).collect())
        };
        match meaning {
            Expr::Paren(inner) => Self::parsed(&inner.expr, operands),
            Expr::Path(path) => {
                let place = operands.iter().position(|operand| path.path.is_ident(operand));
                Self::Operand(place.expect("the table of operations names its operands"))
            }
            Expr::Unary(unary) => match unary.op {
                UnOp::Neg(_) => call("neg", vec![&unary.expr]),
                UnOp::Not(_) => call("not", vec![&unary.expr]),
                _ => unreachable!("compiler bug: a meaning that C lacks"),
            },
            Expr::Binary(binary) => {
                let name = match binary.op {
                    BinOp::Add(_) => "add",
                    BinOp::Sub(_) => "sub",
                    BinOp::Mul(_) => "mul",
                    BinOp::Div(_) => "div",
                    BinOp::BitAnd(_) => "both",
                    BinOp::BitOr(_) => "either",
                    _ => unreachable!("compiler bug: a meaning that C lacks"),
                };
                call(name, vec![&binary.left, &binary.right])
            }
            Expr::MethodCall(method) => {
                let list = std::iter::once(&*method.receiver).chain(&method.args).collect();
                call(&method.method.to_string(), list)
            }
            _ => unreachable!("compiler bug: a meaning that C lacks"),
        }
    }

    /// Writes the expression.
    pub(super) fn written(&self, dialect: Dialect, operands: &[&str], text: &mut String) {
        match self {
            Self::Operand(place) => text.push_str(operands[*place]),
            Self::Call(name, list) => match (dialect.infix(name), &list[..]) {
                (Some(sign), [a]) => {
                    text.push_str(sign);
                    a.factor(dialect, operands, text);
                }
                (Some(sign), [a, b]) => {
                    a.factor(dialect, operands, text);
                    let _ = write!(text, " {sign} ");
                    b.factor(dialect, operands, text);
                }
                _ => {
                    let _ = write!(text, "{}{name}(", dialect.prefix());
                    for (place, argument) in list.iter().enumerate() {
                        text.push_str(if place == 0 { "" } else { ", " });
                        argument.written(dialect, operands, text);
                    }
                    text.push(')');
                }
            },
        }
    }

    fn factor(&self, dialect: Dialect, operands: &[&str], text: &mut String) {
        let needs_brackets = matches!(self, Self::Call(name, _) if dialect.infix(name).is_some());
        text.push_str(if needs_brackets { "(" } else { "" });
        self.written(dialect, operands, text);
        text.push_str(if needs_brackets { ")" } else { "" });
    }
}

/// Returns the expression of a statement; `None` for an input, which is read in place. `name` returns the name of an
/// earlier statement.
pub(super) fn statement(
    dialect: Dialect,
    meanings: &Meanings,
    op: Op,
    name: impl Fn(NodeId) -> String,
) -> Option<String> {
    let call = |function: &str, arguments: &[&str]| Some(dialect.call(function, arguments));
    match op {
        Op::Input(_) => None,
        Op::Constant(bits) => Some(dialect.constant(f64::from_bits(bits))),
        Op::Pi => Some(dialect.constant(std::f64::consts::PI)),
        Op::Truth(value) => Some(dialect.truth(value)),
        Op::IsModerate(a, degree) => call("is_moderate", &[&name(a), &degree.to_string()]),
        Op::Select(mask, a, b) if dialect.numbers == Numbers::Plain => {
            Some(format!("{} ? {} : {}", name(mask), name(a), name(b)))
        }
        Op::Select(mask, a, b) => call("select", &[&name(mask), &name(a), &name(b)]),
        _ => {
            let operands: Vec<String> = op.operands().map(name).collect();
            let operands: Vec<&str> = operands.iter().map(String::as_str).collect();
            let mut text = String::new();
            meanings.of(op).written(dialect, &operands, &mut text);
            Some(text)
        }
    }
}
