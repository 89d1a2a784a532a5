use energy_dsl::energy;

energy! {
    pub energy Spring(p, q: Point; k: Scalar) = "k \q ‖p − q‖²";
}

fn main() {}
