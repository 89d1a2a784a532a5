/* Numbers of many elements: number j of element i is numbers[i * per_element + j * per_number]. Element after element
   has per_number = 1; a structure of arrays has per_element = 1; per_element = 0 is the same for all. */
typedef struct {
    const @real *numbers;
    size_t per_element, per_number;
} @column;

/* How a result is stored. */
#ifndef ENERGY_LAYOUTS
#define ENERGY_LAYOUTS
enum energy_layout {
    /* As the routine returns it. */
    ENERGY_AS_RETURNED,
    /* A triangle of 3x3 blocks as the full matrix, row by row. Other results are stored as returned. */
    ENERGY_FULL,
    /* A triangle of 3x3 blocks as the upper triangle of numbers, row by row; others as returned. */
    ENERGY_TRIANGLE,
    /* Added: number j to numbers[slots[i * per_element + j / block] * block + j % block], where a block has three numbers
       of a gradient, nine of a Hessian, or one. ENERGY_NO_SLOT leaves a block out. */
    ENERGY_ADDED,
    /* Stored in the same places. On a GPU, sums depend on the order of threads; distinct slots do not. */
    ENERGY_STORED
};
#define ENERGY_NO_SLOT UINT32_MAX
#endif

typedef struct {
    /* NULL if the result is not wanted. */
    @real *numbers;
    size_t per_element, per_number;
    enum energy_layout layout;
    const uint32_t *slots;
} @result;

/* Elements to evaluate. */
typedef struct {
    size_t count;
    /* Coordinates: of the elements, or, if there are stencils, of vertices, three each. */
    @column x, v;
    /* Vertices of each element, one after the other; NULL if each element has its own coordinates. */
    const uint32_t *stencils;
    @column parameters, stored;
    @result results[3];
    /* Flags of each element; may be NULL. */
    unsigned char *flags;
    /* Elements whose results only limits along rays can tell, and room for so many; may be NULL. */
    uint32_t *unsettled;
    size_t room;
    /* Set by the call: the number of flagged elements, and of unsettled ones. */
    size_t flagged, unsettled_count;
    /* On a GPU, both are added to these two numbers instead. */
    uint32_t *counts;
    /* For ENERGY_VERTEX: the point of each element by which derivatives are taken, counted from 0 in the element. */
    const uint32_t *points;
} @batch;

/* Reads the inputs of an element. */
ENERGY_FN void @read(const @column *from, size_t element, int32_t count, @real *numbers) {
    int32_t j;
    for (j = 0; j < count; j++) {
        numbers[j] = from->numbers[element * from->per_element + (size_t)j * from->per_number];
    }
}

ENERGY_FN void @read_points(const @batch *batch, const @column *from, size_t element, int32_t count, @real *numbers) {
    if (batch->stencils == NULL) {
        @read(from, element, count, numbers);
    } else {
        const uint32_t *stencil = batch->stencils + element * (size_t)(count / 3);
        int32_t j;
        for (j = 0; j < count; j++) {
            numbers[j] = from->numbers[3U * (size_t)stencil[j / 3] + (size_t)(j % 3)];
        }
    }
}

/* Writes a triangle of 3x3 blocks as a full matrix or as its upper triangle of numbers, row by row. */
ENERGY_FN void @write_matrix(const @result *to, size_t element, int32_t n, const @real *blocks) {
    @real *matrix = to->numbers + element * to->per_element;
    const int is_full = to->layout == ENERGY_FULL;
    int32_t i, j, row, c;
    for (i = 0; i < n; i += 3) {
        for (j = i; j < n; j += 3) {
            for (row = i; row < i + 3; row++) {
                /* A triangle lacks what stands before the diagonal in this row and in those above. */
                const int32_t start = row * n - (is_full ? 0 : row * (row + 1) / 2);
                for (c = !is_full && i == j ? row : j; c < j + 3; c++) {
                    const @real number = blocks[c - j];
                    matrix[(size_t)(start + c) * to->per_number] = number;
                    if (is_full && i < j) {
                        matrix[(size_t)(c * n + row) * to->per_number] = number;
                    }
                }
                blocks += 3;
            }
        }
    }
}

/* Writes or adds a result of an element. `block` is the number of numbers that have a slot together. */
ENERGY_FN void @write(const @result *to, size_t element, int32_t count, int32_t block, int32_t coordinates,
                      const @real *numbers) {
    size_t number;
    int32_t j, n;
    if (to->numbers == NULL) {
        return;
    }
    number = element * to->per_element;
    if (to->layout == ENERGY_ADDED || to->layout == ENERGY_STORED) {
        for (j = 0; j < count; j += block) {
            const uint32_t slot = to->slots[number];
            @real *place = to->numbers + (size_t)slot * (size_t)block;
            number++;
            if (slot == ENERGY_NO_SLOT) {
                continue;
            }
            for (n = 0; n < block; n++) {
                if (to->layout == ENERGY_STORED) {
                    place[n] = numbers[j + n];
                } else {
#if defined(__CUDA_ARCH__)
                    atomicAdd(place + n, numbers[j + n]);
#else
                    place[n] = place[n] + numbers[j + n];
#endif
                }
            }
        }
    } else if (to->layout != ENERGY_AS_RETURNED && count == coordinates * (coordinates + 3) / 2) {
        @write_matrix(to, element, coordinates, numbers);
    } else {
        for (j = 0; j < count; j++) {
            to->numbers[number + (size_t)j * to->per_number] = numbers[j];
        }
    }
}

