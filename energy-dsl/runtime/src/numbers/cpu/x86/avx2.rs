//! Registers of AVX2 and FMA.

use std::arch::x86_64::*;

use super::super::lanes::Lanes;
use super::super::register::Register;
use super::{intrinsics, mask, run_avx2, transpose};
use crate::numbers::lane::check_transposed;
use crate::numbers::level::Kernel;

mask!(
    Mask4(__m256d),
    none: _mm256_setzero_pd(),
    bits: |m| _mm256_movemask_pd(m).cast_unsigned(),
    from_bits: |b| {
        let one = _mm256_set_epi64x(8, 4, 2, 1);
        _mm256_castsi256_pd(_mm256_cmpeq_epi64(_mm256_and_si256(_mm256_set1_epi64x(i64::from(b)), one), one))
    },
    and: _mm256_and_pd,
    or: _mm256_or_pd,
    not: |m| _mm256_xor_pd(m, _mm256_castsi256_pd(_mm256_set1_epi32(-1)))
);

mask!(
    Mask8(__m256),
    none: _mm256_setzero_ps(),
    bits: |m| _mm256_movemask_ps(m).cast_unsigned(),
    from_bits: |b| {
        let one = _mm256_set_epi32(128, 64, 32, 16, 8, 4, 2, 1);
        _mm256_castsi256_ps(_mm256_cmpeq_epi32(_mm256_and_si256(_mm256_set1_epi32(b.cast_signed()), one), one))
    },
    and: _mm256_and_ps,
    or: _mm256_or_ps,
    not: |m| _mm256_xor_ps(m, _mm256_castsi256_ps(_mm256_set1_epi32(-1)))
);

impl Register for __m256d {
    type Scalar = f64;
    type Mask = Mask4;
    const LANES: usize = 4;

    #[inline(always)]
    fn dispatch<K: Kernel>(kernel: K) -> K::Output {
        // SAFETY: where there are lanes of the level, its features were detected.
        unsafe { run_avx2(kernel) }
    }
    #[inline(always)]
    fn load(values: &[f64]) -> Self {
        let values = &values[..4];
        // SAFETY: the slice has 4 numbers, and loads need no alignment.
        unsafe { _mm256_loadu_pd(values.as_ptr()) }
    }
    #[inline(always)]
    fn store(self, values: &mut [f64]) {
        let values = &mut values[..4];
        // SAFETY: the slice has 4 places, and stores need no alignment.
        unsafe { _mm256_storeu_pd(values.as_mut_ptr(), self) }
    }
    #[inline(always)]
    fn from_fn(value: impl FnMut(usize) -> f64) -> Self {
        <Self as Register>::load(&std::array::from_fn::<_, 4, _>(value))
    }

    #[inline(always)]
    fn store_transposed(numbers: &[Lanes<Self>], count: usize, out: &mut [f64], stride: usize) {
        check_transposed::<f64, Lanes<Self>>(numbers.len(), count, out.len(), stride);
        // SAFETY: there are as many places as was checked.
        unsafe { transpose::store_4(numbers, count, out, stride) };
    }
    #[inline(always)]
    fn gather(points: &[[f64; 3]], indices: &[u32]) -> [Self; 3] {
        transpose::gather_4(points, indices)
    }

    intrinsics! {
        fn splat(value: f64) -> Self = _mm256_set1_pd(value);
        fn add(a: Self, b: Self) -> Self = _mm256_add_pd(a, b);
        fn sub(a: Self, b: Self) -> Self = _mm256_sub_pd(a, b);
        fn mul(a: Self, b: Self) -> Self = _mm256_mul_pd(a, b);
        fn div(a: Self, b: Self) -> Self = _mm256_div_pd(a, b);
        fn sqrt(a: Self) -> Self = _mm256_sqrt_pd(a);
        fn fused(a: Self, b: Self, c: Self) -> Self = _mm256_fmadd_pd(a, b, c);
        fn min(a: Self, b: Self) -> Self = _mm256_min_pd(a, b);
        fn max(a: Self, b: Self) -> Self = _mm256_max_pd(a, b);
        fn less(a: Self, b: Self) -> Mask4 = Mask4(_mm256_cmp_pd::<_CMP_LT_OQ>(a, b));
        fn less_or_equal(a: Self, b: Self) -> Mask4 = Mask4(_mm256_cmp_pd::<_CMP_LE_OQ>(a, b));
        fn equal(a: Self, b: Self) -> Mask4 = Mask4(_mm256_cmp_pd::<_CMP_EQ_OQ>(a, b));
        fn select(mask: Mask4, yes: Self, no: Self) -> Self = _mm256_blendv_pd(no, yes, mask.0);
        fn and(a: Self, b: Self) -> Self = _mm256_and_pd(a, b);
        fn or(a: Self, b: Self) -> Self = _mm256_or_pd(a, b);
        fn xor(a: Self, b: Self) -> Self = _mm256_xor_pd(a, b);
        fn add_bits(a: Self, b: Self) -> Self =
            _mm256_castsi256_pd(_mm256_add_epi64(_mm256_castpd_si256(a), _mm256_castpd_si256(b)));
        fn sub_bits(a: Self, b: Self) -> Self =
            _mm256_castsi256_pd(_mm256_sub_epi64(_mm256_castpd_si256(a), _mm256_castpd_si256(b)));
        fn low_bits_to_exponent(a: Self) -> Self = _mm256_castsi256_pd(_mm256_slli_epi64::<52>(_mm256_castpd_si256(a)));
        fn exponent_to_low_bits(a: Self) -> Self = _mm256_castsi256_pd(_mm256_srli_epi64::<52>(_mm256_castpd_si256(a)));
        fn bit_1_to_sign(a: Self) -> Self =
            _mm256_castsi256_pd(_mm256_slli_epi64::<63>(_mm256_srli_epi64::<1>(_mm256_castpd_si256(a))));
    }
}

