/* Reduction of angles from 2^16 on by the method of Payne and Hanek, in integers. */

/* Part 0 of a huge angle is its quadrant in the low bits, parts 1 and 2 are high and low part of the remainder. */
ENERGY_RARE float @huge_angle(float angle, int part) {
    static const uint32_t words[8] = {0x0U,        0xa2f9836eU, 0x4e441529U, 0xfc2757d1U,
                                      0xf534ddc0U, 0xdb629599U, 0x3c439041U, 0xfe5163abU};
    float parts[3] = {12582912.0f, 0.0f, 0.0f};
    if (angle < @infinity()) {
        const uint32_t bits = @to_bits(angle);
        const uint64_t mantissa = (bits & 0x7fffffU) | 0x800000U;
        const uint32_t skipped = 30U + (bits >> 23) - 150U;
        uint64_t word[3], low, middle, top, size;
        uint32_t quadrant, zeros = 0U, i;
        int negative;
        float high, rest, scale, sum, error;
        for (i = 0U; i < 3U; i++) {
            const uint32_t at = skipped / 32U + i;
            word[i] = ((uint64_t)words[at] << 32 | words[at + 1U]) << (skipped % 32U) >> 32;
        }
        low = mantissa * word[2];
        middle = mantissa * word[1] + (low >> 32);
        top = mantissa * word[0] + (middle >> 32);
        top = top << 32 | (middle & 0xffffffffU);
        size = top << 2 | (low >> 30 & 3U);
        negative = (size >> 63) == 1U;
        quadrant = (uint32_t)(top >> 62) + (negative ? 1U : 0U);
        if (negative) {
            size = ~size + 1U;
        }
        while ((size & 0x8000000000000000U) == 0U && zeros < 64U) {
            size <<= 1;
            zeros++;
        }
        scale = @power_of_two(-(int32_t)zeros);
        high = @mul(@mul((float)(size >> 40), @power_of_two(-24)), scale);
        rest = @mul(@mul((float)(size >> 16 & 0xffffffU), @power_of_two(-48)), scale);
        sum = @mul(high, 1.5707964f);
        error = @add(@product_error(high, 1.5707964f),
                     @add(@mul(high, -4.371139e-8f), @mul(rest, 1.5707964f)));
        high = @add(sum, error);
        rest = @add(@sub(sum, high), error);
        parts[0] = @add(parts[0], (float)quadrant);
        parts[1] = negative ? -high : high;
        parts[2] = negative ? -rest : rest;
    } else {
        parts[1] = parts[2] = @from_bits(0x7fc00000U);
    }
    return parts[part];
}
