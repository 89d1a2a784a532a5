use energy_dsl::energy;

energy! {
    energy Spring(p, q: Point; k: Scalar, L: Scalar) { k / 2 * (norm(p - q) - K0)^2 + L }
}

fn main() {}
