use energy_dsl::energy;

energy! {
    energy Angle(p, q, r: Point) { angle(p - q) + norm(r) }
}

fn main() {}
