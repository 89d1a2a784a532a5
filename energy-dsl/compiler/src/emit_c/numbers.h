#ifndef ENERGY_FN
#if defined(__FAST_MATH__)
#error "generated energies need exact arithmetic: compile without -ffast-math"
#endif
#if defined(FLT_EVAL_METHOD) && FLT_EVAL_METHOD != 0 && !defined(__CUDACC__)
#error "generated energies need numbers that are rounded to their own precision: on x86, compile with -mfpmath=sse"
#endif
#if defined(__clang__)
#pragma STDC FP_CONTRACT OFF
#elif defined(_MSC_VER)
#pragma fp_contract(off)
#endif
#if defined(__CUDACC__)
#define ENERGY_FN static __host__ __device__ __forceinline__
#define ENERGY_RARE static __host__ __device__ __noinline__
#elif defined(__GNUC__)
#define ENERGY_FN static inline __attribute__((always_inline, unused))
#define ENERGY_RARE static __attribute__((cold, noinline, unused))
#else
#define ENERGY_FN static inline
#define ENERGY_RARE static
#endif
/* Functions of elements are inlined if the compiler thinks it good. */
#if defined(__CUDACC__)
#define ENERGY_ROUTINE static __host__ __device__ inline
#elif defined(__GNUC__)
#define ENERGY_ROUTINE static inline __attribute__((unused))
#else
#define ENERGY_ROUTINE static inline
#endif
#if defined(__GNUC__) || defined(_MSC_VER) || defined(__CUDACC__)
#define ENERGY_RESTRICT __restrict
#else
#define ENERGY_RESTRICT restrict
#endif
/* Hides where a number comes from. Compilers take -(x y + z) and (-x) y - z for each other: gcc wherever there are fused
   operations, clang on processors of ARM. But where both terms cancel, one of them is 0, and the other is -0. */
#if !defined(__GNUC__) || defined(__CUDA_ARCH__)
#define ENERGY_HIDE(a) (void)0
#define ENERGY_HIDE_ON_ARM(a) (void)0
#elif defined(__x86_64__) || defined(__i386__)
#if defined(__FMA__) && !defined(__clang__)
#define ENERGY_HIDE(a) __asm__("" : "+v"(a))
#else
#define ENERGY_HIDE(a) (void)0
#endif
#define ENERGY_HIDE_ON_ARM(a) (void)0
#elif defined(__aarch64__)
#define ENERGY_HIDE(a) __asm__("" : "+w"(a))
#define ENERGY_HIDE_ON_ARM(a) ENERGY_HIDE(a)
#else
#define ENERGY_HIDE(a) __asm__("" : "+m"(a))
#define ENERGY_HIDE_ON_ARM(a) ENERGY_HIDE(a)
#endif
/* Square roots by the processor's instruction: compilers would call the function of the library for negative numbers, which
   sets errno. */
#if defined(__GNUC__) && !defined(__CUDACC__) && defined(__x86_64__) && defined(__AVX__)
#define ENERGY_SQRT(root, a, type) __asm__("vsqrts" type " {%1, %1, %0|%0, %1, %1}" : "=v"(root) : "v"(a))
#define ENERGY_SQRT_LANES(root, a, type) __asm__("vsqrtp" type " {%1, %0|%0, %1}" : "=v"(root) : "v"(a))
#elif defined(__GNUC__) && !defined(__CUDACC__) && defined(__x86_64__)
#define ENERGY_SQRT(root, a, type) __asm__("sqrts" type " {%1, %0|%0, %1}" : "=x"(root) : "x"(a))
#define ENERGY_SQRT_LANES(root, a, type) __asm__("sqrtp" type " {%1, %0|%0, %1}" : "=x"(root) : "x"(a))
#elif defined(__GNUC__) && !defined(__CUDACC__) && defined(__aarch64__)
#define ENERGY_SQRT(root, a, type) __asm__("fsqrt %" type "0, %" type "1" : "=w"(root) : "w"(a))
#endif
/* Flags that routines return. Results are documented conventions where one is set. */
/* A true singularity, or an input outside of the formula's domain. */
#define ENERGY_DEGENERATE 1U
/* One-sided derivatives differ. Those of one side were returned. */
#define ENERGY_KINK 2U
/* Only limits along rays could tell the results; see README.md. ENERGY_DEGENERATE is set, too. */
#define ENERGY_UNSETTLED 4U
/* Returned inside of the generated code: only the general path can tell. */
#define ENERGY_GENERAL 8U
/* Numbers of routines. */
enum {
@@ROUTINES
};
#endif

