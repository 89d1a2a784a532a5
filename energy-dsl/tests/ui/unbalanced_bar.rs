use energy_dsl::energy;

energy! {
    energy Spring(p, q: Point; L: Scalar) { "‖p − q − L" }
}

fn main() {}