impl Register for __m256 {
    type Scalar = f32;
    type Mask = Mask8;
    const LANES: usize = 8;

    #[inline(always)]
    fn dispatch<K: Kernel>(kernel: K) -> K::Output {
        // SAFETY: where there are lanes of the level, its features were detected.
        unsafe { run_avx2(kernel) }
    }
    #[inline(always)]
    fn load(values: &[f32]) -> Self {
        let values = &values[..8];
        // SAFETY: the slice has 8 numbers, and loads need no alignment.
        unsafe { _mm256_loadu_ps(values.as_ptr()) }
    }
    #[inline(always)]
    fn store(self, values: &mut [f32]) {
        let values = &mut values[..8];
        // SAFETY: the slice has 8 places, and stores need no alignment.
        unsafe { _mm256_storeu_ps(values.as_mut_ptr(), self) }
    }
    #[inline(always)]
    fn from_fn(value: impl FnMut(usize) -> f32) -> Self {
        <Self as Register>::load(&std::array::from_fn::<_, 8, _>(value))
    }

    #[inline(always)]
    fn store_transposed(numbers: &[Lanes<Self>], count: usize, out: &mut [f32], stride: usize) {
        check_transposed::<f32, Lanes<Self>>(numbers.len(), count, out.len(), stride);
        // SAFETY: there are as many places as was checked.
        unsafe { transpose::store_8_single(numbers, count, out, stride) };
    }
    #[inline(always)]
    fn gather(points: &[[f32; 3]], indices: &[u32]) -> [Self; 3] {
        transpose::gather_8_single(points, indices)
    }

    intrinsics! {
        fn splat(value: f32) -> Self = _mm256_set1_ps(value);
        fn add(a: Self, b: Self) -> Self = _mm256_add_ps(a, b);
        fn sub(a: Self, b: Self) -> Self = _mm256_sub_ps(a, b);
        fn mul(a: Self, b: Self) -> Self = _mm256_mul_ps(a, b);
        fn div(a: Self, b: Self) -> Self = _mm256_div_ps(a, b);
        fn sqrt(a: Self) -> Self = _mm256_sqrt_ps(a);
        fn fused(a: Self, b: Self, c: Self) -> Self = _mm256_fmadd_ps(a, b, c);
        fn min(a: Self, b: Self) -> Self = _mm256_min_ps(a, b);
        fn max(a: Self, b: Self) -> Self = _mm256_max_ps(a, b);
        fn less(a: Self, b: Self) -> Mask8 = Mask8(_mm256_cmp_ps::<_CMP_LT_OQ>(a, b));
        fn less_or_equal(a: Self, b: Self) -> Mask8 = Mask8(_mm256_cmp_ps::<_CMP_LE_OQ>(a, b));
        fn equal(a: Self, b: Self) -> Mask8 = Mask8(_mm256_cmp_ps::<_CMP_EQ_OQ>(a, b));
        fn select(mask: Mask8, yes: Self, no: Self) -> Self = _mm256_blendv_ps(no, yes, mask.0);
        fn and(a: Self, b: Self) -> Self = _mm256_and_ps(a, b);
        fn or(a: Self, b: Self) -> Self = _mm256_or_ps(a, b);
        fn xor(a: Self, b: Self) -> Self = _mm256_xor_ps(a, b);
        fn add_bits(a: Self, b: Self) -> Self =
            _mm256_castsi256_ps(_mm256_add_epi32(_mm256_castps_si256(a), _mm256_castps_si256(b)));
        fn sub_bits(a: Self, b: Self) -> Self =
            _mm256_castsi256_ps(_mm256_sub_epi32(_mm256_castps_si256(a), _mm256_castps_si256(b)));
        fn low_bits_to_exponent(a: Self) -> Self = _mm256_castsi256_ps(_mm256_slli_epi32::<23>(_mm256_castps_si256(a)));
        fn exponent_to_low_bits(a: Self) -> Self = _mm256_castsi256_ps(_mm256_srli_epi32::<23>(_mm256_castps_si256(a)));
        fn bit_1_to_sign(a: Self) -> Self =
            _mm256_castsi256_ps(_mm256_slli_epi32::<31>(_mm256_srli_epi32::<1>(_mm256_castps_si256(a))));
    }
}
