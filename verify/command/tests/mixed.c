/* Compares loops over elements of mixed unknowns and with states with single elements. */
#include <stdio.h>
#include <stdlib.h>
#include "elements.h"

#define KINDS ENERGY_KINDS

/* Elements with their inputs, one after the other. */
typedef struct {
    const entry *of;
    OF(layout) layout;
    /* Rest shapes, parameters with the state, unknowns, velocities, stored numbers. */
    REAL *inputs[5];
    int32_t sizes[5];
    size_t count;
} list;

static REAL *numbers(size_t count) {
    REAL *all = (REAL *)calloc(count + 1U, sizeof *all);
    if (all == NULL) {
        exit(2);
    }
    return all;
}

static int same(const REAL *a, const REAL *b, size_t count) {
    size_t i;
    for (i = 0; i < count; i++) {
        if (memcmp(&a[i], &b[i], sizeof *a) != 0 && !(a[i] != a[i] && b[i] != b[i])) {
            return 0;
        }
    }
    return 1;
}

static int has_velocities(int32_t routine) {
    return routine == ENERGY_HESSIAN_VECTOR || routine == ENERGY_FORCE || routine == ENERGY_JACOBIANS;
}

/* Number of the first number of an unknown, or of its first increment. */
static int32_t first_of(const list *all, int32_t unknown, int of_increments) {
    int32_t first = 0, k;
    for (k = 0; k < unknown; k++) {
        first += OF(kind_size)(all->layout.kinds[k], of_increments);
    }
    return first;
}

/* Gives all elements the shared unknowns of the first one. */
static void share(const list *all) {
    int32_t k, pass;
    size_t i;
    for (k = 0; k < all->layout.unknowns; k++) {
        for (pass = 0; pass < 2 && all->layout.kinds[k] >= ENERGY_SHARED; pass++) {
            REAL *from = all->inputs[2 + pass] + first_of(all, k, pass);
            const size_t size = (size_t)OF(kind_size)(all->layout.kinds[k], pass) * sizeof *from;
            for (i = 1; i < all->count; i++) {
                memcpy(from + i * (size_t)all->sizes[2 + pass], from, size);
            }
        }
    }
}

/* Reads all records of an element whose rest shapes are sound. */
static list records(FILE *file, int32_t wanted) {
    const size_t most = 4096;
    list all;
    int32_t number, k;
    all.of = &entries[wanted];
    all.layout = all.of->layout();
    all.count = 0;
    for (k = 0; k < 5; k++) {
        const OF(element) *e = all.of->element;
        const int32_t sizes[5] = {e->rest, e->parameters, e->coordinates, e->coordinates, e->stored};
        all.sizes[k] = sizes[k];
        all.inputs[k] = numbers(most * (size_t)sizes[k]);
    }
    rewind(file);
    while (fread(&number, sizeof number, 1, file) == 1) {
        const OF(element) *e = entries[number].element;
        const size_t unknowns = (size_t)e->coordinates;
        const size_t sizes[4] = {(size_t)e->rest, (size_t)e->parameters, unknowns, unknowns};
        const REAL *of_rest[2];
        REAL *own[5];
        for (k = 0; k < 4; k++) {
            REAL *place = number == wanted ? all.inputs[k] + all.count * sizes[k] : numbers(sizes[k]);
            if (fread(place, sizeof *place, sizes[k], file) != sizes[k]) {
                exit(2);
            }
            own[k] = place;
            if (number != wanted) {
                free(place);
            }
        }
        if (number == wanted) {
            own[4] = all.inputs[4] + all.count * (size_t)e->stored;
            of_rest[0] = own[0];
            of_rest[1] = own[1];
            all.count += e->run(ENERGY_REST, of_rest, &own[4]) == 0U ? 1U : 0U;
        }
    }
    share(&all);
    return all;
}

/* Runs a routine of one element. */
static unsigned run(const list *all, int32_t routine, size_t i, REAL *const *results) {
    const REAL *own[5], *arguments[4];
    int32_t k;
    for (k = 0; k < 5; k++) {
        own[k] = all->inputs[k] + i * (size_t)all->sizes[k];
    }
    arguments[0] = own[2];
    arguments[1] = has_velocities(routine) ? own[3] : own[1];
    arguments[2] = has_velocities(routine) ? own[1] : own[4];
    arguments[3] = own[4];
    return all->of->element->run(routine, arguments, results);
}

