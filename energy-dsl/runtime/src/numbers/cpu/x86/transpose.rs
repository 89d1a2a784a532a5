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

/// [`crate::Lane::store_transposed`] of single precision by squares of 8×8; the remainder goes by fours.
///
/// # Safety
/// There must be (count − 1) · stride + numbers places.
#[inline(always)]
pub unsafe fn store_8_single(numbers: &[Lanes<__m256>], count: usize, out: &mut [f32], stride: usize) {
    let (squares, rest) = numbers.as_chunks::<8>();
    let places = out.as_mut_ptr();
    for (square, first) in squares.iter().zip((0..).step_by(8)) {
        let [a, b, c, d, e, f, g, h] = *square;
        // SAFETY: registers exist where the features were detected.
        let (low, high) = unsafe { (fours_8([a.0, b.0, c.0, d.0]), fours_8([e.0, f.0, g.0, h.0])) };
        for lane in 0..8 {
            if lane == count {
                break;
            }
            let [low, high] = [low[lane % 4], high[lane % 4]];
            // SAFETY: there are places for the lane's numbers.
            unsafe {
                let row = if lane < 4 {
                    _mm256_permute2f128_ps::<0x20>(low, high)
                } else {
                    _mm256_permute2f128_ps::<0x31>(low, high)
                };
                _mm256_storeu_ps(places.add(lane * stride + first), row);
            }
        }
    }
    for (four, first) in rest.chunks(4).zip((8 * squares.len()..).step_by(4)) {
        let mut rows = [four[0].0; 4];
        for i in 0..4 {
            rows[i] = four[i.min(four.len() - 1)].0;
        }
        // SAFETY: registers exist where the features were detected.
        let columns = unsafe { fours_8(rows) };
        for lane in 0..8 {
            if lane == count {
                break;
            }
            // SAFETY: there are places for as many numbers as are written.
            unsafe {
                let column = columns[lane % 4];
                let row = if lane < 4 { _mm256_castps256_ps128(column) } else { _mm256_extractf128_ps::<1>(column) };
                _mm_maskstore_ps(places.add(lane * stride + first), first_lanes(four.len()), row);
            }
        }
    }
}

/// [`crate::Lane::store_transposed`] of single precision by squares of 16×16, the last of which may be incomplete.
///
/// # Safety
/// There must be (count − 1) · stride + numbers places.
#[inline(always)]
pub unsafe fn store_16_single(numbers: &[Lanes<__m512>], count: usize, out: &mut [f32], stride: usize) {
    let (squares, rest) = numbers.as_chunks::<16>();
    for (square, first) in squares.iter().zip((0..).step_by(16)) {
        // SAFETY: there are places for the numbers of each lane.
        unsafe { store_square(square, u16::MAX, count, out.as_mut_ptr().wrapping_add(first), stride) };
    }
    if let Some(&last) = rest.last() {
        let mut square = [last; 16];
        square[..rest.len()].copy_from_slice(rest);
        let first = 16 * squares.len();
        // SAFETY: there are places for as many numbers as the mask selects.
        unsafe {
            store_square(&square, u16::MAX >> (16 - rest.len()), count, out.as_mut_ptr().wrapping_add(first), stride);
        }
    }
}

