/* Reduction of angles from 2^20 on by the method of Payne and Hanek, in integers. */

/* The 64 bits of 2/pi from bit `first` on. */
ENERGY_RARE uint64_t @word_of_two_over_pi(uint32_t first) {
    static const uint64_t words[20] = {
        0xa2f9836e4e441529U, 0xfc2757d1f534ddc0U, 0xdb6295993c439041U, 0xfe5163abdebbc561U, 0xb7246e3a424dd2e0U,
        0x06492eea09d1921cU, 0xfe1deb1cb129a73eU, 0xe88235f52ebb4484U, 0xe99c7026b45f7e41U, 0x3991d639835339f4U,
        0x9c845f8bbdf9283bU, 0x1ff897ffde05980fU, 0xef2f118b5a0a6d1fU, 0x6d367ecf27cb09b7U, 0x4f463f669e5fea2dU,
        0x7527bac7ebe5f17bU, 0x3d0739f78a5292eaU, 0x6bfb5fb11f8d5d08U, 0x56033046fc7b6babU, 0xf0cfbc209af4361dU};
    const uint32_t word = first / 64U, bit = first % 64U;
    return bit == 0U ? words[word] : words[word] << bit | words[word + 1U] >> (64U - bit);
}

/* The upper 64 bits of a b + carry; the lower ones go to `low`. */
ENERGY_FN uint64_t @long_product(uint64_t a, uint64_t b, uint64_t carry, uint64_t *low) {
    const uint64_t mask = 0xffffffffU, a0 = a & mask, a1 = a >> 32, b0 = b & mask, b1 = b >> 32;
    const uint64_t p0 = a0 * b0 + (carry & mask);
    const uint64_t p1 = a1 * b0 + (p0 >> 32) + (carry >> 32);
    const uint64_t p2 = a0 * b1 + (p1 & mask);
    *low = p2 << 32 | (p0 & mask);
    return a1 * b1 + (p1 >> 32) + (p2 >> 32);
}

/* The number high 2^64 + low, rounded to a double; `high` is below 2^11. */
ENERGY_FN double @rounded_long(uint64_t high, uint64_t low) {
    uint64_t top = low;
    double scale = 1.0;
    while (high != 0U) {
        top = high << 63 | top >> 1 | (top & 1U);
        high >>= 1;
        scale += scale;
    }
    return (double)top * scale;
}

/* Part 0 of a huge angle is its quadrant in the low bits, parts 1 and 2 are high and low part of the remainder. */
ENERGY_RARE double @huge_angle(double angle, int part) {
    double parts[3] = {6755399441055744.0, 0.0, 0.0};
    if (angle < @infinity()) {
        const uint64_t bits = @to_bits(angle);
        const uint64_t mantissa = (bits & 0xfffffffffffffU) | 0x10000000000000U;
        const int32_t exponent = (int32_t)(bits >> 52) - 1075;
        const uint32_t skipped = exponent > 2 ? (uint32_t)(exponent - 2) : 0U;
        const uint32_t shift = exponent < 2 ? (uint32_t)(2 - exponent) : 0U;
        uint64_t product[4], carry = 0U, top, middle, low, high_bits, low_bits;
        uint32_t quadrant, zeros = 0U, i;
        int negative;
        double high, rest, scale, sum, error;
        for (i = 0U; i < 3U; i++) {
            carry = @long_product(mantissa, @word_of_two_over_pi(skipped + 64U * (2U - i)), carry, &product[i]);
        }
        product[3] = carry;
        low = shift == 0U ? product[0] : product[0] >> shift | product[1] << (64U - shift);
        middle = shift == 0U ? product[1] : product[1] >> shift | product[2] << (64U - shift);
        top = shift == 0U ? product[2] : product[2] >> shift | product[3] << (64U - shift);
        quadrant = (uint32_t)(top >> 62);
        negative = (top >> 61 & 1U) == 1U;
        top = top << 2 | middle >> 62;
        middle = middle << 2 | low >> 62;
        low <<= 2;
        if (negative) {
            quadrant = (quadrant + 1U) & 3U;
            top = ~top;
            middle = ~middle;
            low = ~low;
        }
        /* At most about 62 bits cancel, so 128 bits from the first set bit suffice. */
        if (top == 0U) {
            top = middle;
            middle = low;
            low = 0U;
            zeros = 64U;
        }
        while ((top & 0x8000000000000000U) == 0U && zeros < 192U) {
            top = top << 1 | middle >> 63;
            middle = middle << 1 | low >> 63;
            low <<= 1;
            zeros++;
        }
        high_bits = top >> 11;
        low_bits = middle;
        scale = @power_of_two(-(int32_t)zeros);
        high = @mul(@mul((double)high_bits, @power_of_two(-53)), scale);
        rest = @mul(@mul(@rounded_long(top & 0x7ffU, low_bits), @power_of_two(-128)), scale);
        sum = @mul(high, 1.5707963267948966);
        error = @add(@product_error(high, 1.5707963267948966),
                     @add(@mul(high, 6.123233995736766e-17), @mul(rest, 1.5707963267948966)));
        high = @add(sum, error);
        rest = @add(@sub(sum, high), error);
        parts[0] = @add(parts[0], (double)quadrant);
        parts[1] = negative ? -high : high;
        parts[2] = negative ? -rest : rest;
    } else {
        parts[1] = parts[2] = @from_bits(0x7ff8000000000000U);
    }
    return parts[part];
}
