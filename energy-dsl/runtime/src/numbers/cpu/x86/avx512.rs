//! Registers of AVX-512.

use std::arch::x86_64::*;

use super::super::lanes::Lanes;
use super::super::register::Register;
use super::{intrinsics, mask, run_avx512, transpose};
use crate::numbers::lane::check_transposed;
use crate::numbers::level::Kernel;

mask!(
    Mask8(__mmask8), none: 0, bits: |m| u32::from(m), from_bits: |b| b as _,
    and: |a, b| a & b, or: |a, b| a | b, not: |m: __mmask8| !m
);

mask!(
    Mask16(__mmask16), none: 0, bits: |m| u32::from(m), from_bits: |b| b as _,
    and: |a, b| a & b, or: |a, b| a | b, not: |m: __mmask16| !m
);

impl Register for __m512d {
    type Scalar = f64;
    type Mask = Mask8;
    const LANES: usize = 8;

    #[inline(always)]
    fn dispatch<K: Kernel>(kernel: K) -> K::Output {
        // SAFETY: where there are lanes of the level, its features were detected.
        unsafe { run_avx512(kernel) }
    }
    #[inline(always)]
    fn load(values: &[f64]) -> Self {
        let values = &values[..8];
        // SAFETY: the slice has 8 numbers, and loads need no alignment.
        unsafe { _mm512_loadu_pd(values.as_ptr()) }
    }
    #[inline(always)]
    fn store(self, values: &mut [f64]) {
        let values = &mut values[..8];
        // SAFETY: the slice has 8 places, and stores need no alignment.
        unsafe { _mm512_storeu_pd(values.as_mut_ptr(), self) }
    }
    #[inline(always)]
    fn from_fn(value: impl FnMut(usize) -> f64) -> Self {
        <Self as Register>::load(&std::array::from_fn::<_, 8, _>(value))
    }

    #[inline(always)]
    fn store_transposed(numbers: &[Lanes<Self>], count: usize, out: &mut [f64], stride: usize) {
        check_transposed::<f64, Lanes<Self>>(numbers.len(), count, out.len(), stride);
        // SAFETY: there are as many places as was checked.
        unsafe { transpose::store_8(numbers, count, out, stride) };
    }
    #[inline(always)]
    fn gather(points: &[[f64; 3]], indices: &[u32]) -> [Self; 3] {
        transpose::gather_8(points, indices)
    }

    intrinsics! {
        fn splat(value: f64) -> Self = _mm512_set1_pd(value);
        fn add(a: Self, b: Self) -> Self = _mm512_add_pd(a, b);
        fn sub(a: Self, b: Self) -> Self = _mm512_sub_pd(a, b);
        fn mul(a: Self, b: Self) -> Self = _mm512_mul_pd(a, b);
        fn div(a: Self, b: Self) -> Self = _mm512_div_pd(a, b);
        fn sqrt(a: Self) -> Self = _mm512_sqrt_pd(a);
        fn fused(a: Self, b: Self, c: Self) -> Self = _mm512_fmadd_pd(a, b, c);
        fn min(a: Self, b: Self) -> Self = _mm512_min_pd(a, b);
        fn max(a: Self, b: Self) -> Self = _mm512_max_pd(a, b);
        fn less(a: Self, b: Self) -> Mask8 = Mask8(_mm512_cmp_pd_mask::<_CMP_LT_OQ>(a, b));
        fn less_or_equal(a: Self, b: Self) -> Mask8 = Mask8(_mm512_cmp_pd_mask::<_CMP_LE_OQ>(a, b));
        fn equal(a: Self, b: Self) -> Mask8 = Mask8(_mm512_cmp_pd_mask::<_CMP_EQ_OQ>(a, b));
        fn select(mask: Mask8, yes: Self, no: Self) -> Self = _mm512_mask_blend_pd(mask.0, no, yes);
        fn and(a: Self, b: Self) -> Self = _mm512_and_pd(a, b);
        fn or(a: Self, b: Self) -> Self = _mm512_or_pd(a, b);
        fn xor(a: Self, b: Self) -> Self = _mm512_xor_pd(a, b);
        fn add_bits(a: Self, b: Self) -> Self =
            _mm512_castsi512_pd(_mm512_add_epi64(_mm512_castpd_si512(a), _mm512_castpd_si512(b)));
        fn sub_bits(a: Self, b: Self) -> Self =
            _mm512_castsi512_pd(_mm512_sub_epi64(_mm512_castpd_si512(a), _mm512_castpd_si512(b)));
        fn low_bits_to_exponent(a: Self) -> Self = _mm512_castsi512_pd(_mm512_slli_epi64::<52>(_mm512_castpd_si512(a)));
        fn exponent_to_low_bits(a: Self) -> Self = _mm512_castsi512_pd(_mm512_srli_epi64::<52>(_mm512_castpd_si512(a)));
        fn bit_1_to_sign(a: Self) -> Self =
            _mm512_castsi512_pd(_mm512_slli_epi64::<63>(_mm512_srli_epi64::<1>(_mm512_castpd_si512(a))));
    }
}

