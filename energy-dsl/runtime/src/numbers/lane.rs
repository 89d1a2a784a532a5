use super::real::{Number, Real};

/// Several numbers of type `S` in one SIMD register. A scalar is a lane of one.
///
/// Every operation gives each lane the bits of the scalar operation at the same [`super::Level::FUSED`].
pub trait Lane<S: Number>: Real {
    /// Number of lanes.
    const LANES: usize;

    /// Creates a register with the same number in every lane.
    fn splat(value: S) -> Self;

    /// Reads the first [`Self::LANES`] numbers of a slice.
    ///
    /// # Panics
    /// When there are fewer; see [`Self::load_ragged`].
    fn load(values: &[S]) -> Self;

    /// Writes the first [`Self::LANES`] numbers of a slice.
    ///
    /// # Panics
    /// When there are fewer; see [`Self::store_ragged`].
    fn store(self, values: &mut [S]);

    /// Creates a register with `value(i)` in lane `i`.
    fn from_fn(value: impl FnMut(usize) -> S) -> Self;

    /// Returns the number in one lane.
    fn extract(self, lane: usize) -> S;

    /// Gathers the points at the first [`Self::LANES`] indices; returns x, y and z.
    ///
    /// # Panics
    /// If a point does not exist, or indices are too few.
    #[inline(always)]
    fn gather(points: &[[S; 3]], indices: &[u32]) -> [Self; 3] {
        gather_by_element(points, indices)
    }

    /// Transposes lanes to rows: number `r` of lane `c` goes to `out[c · stride + r]`, for the first `count` lanes.
    /// This turns results with one element per lane into one result after the other.
    ///
    /// # Panics
    /// When there are fewer lanes or places, or rows would overlap.
    #[inline(always)]
    fn store_transposed(numbers: &[Self], count: usize, out: &mut [S], stride: usize) {
        check_transposed::<S, Self>(numbers.len(), count, out.len(), stride);
        transpose_by_element(numbers, count, out, stride);
    }

    /// Reads the first numbers of a slice. Lanes beyond its end repeat its last number, so they add no flags.
    ///
    /// # Panics
    /// When the slice is empty.
    #[inline(always)]
    fn load_ragged(values: &[S]) -> Self {
        if values.len() >= Self::LANES {
            return Self::load(values);
        }
        let last = values.len().checked_sub(1).expect("a ragged load needs one number at least");
        Self::from_fn(|lane| values[lane.min(last)].clone())
    }

    /// Writes the first lanes, as many as the slice holds.
    #[inline(always)]
    fn store_ragged(self, values: &mut [S]) {
        if values.len() >= Self::LANES {
            return self.store(values);
        }
        for (lane, value) in values.iter_mut().enumerate() {
            *value = self.extract(lane);
        }
    }
}

/// [`Lane::gather`], number by number. AVX-512 gather instructions are not faster.
#[inline(always)]
pub fn gather_by_element<S: Number, V: Lane<S>>(points: &[[S; 3]], indices: &[u32]) -> [V; 3] {
    assert!(indices.len() >= V::LANES, "{} lanes from {} indices", V::LANES, indices.len());
    // The widest register has 16 lanes.
    let mut numbers: [[S; 16]; 3] = std::array::from_fn(|_| std::array::from_fn(|_| S::from_f64(0.0)));
    for lane in 0..V::LANES {
        let point = &points[indices[lane] as usize];
        for axis in 0..3 {
            numbers[axis][lane] = point[axis].clone();
        }
    }
    [V::load(&numbers[0]), V::load(&numbers[1]), V::load(&numbers[2])]
}

/// [`Lane::store_transposed`], number by number.
#[inline(always)]
pub fn transpose_by_element<S: Number, V: Lane<S>>(numbers: &[V], count: usize, out: &mut [S], stride: usize) {
    for (row, number) in numbers.iter().enumerate() {
        for lane in 0..count {
            out[lane * stride + row] = number.extract(lane);
        }
    }
}

/// Checks the preconditions of [`Lane::store_transposed`].
#[inline(always)]
pub fn check_transposed<S: Number, V: Lane<S>>(numbers: usize, count: usize, places: usize, stride: usize) {
    assert!(count <= V::LANES, "{count} lanes of {}", V::LANES);
    assert!(numbers <= stride, "{numbers} numbers a lane do not fit a stride of {stride}");
    if count > 0 {
        assert!((count - 1) * stride + numbers <= places, "{count} rows of {numbers} numbers in {places} places");
    }
}

macro_rules! one_lane {
    ($float:ident) => {
        impl Lane<$float> for $float {
            const LANES: usize = 1;

            #[inline(always)]
            fn splat(value: $float) -> Self {
                value
            }
            #[inline(always)]
            fn load(values: &[$float]) -> Self {
                values[0]
            }
            #[inline(always)]
            fn store(self, values: &mut [$float]) {
                values[0] = self;
            }
            #[inline(always)]
            fn from_fn(mut value: impl FnMut(usize) -> $float) -> Self {
                value(0)
            }
            #[inline(always)]
            fn extract(self, lane: usize) -> $float {
                assert!(lane < 1, "lane {lane} of 1");
                self
            }
        }
    };
}

one_lane!(f64);
one_lane!(f32);
