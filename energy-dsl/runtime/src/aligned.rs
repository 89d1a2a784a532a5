use std::ops::{Deref, DerefMut};

/// Bytes of the widest register, and of a cache line.
const LINE: usize = 64;

/// A slice that starts at a cache line. A register that straddles two cache lines takes two loads.
///
/// ```
/// use energy_runtime::Aligned;
/// let mut numbers = Aligned::new(100, 0.0);
/// numbers[99] = 1.0;
/// assert_eq!(numbers.as_ptr() as usize % 64, 0);
/// assert_eq!(numbers.clone()[99], 1.0);
/// ```
#[derive(Debug)]
pub struct Aligned<S> {
    /// Padding up to the cache line, then the numbers.
    numbers: Vec<S>,
    start: usize,
}

impl<S: Clone> Aligned<S> {
    /// Creates `count` copies of `number`.
    #[must_use]
    pub fn new(count: usize, number: S) -> Self {
        let spare = LINE / size_of::<S>().max(1);
        let mut numbers: Vec<S> = Vec::with_capacity(count + spare);
        let start = numbers.as_ptr().align_offset(LINE).min(spare);
        numbers.resize(start + count, number);
        Self { numbers, start }
    }
}

impl<S> Deref for Aligned<S> {
    type Target = [S];

    #[inline]
    fn deref(&self) -> &[S] {
        &self.numbers[self.start..]
    }
}

impl<S> DerefMut for Aligned<S> {
    #[inline]
    fn deref_mut(&mut self) -> &mut [S] {
        &mut self.numbers[self.start..]
    }
}

impl<S: Clone> From<&[S]> for Aligned<S> {
    fn from(numbers: &[S]) -> Self {
        let Some(first) = numbers.first() else { return Self { numbers: Vec::new(), start: 0 } };
        let mut aligned = Self::new(numbers.len(), first.clone());
        aligned.clone_from_slice(numbers);
        aligned
    }
}

impl<S: Clone> Clone for Aligned<S> {
    fn clone(&self) -> Self {
        Self::from(&**self)
    }
}

#[cfg(test)]
mod tests {
    use super::Aligned;

    fn starts_at_a_line<S: Copy + PartialEq + std::fmt::Debug>(number: S) {
        for count in 0..100 {
            let all = Aligned::new(count, number);
            assert_eq!(*all, vec![number; count]);
            assert!(count == 0 || [&all, &all.clone()].iter().all(|all| all.as_ptr().align_offset(64) == 0));
        }
    }

    #[test]
    fn numbers_start_at_a_cache_line() {
        starts_at_a_line(1.0_f64);
        starts_at_a_line(1.0_f32);
        starts_at_a_line(1_u8);
    }
}