/* Operations that are rounded once. CUDA's intrinsics are never contracted. */

ENERGY_FN @real @add(@real a, @real b) {
#if defined(__CUDA_ARCH__)
    return @I_add(a, b);
#else
    return a + b;
#endif
}

ENERGY_FN @real @sub(@real a, @real b) {
#if defined(__CUDA_ARCH__)
    return @I_sub(a, b);
#else
    return a - b;
#endif
}

ENERGY_FN @real @mul(@real a, @real b) {
#if defined(__CUDA_ARCH__)
    return @I_mul(a, b);
#else
    return a * b;
#endif
}

ENERGY_FN @real @div(@real a, @real b) {
#if defined(__CUDA_ARCH__)
    return @I_div(a, b);
#else
    return a / b;
#endif
}

ENERGY_FN @real @sqrt(@real a) {
#if defined(__CUDA_ARCH__)
    return @I_sqrt(a);
#elif defined(ENERGY_SQRT)
    @real root;
    ENERGY_SQRT(root, a, "@S");
    return root;
#else
    return @M_sqrt(a);
#endif
}

/* a b + c */
ENERGY_FN @real @mul_add(@real a, @real b, @real c) {
#if defined(__CUDA_ARCH__)
    return @I_fma(a, b, c);
#elif defined(__GNUC__)
    @real sum;
    ENERGY_HIDE_ON_ARM(c);
    sum = __builtin_@M_fma(a, b, c);
    ENERGY_HIDE(sum);
    return sum;
#else
    return @M_fma(a, b, c);
#endif
}

ENERGY_FN @real @neg(@real a) { return -a; }
ENERGY_FN @real @abs(@real a) { return @M_fabs(a); }
ENERGY_FN @real @min(@real a, @real b) { return b < a ? b : a; }
ENERGY_FN @real @max(@real a, @real b) { return b > a ? b : a; }
ENERGY_FN int @less(@real a, @real b) { return a < b; }
ENERGY_FN int @precedes(@real a, @real b) { return a < b; }
ENERGY_FN int @less_or_equal(@real a, @real b) { return a <= b; }
ENERGY_FN int @equal(@real a, @real b) { return a == b; }
ENERGY_FN int @both(int a, int b) { return a & b; }
ENERGY_FN int @either(int a, int b) { return a | b; }
ENERGY_FN int @not(int a) { return !a; }
ENERGY_FN @real @select(int mask, @real yes, @real no) { return mask ? yes : no; }

/* Rounding errors: exact, unless they underflow. */

/* (a + b) - fl(a + b), by 2Sum. */
ENERGY_FN @real @sum_error(@real a, @real b) {
    const @real sum = @add(a, b);
    const @real other = @sub(sum, a);
    return @add(@sub(a, @sub(sum, other)), @sub(b, other));
}

/* (a - b) - fl(a - b) */
ENERGY_FN @real @difference_error(@real a, @real b) {
    const @real difference = @sub(a, b);
    const @real other = @sub(a, difference);
    return @add(@sub(a, @add(difference, other)), @sub(other, b));
}

/* a b - fl(a b) */
ENERGY_FN @real @product_error(@real a, @real b) { return @mul_add(a, b, -@mul(a, b)); }

/* a b - c, rounded once. */
ENERGY_FN @real @fused_mul_sub(@real a, @real b, @real c) { return @mul_add(a, b, -c); }

/* a - root^2, rounded once. */
ENERGY_FN @real @root_error(@real a, @real root) { return @mul_add(-root, root, a); }

/* Bit patterns. */

