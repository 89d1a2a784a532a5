//! Prints the code that a formula compiles to, and how much each routine costs:
//! `cargo run -p energy-compiler --example show`.

use energy_compiler::Listing;

fn main() {
    let source = "energy Spring(p, q: Point; k: Scalar[N/m], L: Scalar[m]) = \"k/2 (‖p − q‖ − L)²\";";
    let listing = Listing::from_source(source).expect("the formula is correct").remove(0);
    println!("{source}\n\n{}", listing.counts());
    println!("{}", listing.routine("gradient").expect("an energy has a gradient"));
}
