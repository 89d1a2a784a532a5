use energy_dsl::energy;

energy! {
    residual Blend(x: [Scalar; 4]; w: [Scalar; 4]) { sum(j in 0..5, w[j] * x[j]) }
}

fn main() {}
