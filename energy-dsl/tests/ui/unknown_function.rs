use energy_dsl::energy;

energy! {
    energy Spring(p, q: Point; k: Scalar) { k / 2 * nrom(p - q)^2 }
}

fn main() {}