/* Unknowns by kind, with indices that run backwards. */
static void gather(const list *all, OF(mixed_batch) *batch) {
    size_t counts[KINDS], placed[KINDS], i;
    int32_t k, j, pass;
    REAL *shared[2];
    memset(counts, 0, sizeof counts);
    memset(placed, 0, sizeof placed);
    for (pass = 0; pass < 2; pass++) {
        shared[pass] = numbers((size_t)all->sizes[2]);
    }
    batch->shared = shared[0];
    batch->shared_velocities = shared[1];
    for (k = 0; k < all->layout.unknowns; k++) {
        counts[all->layout.kinds[k] % ENERGY_SHARED] += all->count;
        for (pass = 0; pass < 2 && all->layout.kinds[k] >= ENERGY_SHARED; pass++) {
            for (j = 0; j < OF(kind_size)(all->layout.kinds[k], pass); j++) {
                *shared[pass]++ = all->inputs[2 + pass][first_of(all, k, pass) + j];
            }
        }
    }
    for (k = 0; k < KINDS; k++) {
        REAL *values = numbers(4U * counts[k]), *velocities = numbers(4U * counts[k]);
        uint32_t *indices = (uint32_t *)calloc(counts[k] + 1U, sizeof *indices);
        batch->unknowns[k].numbers = values;
        batch->unknowns[k].velocities = velocities;
        batch->unknowns[k].indices = indices;
        for (i = 0; i < all->count; i++) {
            int32_t unknown;
            for (unknown = 0; unknown < all->layout.unknowns; unknown++) {
                if (all->layout.kinds[unknown] == k) {
                    const size_t index = counts[k] - 1U - placed[k];
                    indices[placed[k]++] = (uint32_t)index;
                    for (pass = 0; pass < 2; pass++) {
                        const int32_t size = OF(kind_size)(k, pass);
                        memcpy((pass == 0 ? values : velocities) + index * (size_t)size,
                               all->inputs[2 + pass] + i * (size_t)all->sizes[2 + pass] + first_of(all, unknown, pass),
                               (size_t)size * sizeof *values);
                    }
                }
            }
        }
    }
}

static OF(column) column(const REAL *from, int32_t size) {
    const OF(column) of = {from, (size_t)size, 1U};
    return of;
}

/* Inputs of all elements: numbers of their own with the state after the parameters, or gathered ones with the state
   apart. */
static OF(mixed_batch) batch_of(const list *all, int is_gathered) {
    OF(mixed_batch) batch;
    memset(&batch, 0, sizeof batch);
    batch.batch.count = all->count;
    batch.batch.parameters = column(all->inputs[1], all->sizes[1]);
    batch.batch.stored = column(all->inputs[4], all->sizes[4]);
    if (is_gathered) {
        gather(all, &batch);
        if (all->layout.state > 0) {
            batch.state = column(all->inputs[1] + (all->sizes[1] - all->layout.state), all->sizes[1]);
        }
    } else {
        batch.batch.x = column(all->inputs[2], all->sizes[2]);
        batch.batch.v = column(all->inputs[3], all->sizes[3]);
    }
    return batch;
}

/* Entry (row, column) of a triangle or a square in the numbers that a routine returns. */
static REAL entry_of(const list *all, const REAL *matrix, int is_triangle, int32_t row, int32_t column_) {
    const int32_t n = all->layout.increments, i = row < column_ ? row : column_, j = row < column_ ? column_ : row;
    if (all->layout.is_in_blocks && is_triangle) {
        return matrix[OF(in_blocks)(n / 3, row, column_)];
    }
    if (all->layout.is_in_blocks) {
        return matrix[9 * (row / 3 * (n / 3) + column_ / 3) + 3 * (row % 3) + column_ % 3];
    }
    return is_triangle ? matrix[i * n - i * (i - 1) / 2 + j - i] : matrix[row * n + column_];
}

/* Whether blocks of a matrix reach their slots: one block after the other, with a gap of one number, in an order of
   their own. */
