/* Compares loops over the records of a file with single elements: one at a time, and in vectors. Each element has numbers
   of its own, one after the other. */
#include <stdio.h>
#include <stdlib.h>
#include "elements.h"

static REAL *numbers(size_t count) {
    REAL *list = (REAL *)calloc(count + 1, sizeof *list);
    if (list == NULL) {
        exit(2);
    }
    return list;
}

/* Reads all records of one element; returns how many there are. */
static size_t records(FILE *file, int32_t wanted, REAL *inputs[4]) {
    size_t count = 0;
    int32_t number;
    rewind(file);
    while (fread(&number, sizeof number, 1, file) == 1) {
        const ELEMENT *element = elements[number];
        const int32_t sizes[4] = {element->rest, element->parameters, element->coordinates, element->coordinates};
        int i;
        for (i = 0; i < 4; i++) {
            REAL *place = inputs[i] + (number == wanted ? count * (size_t)sizes[i] : 0);
            if (number == wanted) {
                if (fread(place, sizeof *place, (size_t)sizes[i], file) != (size_t)sizes[i]) {
                    exit(2);
                }
            } else if (fseek(file, (long)((size_t)sizes[i] * sizeof(REAL)), SEEK_CUR) != 0) {
                exit(2);
            }
        }
        count += number == wanted ? 1U : 0U;
    }
    return count;
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

static COLUMN column(const REAL *list, int32_t size) {
    COLUMN of;
    of.numbers = list;
    of.per_element = (size_t)size;
    of.per_number = 1U;
    return of;
}

/* Compares the loops of single vertices, a different one for each element, with single elements. Returns whether they
   are the same. */
static int vertices_are_same(int32_t e, BATCH batch, REAL *x, REAL *parameters, REAL *stored) {
    const ELEMENT *element = elements[e];
    const size_t points = (size_t)element->coordinates / 3U, sizes[3] = {1U, 3U, 9U};
    uint32_t *chosen = (uint32_t *)calloc(batch.count + 1U, sizeof *chosen);
    unsigned char *flags = (unsigned char *)calloc(batch.count + 1U, 1U);
    REAL *found[3], of_one[13];
    size_t i;
    int k, way, are_same = 1;
    batch.points = chosen;
    batch.flags = flags;
    for (k = 0; k < 3; k++) {
        found[k] = numbers(batch.count * sizes[k]);
        batch.results[k].numbers = found[k];
        batch.results[k].per_element = sizes[k];
        batch.results[k].per_number = 1U;
    }
    for (way = 0; way < 2; way++) {
        for (i = 0; i < batch.count; i++) {
            chosen[i] = (uint32_t)((i + (size_t)way) % points);
        }
        (way == 0 ? plain : in_lanes)[e](ENERGY_VERTEX, &batch);
        for (i = 0; i < batch.count && are_same; i++) {
            const unsigned expected =
                element->vertex((int32_t)chosen[i], x + i * (size_t)element->coordinates,
                                parameters + i * (size_t)element->parameters, stored + i * (size_t)element->stored,
                                of_one, of_one + 1, of_one + 4);
            are_same = expected == flags[i] && same(of_one, found[0] + i, 1U) &&
                       same(of_one + 1, found[1] + 3U * i, 3U) && same(of_one + 4, found[2] + 9U * i, 9U);
        }
    }
    /* A vertex that does not exist. */
    if (batch.count > 0U) {
        chosen[0] = (uint32_t)points;
        plain[e](ENERGY_VERTEX, &batch);
        are_same = are_same && flags[0] == ENERGY_DEGENERATE && found[0][0] == 0 && found[2][8] == 0;
    }
    for (k = 0; k < 3; k++) {
        free(found[k]);
    }
    free(chosen);
    free(flags);
    return are_same;
}

/* Computes stored numbers by loops, which have none to read. Returns whether they are the same. */
static int rest_is_same(int32_t e, size_t count, const REAL *rest, const REAL *parameters, const REAL *stored) {
    const ELEMENT *element = elements[e];
    REAL *found = numbers(count * (size_t)element->stored);
    BATCH batch;
    int way, are_same = 1;
    memset(&batch, 0, sizeof batch);
    batch.count = count;
    batch.x = column(rest, element->rest);
    batch.parameters = column(parameters, element->parameters);
    batch.results[0].numbers = found;
    batch.results[0].per_element = (size_t)element->stored;
    batch.results[0].per_number = 1U;
    for (way = 0; way < 2; way++) {
        memset(found, 0, count * (size_t)element->stored * sizeof *found);
        (way == 0 ? plain : in_lanes)[e](ENERGY_REST, &batch);
        are_same = are_same && same(stored, found, count * (size_t)element->stored);
    }
    free(found);
    return are_same;
}

/* Place of an entry of a symmetric matrix in its triangle of 3x3 blocks. */
static size_t in_blocks(size_t points, size_t row, size_t column) {
    const size_t i = row / 3U < column / 3U ? row / 3U : column / 3U, j = row / 3U < column / 3U ? column / 3U : row / 3U;
    const size_t r = row / 3U <= column / 3U ? row % 3U : column % 3U, c = row / 3U <= column / 3U ? column % 3U : row % 3U;
    return 9U * (i * points - i * (i + 1U) / 2U + j) + 3U * r + c;
}

/* What a result of all elements is in a layout, from what single elements return. Slots have `block` numbers each: one of
   their own for each element, counted from the end, if they are stored; the same for all elements if they are added. */
static void arrange(enum energy_layout layout, size_t elements_count, size_t n, size_t count, size_t block,
                    const REAL *returned, REAL *expected) {
    const size_t slots = elements_count * (count / block);
    size_t i, j, row, column;
    for (i = 0; i < elements_count; i++) {
        const REAL *of_one = returned + i * count;
        if (layout == ENERGY_STORED || layout == ENERGY_ADDED) {
            for (j = 0; j < count; j++) {
                const size_t slot = layout == ENERGY_ADDED ? j / block : slots - 1U - (i * (count / block) + j / block);
                REAL *place = expected + slot * block + j % block;
                *place = layout == ENERGY_ADDED ? *place + of_one[j] : of_one[j];
            }
        } else if (count == n * (n + 3U) / 2U) {
            REAL *place = expected + i * n * n;
            for (row = 0; row < n; row++) {
                for (column = layout == ENERGY_FULL ? 0U : row; column < n; column++) {
                    *place++ = of_one[in_blocks(n / 3U, row, column)];
                }
            }
        } else {
            memcpy(expected + i * n * n, of_one, count * sizeof *of_one);
        }
    }
}

/* Compares all layouts of a routine with arranged results of single elements. All results have the same layout, those too
   that the routine lacks. Returns whether they are the same. */
static int layouts_are_same(int32_t e, int32_t routine, BATCH batch, REAL *const returned[3]) {
    static const enum energy_layout layouts[4] = {ENERGY_FULL, ENERGY_TRIANGLE, ENERGY_STORED, ENERGY_ADDED};
    const int32_t *counts = elements[e]->sizes[routine];
    const size_t n = (size_t)elements[e]->coordinates;
    const int order = routine == ENERGY_HESSIAN_VECTOR || routine == ENERGY_FORCE || routine == ENERGY_JACOBIANS ? 1 : 0;
    int l, way, k, are_same = 1;
    batch.flags = NULL;
    for (l = 0; l < 4; l++) {
        for (way = 0; way < 2; way++) {
            REAL *found[3], *expected[3];
            uint32_t *slots[3];
            size_t sizes[3];
            for (k = 0; k < 3; k++) {
                const size_t count = (size_t)counts[k];
                const size_t block =
                    order + k == 0 || count % 3U != 0U ? 1U : (order + k == 1 || count % 9U != 0U ? 3U : 9U);
                const size_t own = count / block, all = batch.count * own;
                size_t slot;
                sizes[k] = batch.count * (n * n > count ? n * n : count);
                found[k] = numbers(sizes[k]);
                expected[k] = numbers(sizes[k]);
                slots[k] = (uint32_t *)calloc(all + 1U, sizeof *slots[k]);
                for (slot = 0; slot < all; slot++) {
                    slots[k][slot] = (uint32_t)(layouts[l] == ENERGY_ADDED ? slot % own : all - 1U - slot);
                }
                batch.results[k].numbers = found[k];
                batch.results[k].layout = layouts[l];
                batch.results[k].slots = slots[k];
                batch.results[k].per_element = layouts[l] == ENERGY_ADDED || layouts[l] == ENERGY_STORED ? own : n * n;
                batch.results[k].per_number = 1U;
                if (batch.results[k].per_element >= count || layouts[l] == ENERGY_ADDED || layouts[l] == ENERGY_STORED) {
                    arrange(layouts[l], batch.count, n, count, block, returned[k], expected[k]);
                } else {
                    batch.results[k].numbers = NULL; /* More numbers than a full matrix has. */
                }
            }
            (way == 0 ? plain : in_lanes)[e](routine, &batch);
            for (k = 0; k < 3; k++) {
                if (!same(expected[k], found[k], sizes[k])) {
                    printf("layout %d, result %d, way %d: ", (int)layouts[l], k, way);
                    are_same = 0;
                }
                free(found[k]);
                free(expected[k]);
                free(slots[k]);
            }
        }
    }
    return are_same;
}

int main(int argc, char **argv) {
    const size_t most = 4096;
    FILE *file = fopen(argv[argc - 1], "rb");
    size_t compared = 0, flagged = 0;
    int32_t e;
    for (e = 0; e < (int32_t)(sizeof elements / sizeof *elements); e++) {
        const ELEMENT *element = elements[e];
        REAL *inputs[4], *stored = numbers(most * (size_t)element->stored), *sound[4], *kept;
        const int32_t sizes[4] = {element->rest, element->parameters, element->coordinates, element->coordinates};
        size_t count, i, good = 0;
        int32_t routine;
        int k;
        for (k = 0; k < 4; k++) {
            inputs[k] = numbers(most * (size_t)sizes[k]);
            sound[k] = numbers(most * (size_t)sizes[k]);
        }
        count = records(file, e, inputs);
        kept = numbers((size_t)element->stored);
        for (i = 0; i < count; i++) {
            const REAL *of_rest[2];
            of_rest[0] = inputs[0] + i * (size_t)sizes[0];
            of_rest[1] = inputs[1] + i * (size_t)sizes[1];
            if (element->run(ENERGY_REST, of_rest, &kept) == 0U) {
                memcpy(stored + good * (size_t)element->stored, kept, (size_t)element->stored * sizeof *kept);
                for (k = 0; k < 4; k++) {
                    memcpy(sound[k] + good * (size_t)sizes[k], inputs[k] + i * (size_t)sizes[k], (size_t)sizes[k] * sizeof(REAL));
                }
                good++;
            }
        }
        if (!rest_is_same(e, good, sound[0], sound[1], stored)) {
            printf("%s: other stored numbers\n", element->name);
            return 1;
        }
        for (routine = ENERGY_REST + 1; routine < ENERGY_ROUTINES; routine++) {
            const int32_t *results = element->sizes[routine];
            const int has_velocities = routine == ENERGY_HESSIAN_VECTOR || routine == ENERGY_FORCE || routine == ENERGY_JACOBIANS;
            REAL *of_each[3], *of_loops[2][3];
            unsigned char *flags[3];
            BATCH batch;
            int way;
            if (results[0] + results[1] + results[2] == 0) {
                continue;
            }
            memset(&batch, 0, sizeof batch);
            batch.count = good;
            batch.x = column(sound[2], sizes[2]);
            batch.v = column(sound[3], sizes[3]);
            batch.parameters = column(sound[1], sizes[1]);
            batch.stored = column(stored, element->stored);
            for (k = 0; k < 3; k++) {
                of_each[k] = numbers(good * (size_t)results[k]);
                flags[k] = (unsigned char *)calloc(good + 1, 1);
            }
            for (i = 0; i < good; i++) {
                const REAL *arguments[4];
                REAL *places[3];
                for (k = 0; k < 3; k++) {
                    places[k] = of_each[k] + i * (size_t)results[k];
                }
                arguments[0] = sound[2] + i * (size_t)sizes[2];
                arguments[1] = has_velocities ? sound[3] + i * (size_t)sizes[3] : sound[1] + i * (size_t)sizes[1];
                arguments[2] = has_velocities ? sound[1] + i * (size_t)sizes[1] : stored + i * (size_t)element->stored;
                arguments[3] = stored + i * (size_t)element->stored;
                flags[0][i] = (unsigned char)element->run(routine, arguments, places);
                flagged += flags[0][i] != 0 ? 1U : 0U;
            }
            for (way = 0; way < 2; way++) {
                for (k = 0; k < 3; k++) {
                    of_loops[way][k] = numbers(good * (size_t)results[k]);
                    batch.results[k].numbers = of_loops[way][k];
                    batch.results[k].per_element = (size_t)results[k];
                    batch.results[k].per_number = 1U;
                }
                batch.flags = flags[way + 1];
                (way == 0 ? plain : in_lanes)[e](routine, &batch);
                for (k = 0; k < 3; k++) {
                    if (!same(of_each[k], of_loops[way][k], good * (size_t)results[k])) {
                        printf("%s, routine %d, result %d, way %d: other bits\n", element->name, routine, k, way);
                        return 1;
                    }
                    free(of_loops[way][k]);
                }
                if (memcmp(flags[0], flags[way + 1], good) != 0) {
                    printf("%s, routine %d, way %d: other flags\n", element->name, routine, way);
                    return 1;
                }
            }
            if (!layouts_are_same(e, routine, batch, of_each)) {
                printf("%s, routine %d: other bits\n", element->name, routine);
                return 1;
            }
            compared += good;
            for (k = 0; k < 3; k++) {
                free(of_each[k]);
                free(flags[k]);
            }
        }
        if (element->vertex != NULL) {
            BATCH batch;
            memset(&batch, 0, sizeof batch);
            batch.count = good;
            batch.x = column(sound[2], sizes[2]);
            batch.parameters = column(sound[1], sizes[1]);
            batch.stored = column(stored, element->stored);
            if (!vertices_are_same(e, batch, sound[2], sound[1], stored)) {
                printf("%s: other vertices\n", element->name);
                return 1;
            }
        }
        for (k = 0; k < 4; k++) {
            free(inputs[k]);
            free(sound[k]);
        }
        free(stored);
        free(kept);
    }
    printf("%lu results compared, %lu of them flagged\n", (unsigned long)compared, (unsigned long)flagged);
    return 0;
}
