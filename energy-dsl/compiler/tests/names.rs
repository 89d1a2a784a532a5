//! Names of a formula stand in the code.

use energy_compiler::{Interpreted, Listing, Precision, Target, sources};

/// Two values are called `a`: one of the formula, and one of its function.
const MEMBRANE: &str = "
    fn excess(x) { let a = x^2 - 1; a^2 }
    energy Membrane(x0, x1, x2: Point; rest u0, u1, u2: Vec2; k: Scalar, lengths: [Scalar; 2]) {
        rest { let B = inverse(columns(u1 - u0, u2 - u0)); }
        let a = x1 - x0;
        let F = columns(a, x2 - x0) * B;
        let E = transpose(F) * F - identity(2);
        let ω̃ = [norm_squared(F * vector(1, 0)) - lengths[i] for i in 0..2];
        k * (ddot(E, E) + excess(dot(a, x2 - x0)) + ω̃[0] * ω̃[1])
    }";

#[test]
fn variables_of_rust_have_the_names_of_the_formula() {
    let listing = Listing::from_source(MEMBRANE).expect("a sound program").remove(0);
    let code = listing.routine("value").expect("an energy has a value");
    let named: Vec<&str> =
        code.split_whitespace().filter_map(|word| word.split_once("__")).map(|(name, _)| name).collect();
    for name in ["a0", "a1", "a2", "E00", "E01", "E11", "a"] {
        assert!(named.contains(&name), "{name} is not in\n{code}");
    }
    assert!(syn::parse_file(&listing.code()).is_ok(), "{}", listing.code());
}

#[test]
fn comments_of_c_have_the_names_of_the_formula() {
    let elements = Interpreted::from_source(MEMBRANE).expect("a sound program");
    for precision in [Precision::Double, Precision::Single] {
        let files = sources(&elements, Target::C, &[precision]).expect("it has C");
        let header =
            &files.iter().find(|file| file.name.starts_with("membrane_") && file.name.ends_with(".h")).expect("it");
        let value = header.text.split("_value(").nth(1).and_then(|rest| rest.split("\n}").next()).expect("an energy");
        for comment in ["/* a[2] */", "/* E[0][1] */", "/* a */"] {
            assert!(value.contains(comment), "{comment} is not in\n{value}");
        }
        assert!(header.text.contains("/* ω̃[0] */") && header.text.contains("/* B[0][0] */"), "{}", header.text);
    }
}

#[test]
fn inputs_may_not_have_names_of_variables() {
    for name in ["__3", "a__12"] {
        let source = format!("energy E(p: Point; {name}: Scalar) {{ {name} * norm_squared(p) }}");
        let message = Listing::from_source(&source).expect_err("the name is taken").to_string();
        assert!(message.contains("generated code uses it"), "{message}");
    }
    assert!(Listing::from_source("energy E(p: Point; a__b: Scalar) { a__b * norm_squared(p) }").is_ok());
}
