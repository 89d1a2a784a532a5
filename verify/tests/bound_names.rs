//! Generated Rust binds the names that it uses. Most tests run tapes, which have no names, and rustc checks a fixed set
//! of elements.

use std::collections::BTreeSet;

use energy_compiler::Listing;
use proc_macro2::{Delimiter, TokenStream, TokenTree};

const FILES: [(&str, &str); 4] = [
    ("foreign_potentials.energy", include_str!("../data/foreign_potentials.energy")),
    ("user_formulas.energy", include_str!("../data/user_formulas.energy")),
    ("errata.energy", include_str!("../data/errata.energy")),
    ("unknowns.energy", include_str!("unknowns.energy")),
];

/// Returns the numbered temporaries and the SIMD levels that functions use without binding them, each with its function.
pub(crate) fn unbound(listing: &Listing) -> Vec<String> {
    let code = listing.code().replace("b\"…\"", "b\"\"");
    let mut found = Vec::new();
    functions(code.parse().expect("generated code consists of tokens"), &mut found);
    found
}

fn functions(tokens: TokenStream, found: &mut Vec<String>) {
    names(tokens, &mut BTreeSet::new(), &mut BTreeSet::new(), found);
}

/// Checks the function whose name is at this place, and returns the place of its body.
fn function(tokens: &[TokenTree], name: usize, found: &mut Vec<String>) -> usize {
    let body = (name..tokens.len()).find(|&at| braces(&tokens[at]).is_some()).unwrap_or(tokens.len() - 1);
    let (mut bound, mut used) = (BTreeSet::new(), BTreeSet::new());
    identifiers(tokens[name..body].iter().cloned().collect(), &mut bound);
    if let Some(body) = braces(&tokens[body]) {
        names(body, &mut bound, &mut used, found);
    }
    found.extend(used.difference(&bound).map(|unbound| format!("{unbound} in {}", tokens[name])));
    body
}

/// Collects what `let` binds, and the temporaries and levels that are used. Checks functions within.
fn names(tokens: TokenStream, bound: &mut BTreeSet<String>, used: &mut BTreeSet<String>, found: &mut Vec<String>) {
    let tokens: Vec<TokenTree> = tokens.into_iter().collect();
    let mut at = 0;
    while at < tokens.len() {
        match &tokens[at] {
            TokenTree::Ident(ident) if ident == "fn" && matches!(tokens.get(at + 1), Some(TokenTree::Ident(_))) => {
                at = function(&tokens, at + 1, found);
            }
            TokenTree::Ident(ident) if ident == "let" => {
                let pattern = tokens[at + 1..].iter().take_while(|token| token.to_string() != "=");
                identifiers(pattern.cloned().collect(), bound);
            }
            TokenTree::Ident(ident) => {
                let name = ident.to_string();
                let is_temporary = name.strip_prefix("__").is_some_and(|digits| digits.parse::<u32>().is_ok());
                let is_level = name == "L" && at > 0 && is(&tokens, at - 1, "<") && !is(&tokens, at + 1, ":");
                if is_temporary || is_level {
                    used.insert(name);
                }
            }
            TokenTree::Group(group) => names(group.stream(), bound, used, found),
            _ => {}
        }
        at += 1;
    }
}

fn identifiers(tokens: TokenStream, to: &mut BTreeSet<String>) {
    for token in tokens {
        match token {
            TokenTree::Ident(ident) => {
                to.insert(ident.to_string());
            }
            TokenTree::Group(group) => identifiers(group.stream(), to),
            _ => {}
        }
    }
}

fn braces(token: &TokenTree) -> Option<TokenStream> {
    match token {
        TokenTree::Group(group) if group.delimiter() == Delimiter::Brace => Some(group.stream()),
        _ => None,
    }
}

fn is(tokens: &[TokenTree], at: usize, text: &str) -> bool {
    tokens.get(at).is_some_and(|token| token.to_string() == text)
}

#[test]
fn names_in_the_code_of_other_peoples_formulas_are_bound() {
    for (name, text) in FILES {
        let listings = Listing::from_file(text, name).unwrap_or_else(|errors| panic!("{errors}"));
        assert!(listings.len() > 3, "{name}");
        for listing in listings {
            assert_eq!(unbound(&listing), [""; 0], "{name}, {}", listing.name());
        }
    }
}

#[test]
fn a_missing_binding_is_noticed() {
    let code = "impl A { fn f<L: Level>(x: f64) -> f64 { let __0 = x; let (__1, __2) = g::<L>(__0); __1 + __2 } \
                fn h(&self) -> f64 { let __3 = self.L; if __3 > 0.0 { k::<L>(__4) } else { __3 } } }";
    let mut found = Vec::new();
    functions(code.parse().expect("tokens"), &mut found);
    assert_eq!(found, ["L in h", "__4 in h"]);
}
