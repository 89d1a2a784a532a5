//! `include_energy!`: declarations from a file of the crate.

use std::path::Path;

use proc_macro2::{Literal, Span, TokenStream, TokenTree};

/// The code of the file whose path is the only token.
pub fn expand(input: TokenStream) -> TokenStream {
    let at = input.clone().into_iter().next().map_or_else(Span::call_site, |token| token.span());
    match path(input).and_then(|path| read(&path).map(|text| (path, text))) {
        Ok((path, text)) => {
            let code = energy_compiler::compile_file(&text, &path, at);
            let path = Literal::string(&format!("/{path}"));
            // Names the file in the code, so that cargo rebuilds the crate when it changes.
            quote::quote! {
                const _: &[u8] = ::core::include_bytes!(::core::concat!(::core::env!("CARGO_MANIFEST_DIR"), #path));
                #code
            }
        }
        Err(message) => quote::quote_spanned!(at=> ::core::compile_error!(#message);),
    }
}

/// Returns the path in the literal.
fn path(input: TokenStream) -> Result<String, String> {
    const EXPECTED: &str =
        "expected the path of a file from the root of the crate, as in include_energy!(\"src/springs.energy\")";
    let mut tokens = input.into_iter();
    let (Some(TokenTree::Literal(literal)), None) = (tokens.next(), tokens.next()) else { return Err(EXPECTED.into()) };
    let literal = literal.to_string();
    let path = literal.strip_prefix('"').and_then(|l| l.strip_suffix('"')).filter(|p| !p.contains('\\'));
    path.map(str::to_owned).ok_or_else(|| EXPECTED.into())
}

/// Reads the file.
fn read(path: &str) -> Result<String, String> {
    let root = std::env::var("CARGO_MANIFEST_DIR").unwrap_or_else(|_| ".".into());
    let whole = Path::new(&root).join(path);
    std::fs::read_to_string(&whole).map_err(|error| {
        format!(
            "cannot read {path}: {error}\nhelp: the path is from the root of the crate; this is {}",
            whole.display()
        )
    })
}

#[cfg(test)]
mod tests {
    use super::expand;

    #[test]
    fn a_file_that_is_not_there_and_a_path_that_is_none_are_clear_errors() {
        for (input, expected) in [
            ("\"tests/nowhere.energy\"", "cannot read tests/nowhere.energy"),
            ("tests", "expected the path of a file"),
            ("", "expected the path of a file"),
            ("\"a\", \"b\"", "expected the path of a file"),
        ] {
            let code = expand(input.parse().unwrap()).to_string();
            assert!(code.contains("compile_error") && code.contains(expected), "{input}: {code}");
        }
    }

    #[test]
    fn a_change_of_the_file_compiles_it_anew() {
        let code = expand("\"src/pull.energy\"".parse().unwrap()).to_string();
        assert!(code.contains("include_bytes") && code.contains("\"/src/pull.energy\""), "{code}");
    }
}
