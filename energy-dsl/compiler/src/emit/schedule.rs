//! Renders statements as Rust.

use proc_macro2::{Literal, TokenStream};
use quote::{ToTokens, format_ident, quote};

use crate::graph::{Graph, Input, NodeId, Op};
use crate::statements::Sequence;

/// Emits the expression that reads an input.
pub(super) type Reader<'a> = &'a dyn Fn(Input) -> TokenStream;

/// Straight-line code. Each node is computed just before its first use.
pub(super) struct Schedule<'a> {
    sequence: Sequence<'a>,
    read: Reader<'a>,
    /// The expression of each statement's result: a variable, or an input.
    names: Vec<TokenStream>,
    /// Number of statements without the inputs.
    computed: usize,
    returned: Vec<NodeId>,
}

/// Statements per block. Each `let` opens a scope within the previous one, and rustc recurses over scopes, so long
/// routines are split into blocks that return what later ones read.
const BLOCK: usize = 128;

/// Bytes of the tokens of a statement.
const STATEMENT_BYTES: u64 = 1000;

impl<'a> Schedule<'a> {
    pub(super) fn new(graph: &'a Graph, read: Reader<'a>) -> Self {
        Self { sequence: Sequence::new(graph), read, names: Vec::new(), computed: 0, returned: Vec::new() }
    }

