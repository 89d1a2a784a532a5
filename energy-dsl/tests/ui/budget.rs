use energy_dsl::energy;

energy! {
    /// A budget of its own that is too small.
    #[limits(steps = 1000)]
    energy Long(p, q: Point; k: Scalar) {
        let s = sum(i in 0..100, sin(i * k * norm(p - q)));
        s * s
    }
    /// An unknown limit.
    #[limits(time = 3)]
    energy Short(p: Point; k: Scalar) { k * norm(p) }
}

fn main() {
    // The stub has the type of the declaration, so that this is no further error.
    let _ = Long::new(1.0);
}
