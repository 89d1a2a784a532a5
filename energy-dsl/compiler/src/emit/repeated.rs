//! Emits sums of like terms: the routines of a type for one term, and loops over the terms.

use proc_macro2::{Ident, Literal, TokenStream};
use quote::{format_ident, quote};

use super::Emitter;
use super::items::input_type;
use crate::lower::Repetition;

/// Returns the name of the type for one term; `None` if the formula is not a sum of like terms.
pub(super) fn term_of(emitter: &Emitter<'_>) -> Option<Ident> {
    let Emitter { name, plan, .. } = emitter;
    plan.repetition.as_ref().map(|_| format_ident!("TermOf{name}"))
}

/// Emits the type for one term; nothing if the formula is not a sum of like terms.
pub(super) fn term(emitter: &Emitter<'_>) -> TokenStream {
    let Emitter { name, program, plan, .. } = emitter;
    let (Some(term), Some(repetition)) = (term_of(emitter), &plan.repetition) else {
        return TokenStream::new();
    };
    let Repetition { shared, stride, table } = repetition;
    let (terms, constants) = (repetition.terms(), table[0].len());
    let numbers = shared + stride + constants;
    let fields: Vec<_> = program.parameters.iter().map(|parameter| format_ident!("{}", parameter.name)).collect();
    let types = program.parameters.iter().map(input_type);
    let rows = table.iter().map(|row| {
        let row = row.iter().map(|&number| Literal::f64_suffixed(number));
        quote!([#(#row),*])
    });
    quote! {
        /// One term of the sum.
        #[derive(Clone, Copy)]
        #[allow(non_snake_case, mixed_script_confusables, confusable_idents, uncommon_codepoints)]
        struct #term<T> {
            #(#fields: #types,)*
            precomputed: [T; #numbers],
        }

        #[allow(non_snake_case, mixed_script_confusables, confusable_idents, clippy::all, clippy::pedantic)]
        impl<T: ::energy_dsl::Real> #term<T> {
            /// Constants of each term.
            const TABLE: [[f64; #constants]; #terms] = [#(#rows),*];

            #[inline(always)]
            fn of(element: &#name<T>, term: usize) -> Self {
                let mut precomputed = [T::from_f64(0.0); #numbers];
                precomputed[..#shared].copy_from_slice(&element.precomputed[..#shared]);
                precomputed[#shared..#shared + #stride]
                    .copy_from_slice(&element.precomputed[#shared + term * #stride..][..#stride]);
                for number in 0..#constants {
                    precomputed[#shared + #stride + number] = T::from_f64(Self::TABLE[term][number]);
                }
                Self { #(#fields: element.#fields,)* precomputed }
            }
        }
    }
}

/// Emits the loop that sums a routine over all terms.
pub(super) fn sum(term: &Ident, routine: &Ident, arguments: &[&Ident]) -> TokenStream {
    quote! {
        let mut sum = ::energy_dsl::Accumulate::zero();
        for term in 0..#term::<T>::TABLE.len() {
            let result = #term::of(self, term).#routine::<L>(#(#arguments),*);
            ::energy_dsl::Accumulate::accumulate(&mut sum, &result);
        }
        ::energy_dsl::Accumulate::total(sum)
    }
}
