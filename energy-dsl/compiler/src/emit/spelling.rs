//! Spells operations as the table of operations has them, with other names for the operands.

use std::cell::RefCell;
use std::rc::Rc;

use proc_macro2::{Delimiter, Group, TokenStream, TokenTree};
use rustc_hash::FxHashMap;

use crate::graph::{Op, Spelling};

/// The spellings that were needed so far. Each is parsed once.
#[derive(Default)]
pub(super) struct Spellings(RefCell<FxHashMap<&'static str, Rc<[Piece]>>>);

/// A part of a spelling.
enum Piece {
    /// An operand, by number.
    Operand(usize),
    Token(TokenTree),
    Group(Delimiter, Vec<Piece>),
}

impl Spellings {
    /// Returns the expression of an operation of the table on operands.
    pub(super) fn spelled(&self, op: Op, operands: &[&TokenStream]) -> TokenStream {
        let Some(Spelling { meaning, operands: names }) = op.spelling() else {
            unreachable!("compiler bug: inputs are read, rules resolved and caution decided elsewhere")
        };
        let mut known = self.0.borrow_mut();
        let pieces = known.entry(meaning).or_insert_with(|| {
            let tokens: TokenStream = meaning.parse().expect("the table of operations is Rust");
            pieces(tokens, names).into()
        });
        let mut spelled = TokenStream::new();
        spell(pieces, operands, &mut spelled);
        spelled
    }
}

fn pieces(tokens: TokenStream, names: &[&str]) -> Vec<Piece> {
    let piece = |token: TokenTree| match token {
        TokenTree::Group(group) => Piece::Group(group.delimiter(), pieces(group.stream(), names)),
        token => {
            let is_named = |name: &&str| matches!(&token, TokenTree::Ident(ident) if ident == name);
            names.iter().position(is_named).map_or_else(|| Piece::Token(token.clone()), Piece::Operand)
        }
    };
    tokens.into_iter().map(piece).collect()
}

fn spell(pieces: &[Piece], operands: &[&TokenStream], spelled: &mut TokenStream) {
    for piece in pieces {
        match piece {
            Piece::Operand(number) => spelled.extend(operands[*number].clone()),
            Piece::Token(token) => spelled.extend([token.clone()]),
            Piece::Group(delimiter, inner) => {
                let mut within = TokenStream::new();
                spell(inner, operands, &mut within);
                spelled.extend([TokenTree::Group(Group::new(*delimiter, within))]);
            }
        }
    }
}
