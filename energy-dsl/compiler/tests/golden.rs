//! Compares texts that users read with recorded ones. `UPDATE_GOLDEN=1 cargo test` records them.

use std::path::Path;

use energy_compiler::{Textbook, compile};

fn assert_golden(name: &str, actual: &str) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden").join(name);
    if std::env::var_os("UPDATE_GOLDEN").is_some() {
        std::fs::write(&path, actual).unwrap();
    }
    let recorded = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(recorded == actual, "{name} differs from what was recorded; it is now:\n{actual}");
}

#[test]
fn every_mistake_gets_a_message_with_its_place_and_its_remedy() {
    let broken = include_str!("golden/broken.txt");
    let mut messages = String::new();
    for source in broken.split("\n\n").map(str::trim) {
        let errors = Textbook::from_source(source).err().map_or_else(|| "accepted".into(), |e| e.to_string());
        messages += &format!("{source}\n---\n{errors}\n\n==========\n\n");
    }
    assert!(!messages.contains("\naccepted\n"), "{messages}");
    assert_golden("broken.messages.txt", &messages);
}

#[test]
fn generated_code_is_stable_and_readable() {
    let source = "energy Pull(p, q: Point; k: Scalar[N/m]) = \"k/2 ‖p − q‖²\";";
    let code: syn::File = syn::parse2(compile(source.parse().unwrap())).unwrap();
    assert_golden("pull.rs.txt", &prettyplease::unparse(&code));
}

#[test]
fn a_broken_declaration_still_declares_its_type() {
    for source in [
        "pub energy Broken(p, q: Point; k: Scalar) { k * norm(p - r) }",
        "pub force Broken(p, q: Point; k: Scalar) { [k * (p - q)] }",
        "pub constraint Broken(p, q: Point; L: Scalar) = \"‖p − q − L\";",
        "pub energy Broken(p, q: Point; type: Scalar) { type * norm(p - q) }",
        "pub energy Broken(p, q: Point; rest fn_, where: Scalar) { rest { let r = where * fn_; } r * norm(p - q) }",
    ] {
        let code = compile(source.parse().unwrap()).to_string();
        assert!(code.contains("compile_error"), "{source}: no error");
        assert!(code.contains("pub struct Broken"), "{source}: no stub");
        assert_eq!(code.matches("compile_error").count(), 1, "{source}: one mistake, one error");
        assert!(syn::parse_str::<syn::File>(&code).is_ok(), "{source}: the stub is no Rust");
    }
}

/// Messages about a file name file, line and column, and show the line.
#[test]
fn mistakes_in_a_file_are_shown_in_it() {
    let text = include_str!("golden/broken.energy");
    let code = energy_compiler::compile_file(text, "src/broken.energy", proc_macro2::Span::call_site());
    let file: syn::File = syn::parse2(code).unwrap();
    let mut messages = String::new();
    for item in file.items {
        if let syn::Item::Macro(call) = item {
            let message: syn::LitStr = syn::parse2(call.mac.tokens).unwrap();
            messages += &format!("{}\n\n", message.value());
        }
    }
    assert_golden("broken.energy.messages.txt", &messages);
}

/// Claims that cannot be proved, or that nothing checks, are errors.
#[test]
fn claims_are_proved_or_refused() {
    for (source, expected) in [
        ("#[invariant(translation)] energy A(p, q: Point) { norm(p - q) + dot(q, p - q) }", "`q` is used on its own"),
        ("#[invariant(translation)] residual A(p: Vec3) { p }", "has no invariance of points"),
        ("#[even] energy A(p: Point) { norm(p) }", "nothing checks the claim `even`"),
        (
            "#[audit] #[rest_state(zero_force)] energy A(p, q: Point; L: Scalar) { norm(p - q) * L }",
            "where each point rests",
        ),
        ("#[audit] #[invariant(scale)] energy A(p: Point) { norm(p) }", "unknown property `scale`"),
        ("#[audit(sample = 3)] energy A(p: Point) { norm(p) }", "unknown option `sample`"),
        ("#[audit(domain(j = 1..2))] energy A(p: Point; k: Scalar) { k * norm(p) }", "`j` is not an input"),
        ("#[audit(domain(k = 2..1))] energy A(p: Point; k: Scalar) { k * norm(p) }", "the range of `k` is empty"),
        ("#[audit(domain(k = 1..2, k = 1..3))] energy A(p: Point; k: Scalar) { k * norm(p) }", "`k` has two ranges"),
        ("#[audit(domain(p = 1..2))] energy A(p: Point) { norm(p) }", "`p` has no range"),
        ("#[audit(domain(strain = 1..2))] energy A(p: Point) { norm(p) }", "strain needs a rest shape"),
        ("#[audit(domain(scale = 0..2))] energy A(p: Point) { norm(p) }", "a scale is greater than 0"),
        ("#[audit(domain(k = 1, 2))] energy A(p: Point; k: Scalar) { k * norm(p) }", "between the ends of the range"),
        ("#[audit(tolerance = 0.5)] energy A(p: Point) { norm(p) }", "a relative error from 0 to 1e-3"),
        ("#[odd] energy A(p: Point) { norm(p) }", "unknown attribute `odd`"),
        ("#[vertex] force A(p: Point) { p }", "a force has no routines of single vertices"),
        ("#[uncompensated] fn f(a) { a } energy A(p: Point) { f(norm(p)) }", "a declaration after its attributes"),
    ] {
        let code = compile(source.parse().unwrap()).to_string();
        assert!(code.contains("compile_error") && code.contains(expected), "{source}: {code}");
    }
    let scoped = "#[audit(samples = 3, domain(k = -1..2, scale = 0.1..1), tolerance = 1e-6)]
                  energy A(p, q: Point; k: Scalar) { k * norm(p - q) }";
    let code = compile(scoped.parse().unwrap()).to_string();
    assert!(!code.contains("compile_error"), "{code}");
    assert!(code.contains("#[audit(domain(k = -1.0..2.0, scale = 0.1..1.0), tolerance = 1e-6)]"), "{code}");
    let right = "#[invariant(translation)] force A(p, q: Point; k: Scalar) { [k * (p - q), -k * (p - q)] }";
    assert!(!compile(right.parse().unwrap()).to_string().contains("compile_error"));
}
