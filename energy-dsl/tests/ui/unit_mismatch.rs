use energy_dsl::energy;

energy! {
    energy Spring(p, q: Point; k: Scalar[N], L: Scalar[m]) { k / 2 * (norm(p - q) - L)^2 }
}

fn main() {}
