use energy_dsl::energy;

energy! {
    energy Kinetic(p: Point, v: Velocity; m: Scalar) { m / 2 * norm_squared(v) + norm(p) }
}

fn main() {}
