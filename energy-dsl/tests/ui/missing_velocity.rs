use energy_dsl::energy;

energy! {
    force Drag(p: Point; c: Scalar) { -c * v }
}

fn main() {}