ENERGY_FN @bits @to_bits(@real a) {
    @bits bits;
    memcpy(&bits, &a, sizeof bits);
    return bits;
}

ENERGY_FN @real @from_bits(@bits bits) {
    @real a;
    memcpy(&a, &bits, sizeof a);
    return a;
}

ENERGY_FN @real @and(@real a, @real b) { return @from_bits(@to_bits(a) & @to_bits(b)); }
ENERGY_FN @real @or(@real a, @real b) { return @from_bits(@to_bits(a) | @to_bits(b)); }
ENERGY_FN @real @xor(@real a, @real b) { return @from_bits(@to_bits(a) ^ @to_bits(b)); }
ENERGY_FN @real @add_bits(@real a, @real b) { return @from_bits(@to_bits(a) + @to_bits(b)); }
ENERGY_FN @real @low_bits_to_exponent(@real a) { return @from_bits(@to_bits(a) << @MANTISSA); }
ENERGY_FN @real @exponent_to_low_bits(@real a) { return @from_bits(@to_bits(a) >> @MANTISSA); }
ENERGY_FN @real @bit_1_to_sign(@real a) { return @from_bits(@to_bits(a) >> 1 << @SIGN_BIT); }
ENERGY_FN @real @infinity(void) { return @from_bits((@bits)@EXPONENTS << @MANTISSA); }

/* Whether no number is infinite or NaN. */
ENERGY_FN int @are_finite(const @real *numbers, int32_t count) {
    int are_finite = 1;
    int32_t i;
    for (i = 0; i < count; i++) {
        are_finite = are_finite && @abs(numbers[i]) < @infinity();
    }
    return are_finite;
}

/* 2^exponent, a normal number. */
ENERGY_FN @real @power_of_two(int32_t exponent) { return @from_bits((@bits)(exponent + @BIAS) << @MANTISSA); }

/* The power of two that scales |a| into [1, 2); 1 for zero, infinity and NaN. */
ENERGY_FN @real @power_of_two_scale(@real a) {
    const int32_t exponent = (int32_t)(@to_bits(a) >> @MANTISSA & @EXPONENTS);
    int32_t inverse = 2 * @BIAS - exponent;
    if (exponent == 0 && a != 0.0@) {
        inverse = 2 * @BIAS;
    } else if (exponent == 0 || exponent == @EXPONENTS) {
        inverse = @BIAS;
    } else if (inverse < 1) {
        inverse = 1;
    }
    return @from_bits((@bits)inverse << @MANTISSA);
}

/* Whether a is a product of `degree` lengths from 2^-@MODERATE to 2^@MODERATE. */
ENERGY_FN int @is_moderate(@real a, int32_t degree) {
    return @power_of_two(-@MODERATE * degree) <= a && a < @power_of_two(@MODERATE * degree);
}

/* Whether the compiler keeps the promises that results rely on: no contraction, no reassociation. */
ENERGY_FN int @arithmetic_is_exact(void) {
    volatile @real third = 1.0@ / 3.0@, large = @power_of_two(@DIGITS), one = 1.0@;
    const @real a = third, b = large, c = one;
    return a * a - @mul(a, a) == 0.0@ && (b + c) - b == @EVEN && @mul_add(a, a, -(a * a)) != 0.0@;
}

/* What a host may ask of an element. */
typedef struct {
    const char *name;
    /* energy, constraint, force or residual. */
    const char *kind;
    const char *formula;
    /* Numbers of the points or unknowns, of the parameters, of the rest shape, and of what the rest shape determines. */
    int32_t coordinates, parameters, rest, stored;
    /* Numbers of each result of each routine; 0 for those that the element lacks. */
    int32_t sizes[ENERGY_ROUTINES][3];
    /* Runs a routine: arguments in the order of its function, results in the order of its function. Returns flags. */
    unsigned (*run)(int32_t routine, const @real *const *arguments, @real *const *results);
    /* U, and its derivatives by one point alone; NULL if the element lacks it. */
    unsigned (*vertex)(int32_t point, const @real *x, const @real *parameters, const @real *stored, @real *value,
                       @real *gradient, @real *block);
} @element;
