//! Reduction of angles of any size by the method of Payne and Hanek. Of the product with 2/π, only the bits around the
//! binary point are computed, in integers.

use super::{Bits, Format, fast_sum};
use crate::numbers::cpu::Scalar;
use crate::numbers::level::Baseline;
use crate::numbers::real::Mask;

/// The leading bits of 2/π.
const TWO_OVER_PI: [u64; 20] = [
    0xa2f9836e4e441529,
    0xfc2757d1f534ddc0,
    0xdb6295993c439041,
    0xfe5163abdebbc561,
    0xb7246e3a424dd2e0,
    0x06492eea09d1921c,
    0xfe1deb1cb129a73e,
    0xe88235f52ebb4484,
    0xe99c7026b45f7e41,
    0x3991d639835339f4,
    0x9c845f8bbdf9283b,
    0x1ff897ffde05980f,
    0xef2f118b5a0a6d1f,
    0x6d367ecf27cb09b7,
    0x4f463f669e5fea2d,
    0x7527bac7ebe5f17b,
    0x3d0739f78a5292ea,
    0x6bfb5fb11f8d5d08,
    0x56033046fc7b6bab,
    0xf0cfbc209af4361d,
];

/// π/2 in two parts.
const HALF_PI: (f64, f64) = (std::f64::consts::FRAC_PI_2, 6.123233995736766e-17);

/// The leading bits of 2/π, after 32 zeros.
const TWO_OVER_PI_SINGLE: [u32; 8] =
    [0, 0xa2f9836e, 0x4e441529, 0xfc2757d1, 0xf534ddc0, 0xdb629599, 0x3c439041, 0xfe5163ab];

/// π/2 in two parts.
const HALF_PI_SINGLE: (f32, f32) = (std::f32::consts::FRAC_PI_2, -4.371_139e-8);

/// Replaces quadrants and remainders in the marked lanes.
#[inline(always)]
pub fn reduced<D: Bits>(x: D, huge: D::Mask, reduced: [D; 3]) -> [D; 3] {
    // The widest register has 16 lanes.
    let (mut angles, mut parts) = ([D::Format::default(); 16], [[D::Format::default(); 16]; 3]);
    x.store(&mut angles);
    for (part, of) in parts.iter_mut().zip(reduced) {
        of.store(part);
    }
    reduce(&angles[..D::LANES], huge.bits(), &mut parts);
    parts.map(|part| D::load(&part))
}

/// Reduces the marked angles. Writes the quadrant (in the low bits), and the high and low part of the remainder.
#[cold]
#[inline(never)]
fn reduce<S: Format>(angles: &[S], marked: u32, parts: &mut [[S; 16]; 3]) {
    for (lane, &angle) in angles.iter().enumerate().filter(|(lane, _)| marked >> lane & 1 != 0) {
        let nan = S::from_f64(f64::NAN);
        let reduced = if angle < S::INFINITY { angle.reduce_huge() } else { [S::ROUND, nan, nan] };
        for (part, number) in parts.iter_mut().zip(reduced) {
            part[lane] = number;
        }
    }
}

