//! Converts text to a syntax tree. Rust tokens and mathematical notation become the same tokens; one parser reads both.

mod ast;
mod attribute;
mod body;
pub(crate) mod characters;
mod expression;
pub(crate) mod habits;
mod lengths;
mod name;
mod next;
mod notation;
mod parse;
mod specialise;
mod text;
mod tokens;

pub use ast::{
    Assignment, AuditRange, AuditScope, Body, Constant, Declaration, ElementType, Expression, ExpressionKind,
    InputGroup, InputType, Item, Next, Section, Sum, Unit, UserFunction,
};
pub use name::{Name, canonical};
pub(crate) use notation::without_hat;
pub use parse::{check_size, parse, parse_file};
