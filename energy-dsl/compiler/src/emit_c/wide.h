/* Numbers with an extended exponent, significand 2^exponent. They round as plain numbers do, but do not overflow. */

typedef struct {
    /* Zero, infinite, NaN, or of a magnitude within the span. */
    @real significand;
    int32_t exponent;
} @wide;

/* Numbers with larger exponents are infinite, those with smaller ones 0. */
#define @LAST_EXPONENT 268435456

ENERGY_FN @wide @wide_plain(@real significand, int32_t exponent) {
    @wide a;
    a.significand = significand;
    a.exponent = exponent;
    return a;
}

ENERGY_FN int @wide_is_plain(@wide a) {
    const @real magnitude = @abs(a.significand);
    return 0.0@ < magnitude && magnitude < @infinity();
}

/* The same number with a significand in [1, 2), if it is finite and not 0. */
ENERGY_RARE @wide @wide_split(@real significand, int32_t exponent) {
    int32_t own;
    if (!@wide_is_plain(@wide_plain(significand, 0))) {
        return @wide_plain(significand, 0);
    }
    if (@abs(significand) < @power_of_two(@FIRST)) {
        significand = @mul(significand, @power_of_two(@REACH));
        exponent -= @REACH;
    }
    own = (int32_t)(@to_bits(significand) << 1 >> (@MANTISSA + 1)) - @BIAS;
    significand = @mul(@mul(significand, @power_of_two(-own / 2)), @power_of_two(-own - -own / 2));
    exponent += own;
    if (exponent >= @LAST_EXPONENT) {
        return @wide_plain(@mul(significand, @infinity()), 0);
    }
    if (exponent <= -@LAST_EXPONENT) {
        return @wide_plain(@mul(significand, 0.0@), 0);
    }
    return @wide_plain(significand, exponent);
}

ENERGY_FN @wide @wide_new(@real significand, int32_t exponent) {
    const @real magnitude = @abs(significand);
    if (@power_of_two(-@SPAN) <= magnitude && magnitude < @power_of_two(@SPAN) && exponent < @LAST_EXPONENT &&
        exponent > -@LAST_EXPONENT) {
        return @wide_plain(significand, exponent);
    }
    return @wide_split(significand, exponent);
}

ENERGY_RARE @wide @wide_of(@real a) { return @wide_new(a, 0); }
ENERGY_FN int32_t @wide_exponent(@wide a) { return @wide_split(a.significand, a.exponent).exponent; }

/* The nearest plain number: infinite or 0 if it is out of range. */
ENERGY_RARE @real @wide_to_plain(@wide a) {
    @wide split;
    if (!@wide_is_plain(a)) {
        return a.significand;
    }
    split = @wide_split(a.significand, a.exponent);
    if (split.exponent > @BIAS) {
        return @mul(split.significand, @infinity());
    }
    if (split.exponent < @FIRST - 80) {
        return @mul(split.significand, 0.0@);
    }
    if (split.exponent < @FIRST) {
        /* The first product is exact, so a subnormal result is rounded once. */
        return @mul(@mul(split.significand, @power_of_two(@FIRST)), @power_of_two(split.exponent - @FIRST));
    }
    return @mul(split.significand, @power_of_two(split.exponent));
}

ENERGY_FN @real @wide_lift(int32_t from, int32_t to) {
    return @power_of_two(from - to < -@REACH ? -@REACH : from - to);
}

/* Gives two numbers the exponent of the larger one. */
ENERGY_RARE int32_t @wide_align(@wide *a, @wide *b) {
    int32_t exponent;
    if (a->exponent == b->exponent || !@wide_is_plain(*a) || !@wide_is_plain(*b)) {
        exponent = @wide_is_plain(*a) ? a->exponent : b->exponent;
    } else if (a->exponent > b->exponent) {
        b->significand = @mul(b->significand, @wide_lift(b->exponent, a->exponent));
        exponent = a->exponent;
    } else {
        a->significand = @mul(a->significand, @wide_lift(a->exponent, b->exponent));
        exponent = b->exponent;
    }
    return exponent;
}

ENERGY_RARE @wide @wide_neg(@wide a) { return @wide_plain(-a.significand, a.exponent); }
ENERGY_RARE @wide @wide_abs(@wide a) { return @wide_plain(@abs(a.significand), a.exponent); }

ENERGY_RARE @wide @wide_add(@wide a, @wide b) {
    const int32_t exponent = @wide_align(&a, &b);
    return @wide_new(@add(a.significand, b.significand), exponent);
}

ENERGY_RARE @wide @wide_sub(@wide a, @wide b) { return @wide_add(a, @wide_neg(b)); }

ENERGY_RARE @wide @wide_mul(@wide a, @wide b) {
    return @wide_new(@mul(a.significand, b.significand), a.exponent + b.exponent);
}

ENERGY_RARE @wide @wide_div(@wide a, @wide b) {
    return @wide_new(@div(a.significand, b.significand), a.exponent - b.exponent);
}