/// Reduces an angle of at least 2²⁰.
pub fn reduce_double(angle: f64) -> [f64; 3] {
    // angle = mantissa · 2^exponent
    let mantissa = (angle.to_bits() & ((1 << 52) - 1)) | 1 << 52;
    let exponent = (angle.to_bits() >> 52) as i32 - 1075;
    // Skips bits of 2/π whose products are multiples of 4, and uses the 192 bits after them.
    let (skipped, shift) = ((exponent - 2).max(0) as usize, (2 - exponent).max(0) as u32);
    let word = |i: usize| {
        let (word, bit) = (skipped / 64 + i, skipped % 64);
        if bit == 0 { TWO_OVER_PI[word] } else { TWO_OVER_PI[word] << bit | TWO_OVER_PI[word + 1] >> (64 - bit) }
    };
    // The product modulo 2^192, shifted so that 2^190 represents 1. Shifts are below 64.
    let mut product = [0u64; 4];
    let mut carry = 0u128;
    for i in 0..3 {
        let sum = u128::from(mantissa) * u128::from(word(2 - i)) + carry;
        product[i] = sum as u64;
        carry = sum >> 64;
    }
    product[3] = carry as u64;
    let shifted = |i: usize| if shift == 0 { product[i] } else { product[i] >> shift | product[i + 1] << (64 - shift) };
    let [mut low, mut middle, mut top] = [shifted(0), shifted(1), shifted(2)];
    let mut quadrant = (top >> 62) as u8;
    // The fraction, with its binary point before the first bit. From one half on it counts back from the next quadrant.
    let negative = top >> 61 & 1 == 1;
    top = top << 2 | middle >> 62;
    middle = middle << 2 | low >> 62;
    low <<= 2;
    if negative {
        quadrant = (quadrant + 1) & 3;
        // Two's complement, except for the last bit, which does not matter.
        (top, middle, low) = (!top, !middle, !low);
    }
    // At most about 62 bits cancel, so 128 bits from the first set bit suffice.
    let zeros = if top != 0 { top.leading_zeros() } else { 64 + middle.leading_zeros() };
    let fraction = match zeros {
        0 => u128::from(top) << 64 | u128::from(middle),
        1..64 => (u128::from(top) << 64 | u128::from(middle)) << zeros | u128::from(low) >> (64 - zeros),
        _ => (u128::from(middle) << 64 | u128::from(low)) << (zeros - 64),
    };
    let scale = f64::power_of_two(-(zeros as i32));
    let high = (fraction >> 75) as f64 * f64::power_of_two(-53) * scale;
    let rest = (fraction & ((1 << 75) - 1)) as f64 * f64::power_of_two(-128) * scale;
    let sign = if negative { -1.0 } else { 1.0 };
    let (high, low) = times(high, rest, HALF_PI);
    [f64::ROUND + f64::from(quadrant), sign * high, sign * low]
}

/// Returns the product of two numbers in two parts each. Split without fused operations, so that it is the same at
/// every level.
fn times<S: Format>(high: S, low: S, factor: (S, S)) -> (S, S) {
    let product = high * factor.0;
    let error = high.product_error::<Baseline>(factor.0) + (high * factor.1 + low * factor.0);
    fast_sum(product, error)
}

/// Reduces an angle of at least 2¹⁶.
pub fn reduce_single(angle: f32) -> [f32; 3] {
    let (quadrant, fraction) = single_quadrant(angle);
    // At most about 30 bits cancel, so the fraction is known to 34 bits at least.
    let (size, sign) = (fraction.unsigned_abs(), if fraction < 0 { -1.0 } else { 1.0 });
    let zeros = size.leading_zeros();
    let scale = f32::power_of_two(-(zeros as i32));
    let high = ((size << zeros) >> 40) as f32 * f32::power_of_two(-24) * scale;
    let rest = ((size << zeros) >> 16 & 0xff_ffff) as f32 * f32::power_of_two(-48) * scale;
    let (high, low) = times(high, rest, HALF_PI_SINGLE);
    [f32::ROUND + f32::from(quadrant), sign * high, sign * low]
}

/// Returns the nearest multiple of π/2 modulo 4, and the remainder as a multiple of 2^−64 π/2.
fn single_quadrant(angle: f32) -> (u8, i64) {
    // angle = mantissa · 2^exponent
    let mantissa = u64::from((angle.to_bits() & ((1 << 23) - 1)) | 1 << 23);
    let exponent = (angle.to_bits() >> 23).cast_signed() - 150;
    // Skips the zeros and the bits of 2/π whose products are multiples of 4, and uses the 96 bits after them.
    let skipped = (32 + exponent - 2).cast_unsigned();
    let word = |i: u32| {
        let at = (skipped / 32 + i) as usize;
        let words = u64::from(TWO_OVER_PI_SINGLE[at]) << 32 | u64::from(TWO_OVER_PI_SINGLE[at + 1]);
        words << (skipped % 32) >> 32
    };
    // The product modulo 2^96, of which 2^94 represents 1.
    let low = mantissa * word(2);
    let middle = mantissa * word(1) + (low >> 32);
    let top = mantissa * word(0) + (middle >> 32);
    let leading = top << 32 | middle & 0xffff_ffff;
    // From one half on, the fraction is negative and counts back from the next quadrant.
    let fraction = (leading << 2 | low >> 30 & 3).cast_signed();
    ((leading >> 62) as u8 + u8::from(fraction < 0), fraction)
}