static int blocks_are_placed(const list *all, int32_t routine, int32_t place, const REAL *returned, int way) {
    const int32_t n = all->layout.increments, unknowns = all->layout.unknowns, pairs = unknowns * unknowns;
    const int is_triangle = routine != ENERGY_JACOBIANS;
    const size_t size = (size_t)(n * n + pairs), numbers_of_one = (size_t)all->of->element->sizes[routine][place];
    OF(mixed_batch) batch = batch_of(all, 1);
    uint32_t *slots = (uint32_t *)calloc((size_t)pairs * all->count + 1U, sizeof *slots);
    REAL *found = numbers(size * all->count), *whole = numbers((size_t)(n * n) * all->count);
    size_t i, at = 0;
    int32_t a, b, r, c, number;
    for (i = 0; i < all->count; i++) {
        size_t next = size * i;
        for (a = 0, number = 0; a < unknowns; a++) {
            for (b = is_triangle ? a : 0; b < unknowns; b++) {
                slots[i * (size_t)pairs + (size_t)number++] = (uint32_t)next;
                next += (size_t)(OF(kind_size)(all->layout.kinds[a], 1) * OF(kind_size)(all->layout.kinds[b], 1)) + 1U;
            }
        }
    }
    batch.batch.results[place].numbers = found;
    batch.batch.results[place].per_element = (size_t)pairs;
    batch.batch.results[place].layout = way == 0 ? ENERGY_ADDED : ENERGY_STORED;
    batch.batch.results[place].slots = slots;
    all->of->loops[way](routine, &batch);
    for (i = 0; i < all->count; i++) {
        for (a = 0, at = size * i; a < unknowns; a++) {
            for (b = is_triangle ? a : 0; b < unknowns; b++, at++) {
                for (r = first_of(all, a, 1); r < first_of(all, a + 1, 1); r++) {
                    for (c = first_of(all, b, 1); c < first_of(all, b + 1, 1); c++, at++) {
                        const REAL expected = entry_of(all, returned + i * numbers_of_one, is_triangle, r, c);
                        if (found[at] != expected && (expected == expected || found[at] == found[at])) {
                            return 0;
                        }
                    }
                }
            }
        }
    }
    batch.batch.results[place].numbers = whole;
    batch.batch.results[place].per_element = (size_t)(n * n);
    batch.batch.results[place].per_number = 1U;
    batch.batch.results[place].layout = ENERGY_FULL;
    all->of->loops[way](routine, &batch);
    for (i = 0; i < all->count && is_triangle; i++) {
        for (r = 0; r < n; r++) {
            for (c = 0; c < n; c++) {
                const REAL expected = entry_of(all, returned + i * numbers_of_one, 1, r, c);
                if (!same(&expected, &whole[i * (size_t)(n * n) + (size_t)(r * n + c)], 1U)) {
                    return 0;
                }
            }
        }
    }
    free(slots);
    free(found);
    free(whole);
    return 1;
}

/* Whether gradients of all elements are added: each unknown has one place, whatever its kind. */
static int gradients_are_added(const list *all, const REAL *gradients, int way) {
    const size_t n = (size_t)all->layout.increments, unknowns = (size_t)all->layout.unknowns;
    OF(mixed_batch) batch = batch_of(all, 1);
    uint32_t *slots = (uint32_t *)calloc(unknowns * all->count + 1U, sizeof *slots);
    REAL *found = numbers(n), *expected = numbers(n);
    size_t i, j;
    for (i = 0; i < all->count; i++) {
        for (j = 0; j < unknowns; j++) {
            /* Every third element leaves its first unknown out. */
            const int is_out = j == 0 && i % 3U == 0U;
            slots[i * unknowns + j] = is_out ? ENERGY_NO_SLOT : (uint32_t)first_of(all, (int32_t)j, 1);
        }
        for (j = i % 3U == 0U ? (size_t)first_of(all, 1, 1) : 0U; j < n; j++) {
            expected[j] = expected[j] + gradients[i * n + j];
        }
    }
    batch.batch.results[1].numbers = found;
    batch.batch.results[1].per_element = unknowns;
    batch.batch.results[1].layout = ENERGY_ADDED;
    batch.batch.results[1].slots = slots;
    all->of->loops[way](ENERGY_GRADIENT, &batch);
    i = (size_t)same(found, expected, n);
    free(slots);
    free(found);
    free(expected);
    return (int)i;
}