/* a b + c, rounded once. */
ENERGY_RARE @wide @wide_mul_add(@wide a, @wide b, @wide c) {
    const int32_t exponent = a.exponent + b.exponent;
    const int32_t shift = c.exponent - exponent;
    if (!@wide_is_plain(c) || !@wide_is_plain(a) || !@wide_is_plain(b)) {
        return @wide_new(@mul_add(a.significand, b.significand, c.significand),
                         @wide_is_plain(c) ? c.exponent : exponent);
    }
    if (shift > @REACH) {
        a.significand = @mul(a.significand, @power_of_two(-@REACH));
        return @wide_new(@mul_add(a.significand, b.significand, c.significand), c.exponent);
    }
    c.significand = @mul(c.significand, @power_of_two(shift < -@REACH ? -@REACH : shift));
    return @wide_new(@mul_add(a.significand, b.significand, c.significand), exponent);
}

ENERGY_RARE @wide @wide_fused_mul_sub(@wide a, @wide b, @wide c) { return @wide_mul_add(a, b, @wide_neg(c)); }
ENERGY_RARE @wide @wide_root_error(@wide a, @wide root) { return @wide_mul_add(@wide_neg(root), root, a); }

ENERGY_RARE @wide @wide_sqrt(@wide a) {
    if (a.exponent % 2 == 0) {
        return @wide_new(@sqrt(a.significand), a.exponent / 2);
    }
    return @wide_new(@sqrt(@add(a.significand, a.significand)), (a.exponent - 1) / 2);
}

ENERGY_RARE int @wide_less(@wide a, @wide b) {
    (void)@wide_align(&a, &b);
    return a.significand < b.significand;
}

ENERGY_RARE int @wide_precedes(@wide a, @wide b) { return @wide_less(a, b); }

ENERGY_RARE int @wide_less_or_equal(@wide a, @wide b) {
    (void)@wide_align(&a, &b);
    return a.significand <= b.significand;
}

ENERGY_RARE int @wide_equal(@wide a, @wide b) {
    (void)@wide_align(&a, &b);
    return a.significand == b.significand;
}

ENERGY_RARE @wide @wide_min(@wide a, @wide b) { return @wide_less(b, a) ? b : a; }
ENERGY_RARE @wide @wide_max(@wide a, @wide b) { return @wide_less(a, b) ? b : a; }

ENERGY_RARE @wide @wide_sum_error(@wide a, @wide b) {
    const int32_t apart = a.exponent - b.exponent;
    int32_t exponent;
    if (@wide_is_plain(a) && @wide_is_plain(b) && (apart > @REACH || apart < -@REACH)) {
        return apart > 0 ? b : a;
    }
    exponent = @wide_align(&a, &b);
    return @wide_new(@sum_error(a.significand, b.significand), exponent);
}

ENERGY_RARE @wide @wide_difference_error(@wide a, @wide b) { return @wide_sum_error(a, @wide_neg(b)); }

ENERGY_RARE @wide @wide_product_error(@wide a, @wide b) {
    return @wide_new(@product_error(a.significand, b.significand), a.exponent + b.exponent);
}

ENERGY_RARE @wide @wide_power_of_two_scale(@wide a) {
    return @wide_plain(1.0@, @wide_is_plain(a) ? -@wide_exponent(a) : 0);
}

ENERGY_RARE @wide @wide_sin(@wide a) {
    if (@wide_is_plain(a) && @wide_exponent(a) < -60) {
        return a;
    }
    return @wide_new(@sin(@wide_to_plain(a)), 0);
}

ENERGY_RARE @wide @wide_cos(@wide a) { return @wide_new(@cos(@wide_to_plain(a)), 0); }

ENERGY_RARE @wide @wide_exp(@wide a) {
    const @real plain = @wide_to_plain(a);
    const @real result = @exp(plain);
    @real k, rest;
    if ((@power_of_two(@FIRST) <= result && result < @infinity()) || !@wide_is_plain(a) || @wide_exponent(a) > 24) {
        return @wide_new(result, 0);
    }
    /* 2^k e^(a - k ln 2) */
    k = @M_round(@mul(plain, @LOG2_E));
    rest = @sub(@sub(@sub(plain, @mul(k, @LN_2_HIGH)), @product_error(k, @LN_2_HIGH)), @mul(k, @LN_2_LOW));
    return @wide_new(@exp(rest), (int32_t)k);
}

ENERGY_RARE @wide @wide_ln(@wide a) {
    const @wide split = @wide_split(a.significand, a.exponent);
    @real k;
    if (!@wide_is_plain(a) || (@FIRST <= split.exponent && split.exponent <= @BIAS)) {
        return @wide_new(@ln(@wide_to_plain(a)), 0);
    }
    k = (@real)split.exponent;
    return @wide_new(@add(@mul(k, @LN_2_HIGH), @add(@ln(split.significand), @add(@product_error(k, @LN_2_HIGH),
                                                                               @mul(k, @LN_2_LOW)))), 0);
}

