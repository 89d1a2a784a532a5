//! Transposition of lanes to rows, and gathering of points.

use std::arch::x86_64::*;

use super::super::lanes::Lanes;
use super::super::register::Register;

/// [`crate::Lane::store_transposed`] by squares of 4×4; the remainder goes number by number.
///
/// # Safety
/// There must be (count − 1) · stride + numbers places.
#[inline(always)]
pub unsafe fn store_4(numbers: &[Lanes<__m256d>], count: usize, out: &mut [f64], stride: usize) {
    let (squares, rest) = numbers.as_chunks::<4>();
    let places = out.as_mut_ptr();
    for (square, first) in squares.iter().zip((0..).step_by(4)) {
        // SAFETY: registers exist where the features were detected.
        let columns = unsafe { transpose_4(square.map(|number| number.0)) };
        // Visits all lanes, so that the loop is unrolled and the columns stay in registers.
        for lane in 0..4 {
            if lane == count {
                break;
            }
            // SAFETY: there are places for the lane's numbers.
            unsafe { _mm256_storeu_pd(places.add(lane * stride + first), columns[lane]) };
        }
    }
    store_rest(rest, 4 * squares.len(), count, out, stride);
}

/// [`crate::Lane::store_transposed`] by squares of 8×8; a small remainder goes number by number.
///
/// # Safety
/// There must be (count − 1) · stride + numbers places.
#[inline(always)]
pub unsafe fn store_8(numbers: &[Lanes<__m512d>], count: usize, out: &mut [f64], stride: usize) {
    let places = out.as_mut_ptr();
    for (chunk, first) in numbers.chunks(8).zip((0..).step_by(8)) {
        if chunk.len() < 3 {
            store_rest(chunk, first, count, out, stride);
            break;
        }
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
            // SAFETY: there are places for as many numbers as are written.
            unsafe { _mm512_mask_storeu_pd(places.add(lane * stride + first), mask, columns[lane]) };
        }
    }
}

/// Writes the last few numbers, from number `first` on.
#[inline(always)]
fn store_rest<R: Register<Scalar = f64>>(
    numbers: &[Lanes<R>],
    first: usize,
    count: usize,
    out: &mut [f64],
    stride: usize,
) {
    for (row, number) in numbers.iter().enumerate() {
        let mut lanes = [0.0; 8];
        number.0.store(&mut lanes);
        for lane in 0..R::LANES {
            if lane == count {
                break;
            }
            out[lane * stride + first + row] = lanes[lane];
        }
    }
}

/// Gathers the points of four indices; returns x, y and z. It is always inlined: a call would cost more than the work.
///
/// # Panics
/// If a point does not exist, or indices are too few.
#[inline(always)]
pub fn gather_4(points: &[[f64; 3]], indices: &[u32]) -> [__m256d; 3] {
    let indices = &indices[..4];
    let [a, b, c, d] = [0, 1, 2, 3].map(|lane| load_point(&points[indices[lane] as usize]));
    // SAFETY: registers exist where the features were detected.
    unsafe {
        let (xz_low, xz_high) = (_mm256_unpacklo_pd(a, b), _mm256_unpacklo_pd(c, d));
        let (y_low, y_high) = (_mm256_unpackhi_pd(a, b), _mm256_unpackhi_pd(c, d));
        [
            _mm256_permute2f128_pd::<0x20>(xz_low, xz_high),
            _mm256_permute2f128_pd::<0x20>(y_low, y_high),
            _mm256_permute2f128_pd::<0x31>(xz_low, xz_high),
        ]
    }
}

/// Gathers the points of eight indices; returns x, y and z.
///
/// # Panics
/// If a point does not exist, or indices are too few.
#[inline(always)]
pub fn gather_8(points: &[[f64; 3]], indices: &[u32]) -> [__m512d; 3] {
    let indices = &indices[..8];
    let mut pairs = [[load_point(&points[indices[0] as usize]); 2]; 4];
    for lane in 0..8 {
        pairs[lane % 4][lane / 4] = load_point(&points[indices[lane] as usize]);
    }
    // SAFETY: registers exist where the features were detected.
    unsafe {
        let [a, b, c, d] = [
            _mm512_insertf64x4::<1>(_mm512_castpd256_pd512(pairs[0][0]), pairs[0][1]),
            _mm512_insertf64x4::<1>(_mm512_castpd256_pd512(pairs[1][0]), pairs[1][1]),
            _mm512_insertf64x4::<1>(_mm512_castpd256_pd512(pairs[2][0]), pairs[2][1]),
            _mm512_insertf64x4::<1>(_mm512_castpd256_pd512(pairs[3][0]), pairs[3][1]),
        ];
        let (xz_low, xz_high) = (_mm512_unpacklo_pd(a, b), _mm512_unpacklo_pd(c, d));
        let (y_low, y_high) = (_mm512_unpackhi_pd(a, b), _mm512_unpackhi_pd(c, d));
        let first = _mm512_set_epi64(13, 12, 5, 4, 9, 8, 1, 0);
        let second = _mm512_set_epi64(15, 14, 7, 6, 11, 10, 3, 2);
        [
            _mm512_permutex2var_pd(xz_low, first, xz_high),
            _mm512_permutex2var_pd(y_low, first, y_high),
            _mm512_permutex2var_pd(xz_low, second, xz_high),
        ]
    }
}

/// Loads a point and a zero.
#[inline(always)]
fn load_point(point: &[f64; 3]) -> __m256d {
    // SAFETY: registers exist where the features were detected, and only the three numbers are read whose mask is
    // negative.
    unsafe { _mm256_maskload_pd(point.as_ptr(), _mm256_set_epi64x(0, -1, -1, -1)) }
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
    // Transposes pairs of rows by even and odd columns, then squares of 4×4 pairs.
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

/// Transposes a square of 4×4 pairs of numbers.
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
