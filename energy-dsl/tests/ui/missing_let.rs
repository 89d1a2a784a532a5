use energy_dsl::energy;

energy! {
    pub energy Spring(p, q: Point; k: Scalar) { d = p - q; k * norm(d) }
}

fn main() {}