#if defined(__CUDACC__)
/* Notes the flags of an element on a GPU. */
static __device__ __forceinline__ void @device_note(const @batch *batch, size_t element, unsigned flags) {
    if (batch->flags != NULL) {
        batch->flags[element] = (unsigned char)flags;
    }
    if (flags != 0U && batch->counts != NULL) {
        atomicAdd(batch->counts, 1U);
        if ((flags & ENERGY_UNSETTLED) != 0U) {
            const uint32_t place = atomicAdd(batch->counts + 1, 1U);
            if (batch->unsettled != NULL && place < batch->room) {
                batch->unsettled[place] = (uint32_t)element;
            }
        }
    }
}
#endif

/* Notes the flags of an element. */
ENERGY_FN void @note(@batch *batch, size_t element, unsigned flags) {
    if (batch->flags != NULL) {
        batch->flags[element] = (unsigned char)flags;
    }
    if (flags != 0U) {
        batch->flagged++;
    }
    if ((flags & ENERGY_UNSETTLED) != 0U) {
        if (batch->unsettled != NULL && batch->unsettled_count < batch->room) {
            batch->unsettled[batch->unsettled_count] = (uint32_t)element;
        }
        batch->unsettled_count++;
    }
}

/* Numbers of a result that have a slot together. */
ENERGY_FN int32_t @slot_size(int32_t routine, int32_t place, int32_t count) {
    const int32_t order = place + (routine == ENERGY_HESSIAN_VECTOR || routine == ENERGY_FORCE ||
                                   routine == ENERGY_JACOBIANS ? 1 : 0);
    return order == 0 || count % 3 != 0 ? 1 : (order == 1 || count % 9 != 0 ? 3 : 9);
}

/* Numbers of the points, or of the rest shape if these are more. */
ENERGY_FN int32_t @moving(const @element *element) {
    return element->coordinates > element->rest ? element->coordinates : element->rest;
}

/* Writes 1, 3 and 9 numbers: U, and its derivatives by one point of an element. They are 0 if there is no such point. */
ENERGY_FN unsigned @run_vertex(const @element *element, const @batch *batch, size_t i, const @real *const *arguments,
                               @real *const *results) {
    memset(results[0], 0, sizeof(@real));
    memset(results[1], 0, 3 * sizeof(@real));
    memset(results[2], 0, 9 * sizeof(@real));
    if (batch->points == NULL || batch->points[i] >= (uint32_t)element->coordinates / 3U) {
        return ENERGY_DEGENERATE;
    }
    return element->vertex((int32_t)batch->points[i], arguments[0], arguments[1], arguments[2], results[0], results[1],
                           results[2]);
}

/* Runs a routine of an element on many elements, in order. For ENERGY_REST, `batch->x` is the rest shape. `work` has room for all inputs and results of one. */
ENERGY_FN void @run_each(const @element *element, int32_t routine, @batch *batch, size_t first, size_t count, @real *work) {
    const int32_t of_vertex[3] = {1, 3, 9}, none[3] = {0, 0, 0};
    const int is_vertex = routine == ENERGY_VERTEX && element->vertex != NULL;
    const int32_t *sizes = is_vertex ? of_vertex : routine == ENERGY_VERTEX ? none : element->sizes[routine];
    const int32_t coordinates = is_vertex ? 3 : element->coordinates;
    const int has_velocities =
        routine == ENERGY_HESSIAN_VECTOR || routine == ENERGY_FORCE || routine == ENERGY_JACOBIANS;
    @real *x = work, *v = x + @moving(element), *parameters = v + element->coordinates;
    @real *stored = parameters + element->parameters;
    @real *results[3];
    const @real *arguments[4];
    size_t i;
    int32_t place;
    results[0] = stored + element->stored;
    results[1] = results[0] + sizes[0];
    results[2] = results[1] + sizes[1];
    arguments[0] = x;
    arguments[1] = has_velocities ? v : parameters;
    arguments[2] = has_velocities ? parameters : stored;
    arguments[3] = stored;
    for (i = first; i < first + count; i++) {
        unsigned flags;
        if (routine == ENERGY_REST) {
            @read(&batch->x, i, element->rest, x);
        } else {
            @read_points(batch, &batch->x, i, element->coordinates, x);
        }
        if (has_velocities) {
            @read_points(batch, &batch->v, i, element->coordinates, v);
        }
        @read(&batch->parameters, i, element->parameters, parameters);
        if (routine != ENERGY_REST) {
            @read(&batch->stored, i, element->stored, stored);
        }
        flags = is_vertex ? @run_vertex(element, batch, i, arguments, results)
                          : element->run(routine, arguments, results);
        for (place = 0; place < 3; place++) {
            @write(&batch->results[place], i, sizes[place], @slot_size(routine, place, sizes[place]),
                   coordinates, results[place]);
        }
        @note(batch, i, flags);
    }
}
