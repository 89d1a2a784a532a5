//! Sums of products of 3×3 blocks in one AVX-512 register.

use std::arch::x86_64::*;

use crate::numbers::block_sum::{BLOCK_NUMBERS, BlockSum};

/// Products of entries, row by row, in the first nine lanes: one load and one operation per block. The other lanes are
/// unused.
#[derive(Clone, Copy, Debug)]
pub struct Nine(__m512);

impl BlockSum<f32> for Nine {
    #[inline(always)]
    fn zero() -> Self {
        // SAFETY: registers exist where the features were detected.
        unsafe { Self(_mm512_setzero_ps()) }
    }

    #[inline(always)]
    fn add(&mut self, block: &[f32; BLOCK_NUMBERS], v: &[f32; 4]) {
        // SAFETY: as above, and there are as many numbers as are loaded.
        unsafe {
            let factors = chosen([0, 1, 2, 0, 1, 2, 0, 1, 2], _mm512_zextps128_ps512(_mm_loadu_ps(v.as_ptr())));
            self.0 = _mm512_fmadd_ps(_mm512_loadu_ps(block.as_ptr()), factors, self.0);
        }
    }

    #[inline(always)]
    fn total(self) -> [f32; 4] {
        let mut total = [0.0; 4];
        let [a, b, c] = columns(self.0);
        // SAFETY: as above, and there are four places.
        unsafe {
            _mm_storeu_ps(total.as_mut_ptr(), _mm_add_ps(a, _mm_add_ps(b, c)));
        }
        total
    }

    #[inline(always)]
    fn less(mut u: [f32; 4], block: &[f32; BLOCK_NUMBERS], v: &[f32; 4]) -> [f32; 4] {
        // SAFETY: as above, and there are as many numbers as are loaded and stored.
        unsafe {
            let columns = columns(_mm512_loadu_ps(block.as_ptr()));
            let mut less = _mm_loadu_ps(u.as_ptr());
            for column in 0..3 {
                less = _mm_fnmadd_ps(columns[column], _mm_set1_ps(v[column]), less);
            }
            _mm_storeu_ps(u.as_mut_ptr(), less);
        }
        u
    }
}

/// Returns the columns of a block that is stored row by row, each with an unused fourth number.
#[inline(always)]
fn columns(block: __m512) -> [__m128; 3] {
    // SAFETY: registers exist where the features were detected.
    unsafe {
        [
            _mm512_castps512_ps128(chosen([0, 3, 6, 15, 0, 0, 0, 0, 0], block)),
            _mm512_castps512_ps128(chosen([1, 4, 7, 15, 0, 0, 0, 0, 0], block)),
            _mm512_castps512_ps128(chosen([2, 5, 8, 15, 0, 0, 0, 0, 0], block)),
        ]
    }
}

/// Permutes lanes: lane i becomes the i-th of these.
#[inline(always)]
fn chosen([a, b, c, d, e, f, g, h, i]: [i32; 9], lanes: __m512) -> __m512 {
    // SAFETY: registers exist where the features were detected.
    unsafe { _mm512_permutexvar_ps(_mm512_setr_epi32(a, b, c, d, e, f, g, h, i, 0, 0, 0, 0, 0, 0, 0), lanes) }
}