    /// Returns the statements so far.
    pub(super) fn statements(&self) -> TokenStream {
        let list = self.sequence.statements().list();
        let computed: Vec<usize> = (0..list.len()).filter(|&place| !matches!(list[place], Op::Input(_))).collect();
        if computed.len() <= 2 * BLOCK {
            return self.lets(&computed);
        }
        let last_uses = self.sequence.statements().last_uses(self.returned.iter().copied());
        let blocks = computed.chunks(BLOCK).map(|block| {
            let end = block[block.len() - 1];
            let handed_on: Vec<&TokenStream> =
                block.iter().filter(|&&place| last_uses[place] > end).map(|&place| &self.names[place]).collect();
            let lets = self.lets(block);
            quote!(let (#(#handed_on,)*) = { #lets (#(#handed_on,)*) };)
        });
        blocks.collect()
    }

    fn lets(&self, places: &[usize]) -> TokenStream {
        self.sequence.budget().spend(2 * places.len() as u64, STATEMENT_BYTES * places.len() as u64);
        let list = self.sequence.statements().list();
        places
            .iter()
            .map(|&place| {
                let (name, expression) = (&self.names[place], self.expression(list[place]));
                quote!(let #name = #expression;)
            })
            .collect()
    }

    /// Returns the expression of a node, after the statements that compute it.
    pub(super) fn value(&mut self, node: NodeId) -> TokenStream {
        let place = self.sequence.value(node);
        let Self { sequence, read, names, computed, .. } = self;
        for op in &sequence.statements().list()[names.len()..] {
            names.push(match *op {
                Op::Input(input) => read(input),
                _ => {
                    let name = format_ident!("t{computed}");
                    *computed += 1;
                    quote!(#name)
                }
            });
        }
        self.returned.push(place);
        self.names[place.0 as usize].clone()
    }

    /// Returns an array of nodes.
    pub(super) fn array(&mut self, nodes: &[NodeId]) -> TokenStream {
        let values: Vec<_> = nodes.iter().map(|&n| self.value(n)).collect();
        quote!([#(#values),*])
    }

    /// Returns an array of 3-vectors.
    pub(super) fn vectors(&mut self, nodes: &[NodeId]) -> TokenStream {
        let vectors: Vec<_> = nodes.chunks(3).map(|v| self.array(v)).collect();
        quote!([#(#vectors),*])
    }

    /// Returns an array of 3×3 blocks.
    pub(super) fn blocks(&mut self, nodes: &[NodeId]) -> TokenStream {
        let blocks: Vec<_> = nodes.chunks(9).map(|b| self.vectors(b)).collect();
        quote!([#(#blocks),*])
    }

    /// Returns a mask; false if there is none.
    pub(super) fn mask(&mut self, node: Option<NodeId>) -> TokenStream {
        match node {
            Some(node) => self.value(node),
            None => quote!(<T::Mask as ::energy_dsl::Mask>::none()),
        }
    }

    fn expression(&self, op: Op) -> TokenStream {
        let p = |place: NodeId| &self.names[place.0 as usize];
        let infix = |a, operator: TokenStream, b| {
            let (a, b) = (p(a), p(b));
            quote!(#a #operator #b)
        };
        let method = |name: &str, a: NodeId, rest: &[NodeId]| {
            let (name, a, rest) = (format_ident!("{name}"), p(a), rest.iter().map(|&r| p(r)));
            quote!(#a.#name(#(#rest),*))
        };
        // Functions that depend on the level take it as `L`.
        let levelled = |name: &str, a: NodeId, rest: &[NodeId]| {
            let (name, a, rest) = (format_ident!("{name}"), p(a), rest.iter().map(|&r| p(r)));
            quote!(#a.#name::<L>(#(#rest),*))
        };
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
            Op::Neg(a) => {
                let a = p(a);
                quote!(-#a)
            }
            Op::Add(a, b) => infix(a, quote!(+), b),
            Op::Sub(a, b) => infix(a, quote!(-), b),
            Op::Mul(a, b) => infix(a, quote!(*), b),
            Op::Div(a, b) => infix(a, quote!(/), b),
            Op::And(a, b) => infix(a, quote!(&), b),
            Op::Or(a, b) => infix(a, quote!(|), b),
            Op::Not(a) => {
                let a = p(a);
                quote!(!#a)
            }
            Op::Sqrt(a) => method("sqrt", a, &[]),
            Op::Abs(a) => method("abs", a, &[]),
            Op::Min(a, b) => method("min", a, &[b]),
            Op::Max(a, b) => method("max", a, &[b]),
            Op::Sin(a) => levelled("sin", a, &[]),
            Op::Cos(a) => levelled("cos", a, &[]),
            Op::Exp(a) => levelled("exp", a, &[]),
            Op::Ln(a) => levelled("ln", a, &[]),
            Op::Atan2(a, b) => levelled("atan2", a, &[b]),
            Op::ModerateAtan2(a, b) => levelled("moderate_atan2", a, &[b]),
            Op::Pow(a, b) => levelled("powf", a, &[b]),
            Op::SumError(a, b) => method("sum_error", a, &[b]),
            Op::DifferenceError(a, b) => method("difference_error", a, &[b]),
            Op::ProductError(a, b) => levelled("product_error", a, &[b]),
            Op::FusedMulSub(a, b, c) => levelled("fused_mul_sub", a, &[b, c]),
            Op::RootError(a, b) => levelled("root_error", a, &[b]),
            Op::MulAdd(a, b, c) => levelled("mul_add", a, &[b, c]),
            Op::MulSub(a, b, c) => {
                let (a, b, c) = (p(a), p(b), p(c));
                quote!(#a.mul_add::<L>(#b, -#c))
            }
            Op::NegMulAdd(a, b, c) => {
                let (a, b, c) = (p(a), p(b), p(c));
                quote!((-#a).mul_add::<L>(#b, #c))
            }
            Op::NegMulSub(a, b, c) => {
                let (a, b, c) = (p(a), p(b), p(c));
                quote!((-#a).mul_add::<L>(#b, -#c))
            }
            Op::Truth(value) => {
                let not = if value { quote!(!) } else { quote!() };
                quote!(#not <T::Mask as ::energy_dsl::Mask>::none())
            }
            Op::IsModerate(a, degree) => {
                let a = p(a);
                quote!(#a.is_moderate(#degree))
            }
            Op::PowerOfTwoScale(a) => method("power_of_two_scale", a, &[]),
            Op::Less(a, b) => method("less", a, &[b]),
            Op::Precedes(a, b) => method("precedes", a, &[b]),
            Op::LessOrEqual(a, b) => method("less_or_equal", a, &[b]),
            Op::Equal(a, b) => method("equal", a, &[b]),
            Op::Select(mask, a, b) => {
                let (mask, a, b) = (p(mask), p(a), p(b));
                quote!(T::select(#mask, #a, #b))
            }
            Op::Input(_) | Op::Rule(_) | Op::Cautious => {
                unreachable!("compiler bug: inputs are read, rules resolved and caution decided elsewhere")
            }
        }
    }
}
