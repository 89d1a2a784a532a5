use energy_dsl::energy;

energy! {
    #[invariant(translation)]
    energy Weight(p: Point; m: Scalar, g: Vec3) { -m * dot(g, p) }
}

fn main() {}
