//! Error messages of the macro, and the places that rustc reports them at. `TRYBUILD=overwrite cargo test` records
//! them.

#[test]
fn mistakes_are_reported_at_their_place() {
    trybuild::TestCases::new().compile_fail("tests/ui/*.rs");
}