impl Register for __m512 {
    type Scalar = f32;
    type Mask = Mask16;
    const LANES: usize = 16;

    #[inline(always)]
    fn dispatch<K: Kernel>(kernel: K) -> K::Output {
        // SAFETY: where there are lanes of the level, its features were detected.
        unsafe { run_avx512(kernel) }
    }
    #[inline(always)]
    fn load(values: &[f32]) -> Self {
        let values = &values[..16];
        // SAFETY: the slice has 16 numbers, and loads need no alignment.
        unsafe { _mm512_loadu_ps(values.as_ptr()) }
    }
    #[inline(always)]
    fn store(self, values: &mut [f32]) {
        let values = &mut values[..16];
        // SAFETY: the slice has 16 places, and stores need no alignment.
        unsafe { _mm512_storeu_ps(values.as_mut_ptr(), self) }
    }
    #[inline(always)]
    fn from_fn(value: impl FnMut(usize) -> f32) -> Self {
        <Self as Register>::load(&std::array::from_fn::<_, 16, _>(value))
    }

    #[inline(always)]
    fn store_transposed(numbers: &[Lanes<Self>], count: usize, out: &mut [f32], stride: usize) {
        check_transposed::<f32, Lanes<Self>>(numbers.len(), count, out.len(), stride);
        // SAFETY: there are as many places as was checked.
        unsafe { transpose::store_16_single(numbers, count, out, stride) };
    }
    #[inline(always)]
    fn gather(points: &[[f32; 3]], indices: &[u32]) -> [Self; 3] {
        transpose::gather_16_single(points, indices)
    }

    intrinsics! {
        fn splat(value: f32) -> Self = _mm512_set1_ps(value);
        fn add(a: Self, b: Self) -> Self = _mm512_add_ps(a, b);
        fn sub(a: Self, b: Self) -> Self = _mm512_sub_ps(a, b);
        fn mul(a: Self, b: Self) -> Self = _mm512_mul_ps(a, b);
        fn div(a: Self, b: Self) -> Self = _mm512_div_ps(a, b);
        fn sqrt(a: Self) -> Self = _mm512_sqrt_ps(a);
        fn fused(a: Self, b: Self, c: Self) -> Self = _mm512_fmadd_ps(a, b, c);
        fn min(a: Self, b: Self) -> Self = _mm512_min_ps(a, b);
        fn max(a: Self, b: Self) -> Self = _mm512_max_ps(a, b);
        fn less(a: Self, b: Self) -> Mask16 = Mask16(_mm512_cmp_ps_mask::<_CMP_LT_OQ>(a, b));
        fn less_or_equal(a: Self, b: Self) -> Mask16 = Mask16(_mm512_cmp_ps_mask::<_CMP_LE_OQ>(a, b));
        fn equal(a: Self, b: Self) -> Mask16 = Mask16(_mm512_cmp_ps_mask::<_CMP_EQ_OQ>(a, b));
        fn select(mask: Mask16, yes: Self, no: Self) -> Self = _mm512_mask_blend_ps(mask.0, no, yes);
        fn and(a: Self, b: Self) -> Self = _mm512_and_ps(a, b);
        fn or(a: Self, b: Self) -> Self = _mm512_or_ps(a, b);
        fn xor(a: Self, b: Self) -> Self = _mm512_xor_ps(a, b);
        fn add_bits(a: Self, b: Self) -> Self =
            _mm512_castsi512_ps(_mm512_add_epi32(_mm512_castps_si512(a), _mm512_castps_si512(b)));
        fn sub_bits(a: Self, b: Self) -> Self =
            _mm512_castsi512_ps(_mm512_sub_epi32(_mm512_castps_si512(a), _mm512_castps_si512(b)));
        fn low_bits_to_exponent(a: Self) -> Self = _mm512_castsi512_ps(_mm512_slli_epi32::<23>(_mm512_castps_si512(a)));
        fn exponent_to_low_bits(a: Self) -> Self = _mm512_castsi512_ps(_mm512_srli_epi32::<23>(_mm512_castps_si512(a)));
        fn bit_1_to_sign(a: Self) -> Self =
            _mm512_castsi512_ps(_mm512_slli_epi32::<31>(_mm512_srli_epi32::<1>(_mm512_castps_si512(a))));
    }
}