/// Writes those of 16 numbers that a mask selects, for the first `count` lanes.
///
/// # Safety
/// Registers must exist, and from `places` on there must be (count − 1) · stride + selected places.
#[inline(always)]
unsafe fn store_square(square: &[Lanes<__m512>; 16], mask: u16, count: usize, places: *mut f32, stride: usize) {
    let mut fours = [[square[0].0; 4]; 4];
    for four in 0..4 {
        let [a, b, c, d] = [square[4 * four], square[4 * four + 1], square[4 * four + 2], square[4 * four + 3]];
        // SAFETY: registers exist.
        fours[four] = unsafe { fours_16([a.0, b.0, c.0, d.0]) };
    }
    let [a, b, c, d] = fours;
    for column in 0..4 {
        // SAFETY: registers exist.
        let rows = unsafe { quarters_single(a[column], b[column], c[column], d[column]) };
        for quarter in 0..4 {
            let lane = 4 * quarter + column;
            if lane < count {
                // SAFETY: there are places for as many numbers as are written.
                unsafe { _mm512_mask_storeu_ps(places.add(lane * stride), mask, rows[quarter]) };
            }
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
    // Without a closure: it would be compiled for processors without these registers, and called.
    let mut rows = [load_point(&points[indices[0] as usize]); 4];
    for lane in 1..4 {
        rows[lane] = load_point(&points[indices[lane] as usize]);
    }
    let [a, b, c, d] = rows;
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

/// Gathers the points of eight indices in single precision; returns x, y and z.
///
/// # Panics
/// If a point does not exist, or indices are too few.
#[inline(always)]
pub fn gather_8_single(points: &[[f32; 3]], indices: &[u32]) -> [__m256; 3] {
    let (indices, last) = (&indices[..8], last_index(points.len()));
    // SAFETY: registers exist where the features were detected, and the slice has eight indices. It is checked which
    // points are inner ones; for these, plain loads are faster than masked ones.
    unsafe {
        let numbers = _mm256_loadu_si256(indices.as_ptr().cast());
        let smaller = _mm256_min_epu32(numbers, _mm256_set1_epi32(last.wrapping_sub(1).cast_signed()));
        let are_inner = last > 0 && _mm256_movemask_epi8(_mm256_cmpeq_epi32(numbers, smaller)) == -1;
        let [a, b, c, d] = load_rows::<2>(points, indices, are_inner);
        let [x, y, z, _] = fours_8([
            _mm256_set_m128(a[1], a[0]),
            _mm256_set_m128(b[1], b[0]),
            _mm256_set_m128(c[1], c[0]),
            _mm256_set_m128(d[1], d[0]),
        ]);
        [x, y, z]
    }
}

/// Gathers the points of sixteen indices in single precision; returns x, y and z.
///
/// # Panics
/// If a point does not exist, or indices are too few.
#[inline(always)]
pub fn gather_16_single(points: &[[f32; 3]], indices: &[u32]) -> [__m512; 3] {
    let (indices, last) = (&indices[..16], last_index(points.len()));
    // SAFETY: as for eight indices.
    unsafe {
        let numbers = _mm512_loadu_si512(indices.as_ptr().cast());
        let are_inner = _mm512_cmplt_epu32_mask(numbers, _mm512_set1_epi32(last.cast_signed())) == u16::MAX;
        let [a, b, c, d] = load_rows::<4>(points, indices, are_inner);
        let [x, y, z, _] = fours_16([joined(a), joined(b), joined(c), joined(d)]);
        [x, y, z]
    }
}

/// Joins four registers to one.
#[target_feature(enable = "avx512f,avx512dq,avx512vl,avx512bw,avx2,fma")]
#[inline]
fn joined([a, b, c, d]: [__m128; 4]) -> __m512 {
    _mm512_insertf32x8::<1>(_mm512_castps256_ps512(_mm256_set_m128(b, a)), _mm256_set_m128(d, c))
}

/// Returns the index of the last of some points, or a smaller one.
#[inline(always)]
fn last_index(count: usize) -> u32 {
    u32::try_from(count.saturating_sub(1)).unwrap_or(u32::MAX)
}

/// Loads the points of 4 N indices with one more number each: number `i` in row `i % 4`.
///
/// # Safety
/// If `are_inner`, the indices are below that of the last point.
#[inline(always)]
unsafe fn load_rows<const N: usize>(points: &[[f32; 3]], indices: &[u32], are_inner: bool) -> [[__m128; N]; 4] {
    let indices = &indices[..4 * N];
    // SAFETY: registers exist where the features were detected.
    let mut rows = [[unsafe { _mm_setzero_ps() }; N]; 4];
    if are_inner {
        for (lane, &index) in indices.iter().enumerate() {
            // SAFETY: the point and the next one exist. Loads need no alignment.
            rows[lane % 4][lane / 4] = unsafe { _mm_loadu_ps(points.as_ptr().add(index as usize).cast()) };
        }
    } else {
        for (lane, &index) in indices.iter().enumerate() {
            rows[lane % 4][lane / 4] = load_single(&points[index as usize]);
        }
    }
    rows
}

/// Loads a point and a zero.
#[inline(always)]
fn load_single(point: &[f32; 3]) -> __m128 {
    // SAFETY: registers exist where the features were detected, and only the three numbers are read whose mask is
    // negative.
    unsafe { _mm_maskload_ps(point.as_ptr(), first_lanes(3)) }
}

/// Returns a mask of the first lanes of four.
#[inline(always)]
fn first_lanes(count: usize) -> __m128i {
    const LANES: [i32; 8] = [-1, -1, -1, -1, 0, 0, 0, 0];
    let lanes = &LANES[4 - count..][..4];
    // SAFETY: registers exist where the features were detected, and the slice has four numbers.
    unsafe { _mm_loadu_si128(lanes.as_ptr().cast()) }
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

/// Transposes squares of 4×4 numbers, one in each quarter of the registers.
#[target_feature(enable = "avx2,fma")]
#[inline]
fn fours_8([a, b, c, d]: [__m256; 4]) -> [__m256; 4] {
    let (ab_low, ab_high) = (_mm256_unpacklo_ps(a, b), _mm256_unpackhi_ps(a, b));
    let (cd_low, cd_high) = (_mm256_unpacklo_ps(c, d), _mm256_unpackhi_ps(c, d));
    [
        _mm256_shuffle_ps::<0x44>(ab_low, cd_low),
        _mm256_shuffle_ps::<0xee>(ab_low, cd_low),
        _mm256_shuffle_ps::<0x44>(ab_high, cd_high),
        _mm256_shuffle_ps::<0xee>(ab_high, cd_high),
    ]
}

/// Like [`fours_8`], with four quarters.
#[target_feature(enable = "avx512f,avx512dq,avx512vl,avx512bw,avx2,fma")]
#[inline]
fn fours_16([a, b, c, d]: [__m512; 4]) -> [__m512; 4] {
    let (ab_low, ab_high) = (_mm512_unpacklo_ps(a, b), _mm512_unpackhi_ps(a, b));
    let (cd_low, cd_high) = (_mm512_unpacklo_ps(c, d), _mm512_unpackhi_ps(c, d));
    [
        _mm512_shuffle_ps::<0x44>(ab_low, cd_low),
        _mm512_shuffle_ps::<0xee>(ab_low, cd_low),
        _mm512_shuffle_ps::<0x44>(ab_high, cd_high),
        _mm512_shuffle_ps::<0xee>(ab_high, cd_high),
    ]
}

/// Transposes the quarters of four registers.
#[target_feature(enable = "avx512f,avx512dq,avx512vl,avx512bw,avx2,fma")]
#[inline]
fn quarters_single(a: __m512, b: __m512, c: __m512, d: __m512) -> [__m512; 4] {
    let (ab_low, ab_high) = (_mm512_shuffle_f32x4::<0x44>(a, b), _mm512_shuffle_f32x4::<0xee>(a, b));
    let (cd_low, cd_high) = (_mm512_shuffle_f32x4::<0x44>(c, d), _mm512_shuffle_f32x4::<0xee>(c, d));
    [
        _mm512_shuffle_f32x4::<0x88>(ab_low, cd_low),
        _mm512_shuffle_f32x4::<0xdd>(ab_low, cd_low),
        _mm512_shuffle_f32x4::<0x88>(ab_high, cd_high),
        _mm512_shuffle_f32x4::<0xdd>(ab_high, cd_high),
    ]
}