ENERGY_RARE @wide @wide_atan2(@wide y, @wide x) {
    const int is_slight = @wide_is_plain(y) && @wide_is_plain(x) && 0.0@ < x.significand;
    const @wide quotient = @wide_div(y, x);
    if (is_slight && @wide_exponent(quotient) < -80) {
        return quotient;
    }
    (void)@wide_align(&y, &x);
    return @wide_new(@atan2(y.significand, x.significand), 0);
}

ENERGY_RARE @wide @wide_moderate_atan2(@wide y, @wide x) { return @wide_atan2(y, x); }

ENERGY_RARE @wide @wide_powf(@wide a, @wide exponent) {
    const @real power = @wide_to_plain(exponent);
    const @wide split = @wide_split(a.significand, a.exponent);
    const @real own = (@real)split.exponent;
    const @real estimate = @mul(own, power), doubt = @abs(power);
    const @real first = (@real)(@FIRST + 2), last = (@real)(@BIAS - 1);
    const int fits = @FIRST <= split.exponent && split.exponent <= @BIAS;
    @real whole, fraction;
    @wide of_significand;
    if (!@wide_is_plain(a) || (fits && first < @sub(estimate, doubt) && @add(estimate, doubt) < last)) {
        return @wide_new(@powf(@wide_to_plain(a), power), 0);
    }
    /* (m 2^e)^p = m^p 2^(fraction of e p) 2^(whole of e p) */
    whole = @M_round(estimate);
    fraction = @fused_mul_sub(own, power, whole);
    if (doubt < last) {
        of_significand = @wide_of(@powf(split.significand, power));
    } else {
        of_significand = @wide_exp(@wide_of(@mul(@ln(split.significand), power)));
    }
    return @wide_mul(of_significand, @wide_new(@powf(2.0@, fraction), (int32_t)whole));
}

ENERGY_FN int @wide_is_finite(@wide a) { return @abs(a.significand) < @infinity(); }
ENERGY_FN int @wide_is_number(@wide a) { return a.significand == a.significand; }
ENERGY_FN int @wide_is_representable(@wide a) { return @abs(@wide_to_plain(a)) < @infinity(); }

/* A number beyond the range, but not infinite, becomes a large one that can still be added. */
ENERGY_RARE @wide @wide_saturated(@wide a) {
    const @real large = @power_of_two(@BIAS - 8);
    if (!@wide_is_plain(a) || @wide_is_representable(a)) {
        return a;
    }
    return @wide_of(0.0@ < a.significand ? large : -large);
}

/* Keeps each group of results whose numbers are all finite; other groups become 0. `first_is_value` keeps an infinite
   value. */
ENERGY_RARE void @keep_conventions(@wide *results, const int32_t *sizes, int32_t groups, int first_is_value) {
    int32_t group, first = 0, i;
    for (group = 0; group < groups; group++) {
        const int is_value = group == 0 && first_is_value && sizes[0] == 1;
        int keep = 1;
        for (i = first; i < first + sizes[group]; i++) {
            keep = keep && (is_value ? @wide_is_number(results[i]) : @wide_is_finite(results[i]));
        }
        for (i = first; i < first + sizes[group] && !keep; i++) {
            results[i] = @wide_of(0.0@);
        }
        first += sizes[group];
    }
}

/* Decides what the results of a general path are, and writes them. Returns the flags. */
ENERGY_RARE unsigned @settled(const @wide *inputs, int32_t reads, @wide *results, const int32_t *sizes, int32_t groups,
                              int32_t summed, unsigned roles, unsigned masks, @real *numbers) {
    const int first_is_value = (roles & 1U) != 0U, is_energy = (roles & 2U) != 0U;
    const int is_outside = (masks & 1U) != 0U, is_definite = (masks & 2U) != 0U, is_doubtful = (masks & 4U) != 0U;
    int32_t count = 0, i;
    int are_finite = 1, are_numbers = 1;
    unsigned flags = 0U;
    for (i = 0; i < groups; i++) {
        count += sizes[i];
    }
    for (i = 0; i < count; i++) {
        are_finite = are_finite && @wide_is_finite(results[i]);
    }
    for (i = 0; i < reads; i++) {
        are_numbers = are_numbers && @wide_is_number(inputs[i]);
    }
    if (is_outside) {
        for (i = 0; i < count; i++) {
            results[i] = @wide_of(i == 0 && is_energy ? @infinity() : 0.0@);
        }
        flags = ENERGY_DEGENERATE;
    } else if (is_definite) {
        @keep_conventions(results, sizes, groups, first_is_value);
        flags = ENERGY_DEGENERATE;
    } else {
        if ((is_doubtful || !are_finite) && are_numbers) {
            @keep_conventions(results, sizes, groups, first_is_value);
            flags = ENERGY_DEGENERATE | ENERGY_UNSETTLED;
        }
        for (i = 0; i < count; i++) {
            if (!@wide_is_representable(results[i])) {
                flags |= ENERGY_DEGENERATE;
            }
        }
    }
    for (i = 0; i < count; i++) {
        numbers[i] = @wide_to_plain(i < summed ? results[i] : @wide_saturated(results[i]));
    }
    return flags;
}
