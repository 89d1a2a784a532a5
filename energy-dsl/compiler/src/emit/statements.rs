//! Renders statements as Rust.

use proc_macro2::{Ident, Literal, TokenStream};
use quote::{ToTokens, format_ident, quote};

use super::Emitter;
use super::spelling::Spellings;
use crate::graph::{Input, NodeId, Op};
use crate::plan::{Code, Shape, Statements};

/// Straight-line code as Rust.
pub(super) struct Rendered {
    /// A `let` for each statement that is not an input.
    pub(super) statements: TokenStream,
    names: Names,
}

/// Statements per block. Each `let` opens a scope within the previous one, and rustc recurses over scopes, so long
/// routines are split into blocks that return what later ones read.
const BLOCK: usize = 128;

/// Bytes of the tokens of a statement.
const STATEMENT_BYTES: u64 = 1000;

impl Emitter<'_> {
    /// Renders code. `read` returns the expression that reads an input.
    pub(super) fn rendered(&self, code: &Code, read: &mut dyn FnMut(Input) -> TokenStream) -> Rendered {
        let list = code.statements.list();
        let is_computed = |&place: &usize| !matches!(list[place], Op::Input(_));
        let computed: Vec<usize> = (0..list.len()).filter(is_computed).collect();
        self.program.budget.spend(2 * computed.len() as u64, STATEMENT_BYTES * computed.len() as u64);
        let names = Names::new(&code.statements, read);
        if computed.len() <= 2 * BLOCK {
            return Rendered { statements: self.lets(list, &names, &computed), names };
        }
        let last_uses = code.statements.last_uses(code.returned());
        let blocks = computed.chunks(BLOCK).map(|block| {
            let end = block[block.len() - 1];
            let handed_on: Vec<&TokenStream> =
                block.iter().filter(|&&place| last_uses[place] > end).map(|&place| &names.0[place]).collect();
            let lets = self.lets(list, &names, block);
            quote!(let (#(#handed_on,)*) = { #lets (#(#handed_on,)*) };)
        });
        Rendered { statements: blocks.collect(), names }
    }

    fn lets(&self, list: &[Op], names: &Names, places: &[usize]) -> TokenStream {
        let statement = |&place: &usize| {
            let (name, expression) = (&names.0[place], names.expression(list[place], &self.spellings));
            quote!(let #name = #expression;)
        };
        places.iter().map(statement).collect()
    }
}

impl Rendered {
    /// Returns the expressions of some results.
    pub(super) fn numbers(&self, group: &[NodeId]) -> Vec<TokenStream> {
        group.iter().map(|&place| self.names.of(place).clone()).collect()
    }

    /// Returns a mask; false without one.
    pub(super) fn mask(&self, place: Option<NodeId>) -> TokenStream {
        match place {
            Some(place) => self.names.of(place).clone(),
            None => quote!(<T::Mask as ::energy_dsl::Mask>::none()),
        }
    }
}

/// Arranges the numbers of a group in Rust's arrays.
pub(super) fn arranged(shape: Shape, numbers: &[TokenStream]) -> TokenStream {
    let arrays = |length: usize, of: Shape| -> Vec<TokenStream> {
        numbers.chunks(length).map(|numbers| arranged(of, numbers)).collect()
    };
    let entries = match shape {
        Shape::Number => return numbers[0].clone(),
        Shape::Numbers => numbers.to_vec(),
        Shape::Vectors => arrays(3, Shape::Numbers),
        Shape::Blocks => arrays(9, Shape::Vectors),
    };
    quote!([#(#entries),*])
}

/// Returns the variable of a number that has a name in the formula: `F01__12` for `F[0][1]`. `None` if the name has
/// characters that Rust does not allow.
fn variable(number: usize, name: &str) -> Option<Ident> {
    let text: String = name.chars().filter(|c| !matches!(c, '[' | ']')).collect();
    syn::parse_str(&format!("{text}__{number}")).ok()
}

/// The expression of each statement's result: a variable, or an input.
struct Names(Vec<TokenStream>);

impl Names {
    fn new(statements: &Statements, read: &mut dyn FnMut(Input) -> TokenStream) -> Self {
        let mut computed = 0..;
        let name = |(place, op): (usize, &Op)| match *op {
            Op::Input(input) => read(input),
            _ => {
                let number = computed.next().unwrap_or(usize::MAX);
                let named = statements.name(place).and_then(|name| variable(number, name));
                let name = named.unwrap_or_else(|| format_ident!("__{number}"));
                quote!(#name)
            }
        };
        Self(statements.list().iter().enumerate().map(name).collect())
    }

    fn of(&self, place: NodeId) -> &TokenStream {
        &self.0[place.0 as usize]
    }

    fn expression(&self, op: Op, spellings: &Spellings) -> TokenStream {
        match op {
            Op::Constant(bits) => {
                let magnitude = f64::from_bits(bits).abs();
                // Constants such as 1/0 and 0/0 cannot be literals.
                let literal = if magnitude.is_finite() {
                    Literal::f64_suffixed(magnitude).into_token_stream()
                } else if magnitude.is_nan() {
                    quote!(::core::primitive::f64::NAN)
                } else {
                    quote!(::core::primitive::f64::INFINITY)
                };
                let sign = if f64::from_bits(bits) < 0.0 { quote!(-) } else { quote!() };
                quote!(T::from_f64(#sign #literal))
            }
            Op::Pi => quote!(T::from_f64(::core::f64::consts::PI)),
            Op::Truth(value) => {
                let not = if value { quote!(!) } else { quote!() };
                quote!(#not <T::Mask as ::energy_dsl::Mask>::none())
            }
            Op::IsModerate(a, degree) => {
                let a = self.of(a);
                quote!(#a.is_moderate(#degree))
            }
            Op::Select(mask, a, b) => {
                let (mask, a, b) = (self.of(mask), self.of(a), self.of(b));
                quote!(T::select(#mask, #a, #b))
            }
            _ => {
                let operands = op.operands().map(|place| self.of(place)).collect::<Vec<_>>();
                spellings.spelled(op, &operands)
            }
        }
    }
}
