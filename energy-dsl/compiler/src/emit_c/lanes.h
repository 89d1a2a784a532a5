/* Vectors of numbers, one element a lane, by the vector extensions of gcc and clang. Each lane has the bits of the
   scalar operation. */

#if defined(__AVX512F__)
#define @LANES @WIDEST
#elif defined(__AVX__)
#define @LANES (@WIDEST / 2)
#else
#define @LANES (@WIDEST / 4)
#endif

typedef @real @lanes __attribute__((vector_size(@LANES * sizeof(@real))));
/* All bits of a lane are set or clear. */
typedef @ints @lane_mask __attribute__((vector_size(@LANES * sizeof(@real))));
typedef @bits @lane_bits __attribute__((vector_size(@LANES * sizeof(@real))));

/* Results of a shuffle: numbers of a, and after them those of b. */
#if !defined(ENERGY_SHUFFLE) && (defined(__clang__) || __GNUC__ >= 12)
#define ENERGY_SHUFFLE(masks, a, b, ...) return __builtin_shufflevector(a, b, __VA_ARGS__)
#elif !defined(ENERGY_SHUFFLE)
#define ENERGY_SHUFFLE(masks, a, b, ...) \
    const masks order = {__VA_ARGS__};   \
    return __builtin_shuffle(a, b, order)
#endif

ENERGY_FN @lanes @lanes_load(const @real *numbers) {
    @lanes all;
    memcpy(&all, numbers, sizeof all);
    return all;
}

ENERGY_FN void @lanes_store(@lanes all, @real *numbers) { memcpy(numbers, &all, sizeof all); }

@TRANSPOSITION
ENERGY_FN @lanes @lanes_splat(@real a) {
    @lanes all;
    int i;
    for (i = 0; i < @LANES; i++) {
        all[i] = a;
    }
    return all;
}

ENERGY_FN @lane_mask @lanes_truth(int a) {
    @lane_mask all;
    int i;
    for (i = 0; i < @LANES; i++) {
        all[i] = -a;
    }
    return all;
}

/* Bit i is lane i. */
ENERGY_FN uint32_t @lanes_marked(@lane_mask mask) {
    uint32_t bits = 0U;
    int i;
    for (i = 0; i < @LANES; i++) {
        bits |= (mask[i] != 0 ? 1U : 0U) << i;
    }
    return bits;
}

ENERGY_FN @lanes @lanes_sqrt(@lanes a) {
    @lanes root = a;
#if defined(ENERGY_SQRT_LANES)
    ENERGY_SQRT_LANES(root, a, "@S");
#else
    int i;
    for (i = 0; i < @LANES; i++) {
        root[i] = @M_sqrt(a[i]);
    }
#endif
    return root;
}

ENERGY_FN @lanes @lanes_mul_add(@lanes a, @lanes b, @lanes c) {
    @lanes sum;
    int i;
    ENERGY_HIDE_ON_ARM(c);
    for (i = 0; i < @LANES; i++) {
        sum[i] = __builtin_@M_fma(a[i], b[i], c[i]);
    }
    ENERGY_HIDE(sum);
    return sum;
}

ENERGY_FN @lanes @lanes_select(@lane_mask mask, @lanes yes, @lanes no) {
    return (@lanes)((mask & (@lane_mask)yes) | (~mask & (@lane_mask)no));
}

ENERGY_FN @lanes @lanes_abs(@lanes a) { return (@lanes)((@lane_bits)a << 1 >> 1); }
ENERGY_FN @lanes @lanes_min(@lanes a, @lanes b) { return @lanes_select(b < a, b, a); }
ENERGY_FN @lanes @lanes_max(@lanes a, @lanes b) { return @lanes_select(b > a, b, a); }

ENERGY_FN @lanes @lanes_sum_error(@lanes a, @lanes b) {
    const @lanes sum = a + b;
    const @lanes other = sum - a;
    return (a - (sum - other)) + (b - other);
}

ENERGY_FN @lanes @lanes_difference_error(@lanes a, @lanes b) {
    const @lanes difference = a - b;
    const @lanes other = a - difference;
    return (a - (difference + other)) + (other - b);
}

ENERGY_FN @lanes @lanes_product_error(@lanes a, @lanes b) { return @lanes_mul_add(a, b, -(a * b)); }
ENERGY_FN @lanes @lanes_fused_mul_sub(@lanes a, @lanes b, @lanes c) { return @lanes_mul_add(a, b, -c); }
ENERGY_FN @lanes @lanes_root_error(@lanes a, @lanes root) { return @lanes_mul_add(-root, root, a); }

ENERGY_FN @lanes @lanes_and(@lanes a, @lanes b) { return (@lanes)((@lane_bits)a & (@lane_bits)b); }
ENERGY_FN @lanes @lanes_or(@lanes a, @lanes b) { return (@lanes)((@lane_bits)a | (@lane_bits)b); }
ENERGY_FN @lanes @lanes_xor(@lanes a, @lanes b) { return (@lanes)((@lane_bits)a ^ (@lane_bits)b); }
ENERGY_FN @lanes @lanes_add_bits(@lanes a, @lanes b) { return (@lanes)((@lane_bits)a + (@lane_bits)b); }
ENERGY_FN @lanes @lanes_low_bits_to_exponent(@lanes a) { return (@lanes)((@lane_bits)a << @MANTISSA); }
ENERGY_FN @lanes @lanes_exponent_to_low_bits(@lanes a) { return (@lanes)((@lane_bits)a >> @MANTISSA); }
ENERGY_FN @lanes @lanes_bit_1_to_sign(@lanes a) { return (@lanes)((@lane_bits)a >> 1 << @SIGN_BIT); }

ENERGY_FN @lane_mask @lanes_is_moderate(@lanes a, int32_t degree) {
    return (@lanes_splat(@power_of_two(-@MODERATE * degree)) <= a) &
           (a < @lanes_splat(@power_of_two(@MODERATE * degree)));
}

ENERGY_RARE @lanes @lanes_power_of_two_scale(@lanes a) {
    int i;
    for (i = 0; i < @LANES; i++) {
        a[i] = @power_of_two_scale(a[i]);
    }
    return a;
}

/* Replaces one part of huge angles, lane by lane. */
ENERGY_RARE @lanes @lanes_reduced(@lane_mask huge, @lanes angle, @lanes ordinary, int part) {
    int i;
    for (i = 0; i < @LANES; i++) {
        if (huge[i] != 0) {
            ordinary[i] = @huge_angle(angle[i], part);
        }
    }
    return ordinary;
}

ENERGY_FN @lanes @lanes_quadrant_if_huge(@lane_mask huge, @lanes angle, @lanes ordinary) {
    return @lanes_marked(huge) == 0U ? ordinary : @lanes_reduced(huge, angle, ordinary, 0);
}

ENERGY_FN @lanes @lanes_high_remainder_if_huge(@lane_mask huge, @lanes angle, @lanes ordinary) {
    return @lanes_marked(huge) == 0U ? ordinary : @lanes_reduced(huge, angle, ordinary, 1);
}

ENERGY_FN @lanes @lanes_low_remainder_if_huge(@lane_mask huge, @lanes angle, @lanes ordinary) {
    return @lanes_marked(huge) == 0U ? ordinary : @lanes_reduced(huge, angle, ordinary, 2);
}
