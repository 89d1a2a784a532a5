/// Random numbers that are the same on every machine: SplitMix64 (Steele, Lea and Flood 2014).
#[derive(Clone, Debug)]
pub struct Random(u64);

impl Random {
    /// Creates a generator from a seed.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// Returns a number in [`from`, `to`).
    pub fn between(&mut self, from: f64, to: f64) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut bits = self.0;
        bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        bits ^= bits >> 31;
        from + (to - from) * ((bits >> 11) as f64 * (0.5f64).powi(53))
    }

    /// Returns a vector with components in [−`size`, `size`).
    pub fn vector(&mut self, size: f64) -> [f64; 3] {
        [0.0; 3].map(|_| self.between(-size, size))
    }

    /// Returns a unit vector, uniformly distributed.
    pub fn direction(&mut self) -> [f64; 3] {
        loop {
            let v = self.vector(1.0);
            let square: f64 = v.iter().map(|x| x * x).sum();
            if (0.01..1.0).contains(&square) {
                return v.map(|x| x / square.sqrt());
            }
        }
    }

    /// Returns three random orthonormal vectors.
    pub fn frame(&mut self) -> [[f64; 3]; 3] {
        let x = self.direction();
        loop {
            let other = self.direction();
            let along: f64 = (0..3).map(|i| x[i] * other[i]).sum();
            if along.abs() < 0.9 {
                let length = (1.0 - along * along).sqrt();
                let y: [f64; 3] = std::array::from_fn(|i| (other[i] - along * x[i]) / length);
                let z = [x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0]];
                return [x, y, z];
            }
        }
    }
}