/* Whether states advance in place. */
static int states_advance(const list *all, const REAL *next, int way) {
    const size_t size = (size_t)all->layout.state, parameters = (size_t)all->sizes[1];
    OF(mixed_batch) batch = batch_of(all, 1);
    REAL *state = numbers(size * all->count);
    size_t i;
    int are_same;
    for (i = 0; i < all->count; i++) {
        memcpy(state + i * size, all->inputs[1] + (i + 1U) * parameters - size, size * sizeof *state);
    }
    batch.state = column(state, all->layout.state);
    batch.batch.results[0].numbers = state;
    batch.batch.results[0].per_element = size;
    batch.batch.results[0].per_number = 1U;
    all->of->loops[way](ENERGY_NEXT, &batch);
    are_same = same(state, next, size * all->count);
    free(state);
    return are_same;
}

/* Compares a routine; returns whether all is the same. */
static int is_routine_same(const list *all, int32_t routine) {
    const int32_t *sizes = all->of->element->sizes[routine];
    REAL *of_each[3];
    unsigned char *flags[2];
    size_t i;
    int32_t k, way;
    int are_same = 1;
    for (k = 0; k < 3; k++) {
        of_each[k] = numbers(all->count * (size_t)sizes[k]);
    }
    for (k = 0; k < 2; k++) {
        flags[k] = (unsigned char *)calloc(all->count + 1U, 1U);
    }
    for (i = 0; i < all->count; i++) {
        REAL *places[3];
        for (k = 0; k < 3; k++) {
            places[k] = of_each[k] + i * (size_t)sizes[k];
        }
        flags[0][i] = (unsigned char)run(all, routine, i, places);
    }
    for (way = 0; way < 4; way++) {
        OF(mixed_batch) batch = batch_of(all, way / 2);
        for (k = 0; k < 3; k++) {
            batch.batch.results[k].numbers = numbers(all->count * (size_t)sizes[k]);
            batch.batch.results[k].per_element = (size_t)sizes[k];
            batch.batch.results[k].per_number = 1U;
        }
        batch.batch.flags = flags[1];
        all->of->loops[way % 2](routine, &batch);
        are_same = are_same && memcmp(flags[0], flags[1], all->count) == 0;
        for (k = 0; k < 3; k++) {
            are_same = are_same && same(of_each[k], batch.batch.results[k].numbers, all->count * (size_t)sizes[k]);
            free(batch.batch.results[k].numbers);
        }
    }
    for (way = 0; way < 2; way++) {
        const int has_triangle = routine == ENERGY_HESSIAN || routine == ENERGY_GAUSS_NEWTON;
        are_same = are_same && (!has_triangle || blocks_are_placed(all, routine, 2, of_each[2], way)) &&
                   (routine != ENERGY_JACOBIANS || blocks_are_placed(all, routine, 1, of_each[1], way)) &&
                   (routine != ENERGY_GRADIENT || gradients_are_added(all, of_each[1], way)) &&
                   (routine != ENERGY_NEXT || states_advance(all, of_each[0], way));
    }
    for (k = 0; k < 3; k++) {
        free(of_each[k]);
    }
    free(flags[0]);
    free(flags[1]);
    return are_same;
}

int main(int argc, char **argv) {
    FILE *file = fopen(argv[argc - 1], "rb");
    size_t compared = 0;
    int32_t e, routine, k;
    for (e = 0; e < (int32_t)(sizeof entries / sizeof *entries); e++) {
        list all = records(file, e);
        for (routine = ENERGY_REST + 1; routine < ENERGY_ROUTINES; routine++) {
            const int32_t *sizes = all.of->element->sizes[routine];
            if (sizes[0] + sizes[1] + sizes[2] > 0) {
                if (!is_routine_same(&all, routine)) {
                    printf("%s, routine %d: loops differ from single elements\n", all.of->element->name, routine);
                    return 1;
                }
                compared += all.count;
            }
        }
        for (k = 0; k < 5; k++) {
            free(all.inputs[k]);
        }
    }
    printf("%lu results compared\n", (unsigned long)compared);
    return 0;
}
