/* Runs a generated element on many inputs, when a line of the standard input says so: `one` for one element at a time,
   `vectors` for vectors of them, `write` for the results of both. Options name the element: its HEADER, NAME, JOINED
   functions, and the LENGTHS of its numbers. */

#define _POSIX_C_SOURCE 199309L
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>
#include HEADER

#define JOINED(name, function) name##_##function
#define FUNCTION(name, function) JOINED(name, function)

enum { NUMBERS = PARAMETERS + STORED + UNKNOWNS, RESULTS = VALUES + FIRST + SECOND, TOGETHER = 16 };

static unsigned evaluate(const double *numbers, double *results) {
    const double *x = numbers + PARAMETERS + STORED;
#if SECOND
    return FUNCTION(NAME, hessian)(x, numbers, numbers + PARAMETERS, results, results + VALUES, results + VALUES + FIRST);
#elif STORED
    return FUNCTION(NAME, jacobian)(x, numbers, numbers + PARAMETERS, results, results + VALUES);
#else
    return FUNCTION(NAME, jacobian)(x, numbers, NULL, results, results + VALUES);
#endif
}

/* As the loops in Rust: results stay in the cache, and nobody reads them. */
static void one_at_a_time(const double *numbers, size_t count) {
    static double results[TOGETHER][RESULTS];
    static volatile unsigned all_flags;
    unsigned flags = 0U;
    size_t i, j;
    for (i = 0; i < count; i += TOGETHER) {
        for (j = 0; j < TOGETHER; j++) {
            flags |= evaluate(numbers + (i + j) * NUMBERS, results[j]);
        }
        __asm__ volatile("" : : "r"(results) : "memory");
    }
    all_flags = flags;
    (void)all_flags;
}

/* Results of elements from `first` on, each after the other. Numbers that do not change are columns, as in the batches in
   Rust; points are gathered from vertices, if there are any. */
static void in_vectors(const double *columns, const double *x, const uint32_t *stencils, size_t all, size_t first,
                       size_t count, double *results) {
    energy_f64_batch batch;
    memset(&batch, 0, sizeof batch);
    batch.count = count;
    batch.parameters.numbers = columns + first;
    batch.stored.numbers = columns + PARAMETERS * all + first;
    batch.parameters.per_element = batch.stored.per_element = 1;
    batch.parameters.per_number = batch.stored.per_number = all;
    batch.stencils = stencils;
    batch.x.numbers = x;
    batch.x.per_element = NUMBERS;
    batch.x.per_number = 1;
    batch.results[0].numbers = results;
    batch.results[1].numbers = results + VALUES;
    batch.results[0].per_number = batch.results[1].per_number = batch.results[2].per_number = 1;
    batch.results[0].per_element = batch.results[1].per_element = batch.results[2].per_element = RESULTS;
#if SECOND
    batch.results[2].numbers = results + VALUES + FIRST;
    FUNCTION(NAME, evaluate_lanes)(ENERGY_HESSIAN, &batch);
#else
    FUNCTION(NAME, evaluate_lanes)(ENERGY_JACOBIAN, &batch);
#endif
}

/* The work of the batches in Rust: points of a strip, in which consecutive elements share all but one, and results that
   stay in the cache. */
static void batches(const double *columns, const double *numbers, const double *vertices, const uint32_t *stencils,
                    size_t count) {
    static double results[TOGETHER * RESULTS];
    size_t i;
    for (i = 0; i < count; i += TOGETHER) {
#if SECOND
        (void)numbers;
        in_vectors(columns, vertices, stencils + i * (UNKNOWNS / 3), count, i, TOGETHER, results);
#else
        (void)vertices;
        (void)stencils;
        in_vectors(columns, numbers + i * NUMBERS + PARAMETERS + STORED, NULL, count, i, TOGETHER, results);
#endif
        __asm__ volatile("" : : "r"(results) : "memory");
    }
}

static double now(void) {
    struct timespec time;
    clock_gettime(CLOCK_MONOTONIC, &time);
    return (double)time.tv_sec * 1e9 + (double)time.tv_nsec;
}

/* Writes the results of each element, one at a time and then in vectors. */
static int write(const char *path, const double *columns, const double *numbers, size_t count) {
    double *all = calloc(count * RESULTS, sizeof(double)), one[RESULTS];
    FILE *file = fopen(path, "wb");
    size_t i, written = 0;
    if (all != NULL && file != NULL) {
        in_vectors(columns, numbers + PARAMETERS + STORED, NULL, count, 0, count, all);
        for (i = 0; i < count; i++) {
            evaluate(numbers + i * NUMBERS, one);
            written += fwrite(one, sizeof one, 1, file) + fwrite(all + i * RESULTS, sizeof one, 1, file);
        }
    }
    free(all);
    return file != NULL && fclose(file) == 0 && written == 2 * count;
}

int main(int count_of_arguments, char **arguments) {
    const size_t count = count_of_arguments > 3 ? (size_t)atol(arguments[1]) : 0, points = UNKNOWNS / 3;
    double *numbers = malloc(count * NUMBERS * sizeof(double));
    double *columns = malloc(count * NUMBERS * sizeof(double));
    double *vertices = malloc((count + points) * 3 * sizeof(double));
    uint32_t *stencils = malloc(count * points * sizeof(uint32_t));
    FILE *file = count > 0 ? fopen(arguments[2], "rb") : NULL;
    char line[16];
    size_t i, j;
    if (numbers == NULL || columns == NULL || vertices == NULL || stencils == NULL || file == NULL ||
        fread(numbers, NUMBERS * sizeof(double), count, file) != count) {
        fprintf(stderr, "expected: COUNT INPUTS OUTPUTS\n");
        return 2;
    }
    fclose(file);
    for (i = 0; i < count; i++) {
        for (j = 0; j < PARAMETERS + STORED; j++) {
            columns[j * count + i] = numbers[i * NUMBERS + j];
        }
        for (j = 0; j < points; j++) {
            stencils[i * points + j] = (uint32_t)(i + j);
        }
    }
    for (i = 0; i + 1 < count + points; i++) {
        memcpy(vertices + 3 * i, numbers + (i % count + 1) * NUMBERS - 3, 3 * sizeof(double));
    }
    while (fgets(line, sizeof line, stdin) != NULL) {
        double start = 0.0;
        int again;
        if (line[0] == 'w') {
            if (!write(arguments[3], columns, numbers, count)) {
                return 1;
            }
        } else {
            /* The first time warms up: other programs have filled the caches. */
            for (again = 0; again < 2; again++) {
                start = now();
                if (line[0] == 'o') {
                    one_at_a_time(numbers, count);
                } else {
                    batches(columns, numbers, vertices, stencils, count);
                }
            }
            start = now() - start;
        }
        printf("%.17g\n", start);
        fflush(stdout);
    }
    free(numbers);
    free(columns);
    free(vertices);
    free(stencils);
    return 0;
}
