use energy_dsl::energy;

energy! {
    energy Spring(p, q: Point; k: Scalar, L: Scalar) { k / 2 * norm_squared(p - q) }
}

fn main() {}
