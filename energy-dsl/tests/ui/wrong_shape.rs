use energy_dsl::energy;

energy! {
    energy Spring(p, q: Point; k: Scalar) { k * (p - q) }
}

fn main() {}
