//! Lanes written as rows.

use std::arch::x86_64::*;

use super::super::lanes::Lanes;

/// [`super::super::Lane::store_transposed`] by squares of 4×4. Its conditions were checked.
#[inline(always)]
pub fn avx2(numbers: &[Lanes<__m256d>], count: usize, out: &mut [f64], stride: usize) {
    for (chunk, first) in numbers.chunks(4).zip((0..).step_by(4)) {
        let mut rows = [chunk[0].0; 4];
        for i in 0..4 {
            rows[i] = chunk[i.min(chunk.len() - 1)].0;
        }
        // SAFETY: registers exist where the features were detected.
        let columns = unsafe { transpose_4(rows) };
        // All lanes are asked for, so that the loop is unrolled and columns stay in registers.
        for lane in 0..4 {
            if lane == count {
                break;
            }
            let place = &mut out[lane * stride + first..][..chunk.len()];
            if chunk.len() == 4 {
                // SAFETY: the place has four numbers.
                unsafe { _mm256_storeu_pd(place.as_mut_ptr(), columns[lane]) };
            } else {
                // SAFETY: only as many numbers are written as the place has: those whose mask is negative.
                unsafe {
                    let end = _mm256_set1_epi64x(chunk.len() as i64);
                    let mask = _mm256_cmpgt_epi64(end, _mm256_set_epi64x(3, 2, 1, 0));
                    _mm256_maskstore_pd(place.as_mut_ptr(), mask, columns[lane]);
                }
            }
        }
    }
}

/// [`super::super::Lane::store_transposed`] by squares of 8×8. Its conditions were checked.
#[inline(always)]
pub fn avx512(numbers: &[Lanes<__m512d>], count: usize, out: &mut [f64], stride: usize) {
    for (chunk, first) in numbers.chunks(8).zip((0..).step_by(8)) {
        let mut rows = [chunk[0].0; 8];
        for i in 0..8 {
            rows[i] = chunk[i.min(chunk.len() - 1)].0;
        }
        // SAFETY: registers exist where the features were detected.
        let columns = unsafe { transpose_8(rows) };
        let mask = u8::MAX >> (8 - chunk.len());
        for lane in 0..8 {
            if lane == count {
                break;
            }
            let place = &mut out[lane * stride + first..][..chunk.len()];
            // SAFETY: only as many numbers are written as the place has.
            unsafe { _mm512_mask_storeu_pd(place.as_mut_ptr(), mask, columns[lane]) };
        }
    }
}

#[target_feature(enable = "avx2,fma")]
#[inline]
fn transpose_4([a, b, c, d]: [__m256d; 4]) -> [__m256d; 4] {
    let (ab_even, ab_odd) = (_mm256_unpacklo_pd(a, b), _mm256_unpackhi_pd(a, b));
    let (cd_even, cd_odd) = (_mm256_unpacklo_pd(c, d), _mm256_unpackhi_pd(c, d));
    [
        _mm256_permute2f128_pd::<0x20>(ab_even, cd_even),
        _mm256_permute2f128_pd::<0x20>(ab_odd, cd_odd),
        _mm256_permute2f128_pd::<0x31>(ab_even, cd_even),
        _mm256_permute2f128_pd::<0x31>(ab_odd, cd_odd),
    ]
}

#[target_feature(enable = "avx512f,avx512dq,avx512vl,avx512bw,avx2,fma")]
#[inline]
fn transpose_8([a, b, c, d, e, f, g, h]: [__m512d; 8]) -> [__m512d; 8] {
    // Pairs of rows, by even and odd columns; then squares of 4×4 pairs.
    let even = quarters(
        _mm512_unpacklo_pd(a, b),
        _mm512_unpacklo_pd(c, d),
        _mm512_unpacklo_pd(e, f),
        _mm512_unpacklo_pd(g, h),
    );
    let odd = quarters(
        _mm512_unpackhi_pd(a, b),
        _mm512_unpackhi_pd(c, d),
        _mm512_unpackhi_pd(e, f),
        _mm512_unpackhi_pd(g, h),
    );
    [even[0], odd[0], even[1], odd[1], even[2], odd[2], even[3], odd[3]]
}

/// The transpose of a square of 4×4 pairs of numbers.
#[target_feature(enable = "avx512f,avx512dq,avx512vl,avx512bw,avx2,fma")]
#[inline]
fn quarters(a: __m512d, b: __m512d, c: __m512d, d: __m512d) -> [__m512d; 4] {
    let (ab_low, ab_high) = (_mm512_shuffle_f64x2::<0x44>(a, b), _mm512_shuffle_f64x2::<0xee>(a, b));
    let (cd_low, cd_high) = (_mm512_shuffle_f64x2::<0x44>(c, d), _mm512_shuffle_f64x2::<0xee>(c, d));
    [
        _mm512_shuffle_f64x2::<0x88>(ab_low, cd_low),
        _mm512_shuffle_f64x2::<0xdd>(ab_low, cd_low),
        _mm512_shuffle_f64x2::<0x88>(ab_high, cd_high),
        _mm512_shuffle_f64x2::<0xdd>(ab_high, cd_high),
    ]
}
