use energy_dsl::energy;

energy! {
    #[audited]
    energy Spring(p, q: Point; k: Scalar) { k / 2 * norm_squared(p - q) }
}

fn main() {}
