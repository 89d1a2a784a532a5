/* Kinds of unknowns. All unknowns of a kind are stored together, one after the other; a motion is a point and a
   rotation. */
#ifndef ENERGY_UNKNOWNS
#define ENERGY_UNKNOWNS
enum energy_kind {
    ENERGY_SCALAR,
    ENERGY_VEC2,
    ENERGY_VEC3,
    ENERGY_VEC4,
    ENERGY_POINT2,
    ENERGY_POINT,
    /* Four numbers, a unit quaternion w, x, y, z, which move by three increments: exp(increment) times the
       quaternion. */
    ENERGY_ROTATION,
    ENERGY_KINDS,
    /* Added to the kind of an unknown that all elements share. */
    ENERGY_SHARED = 16
};
/* How the numbers of a result are arranged. */
enum energy_form { ENERGY_NUMBERS, ENERGY_ROWS, ENERGY_SQUARE, ENERGY_TRIANGLES };
#endif

/* The unknowns and the state of an element. */
typedef struct {
    /* Number of unknowns, and in how many coordinates they move: the columns of derivatives. */
    int32_t unknowns, increments;
    /* Numbers of the state: the last ones of the parameters. */
    int32_t state;
    /* Whether matrices are 3x3 blocks, since all unknowns are points of the element. Others are flat, row by row. */
    int32_t is_in_blocks;
    /* The kind of each unknown, in declared order. */
    const unsigned char *kinds;
} @layout;

/* The unknowns of a kind, and those that each element has: as many indices as it has unknowns of the kind, in declared
   order, one element after the other. */
typedef struct {
    const @real *numbers;
    /* Vectors or velocities: a number for each increment. NULL if no routine needs them. */
    const @real *velocities;
    const uint32_t *indices;
} @unknowns;

/* Elements to evaluate.

   Unknowns are gathered by `unknowns` and `shared`. If `batch.x` has numbers, it has all unknowns of each element
   instead, in declared order, and `batch.v` their velocities; `batch.stencils` and `batch.points` are not read.

   Slots of results (ENERGY_ADDED, ENERGY_STORED) are places of numbers, not of blocks, as unknowns differ in size:
   - a gradient has a slot for each unknown, that of its first increment;
   - a triangle has a slot for each pair of unknowns a <= b, where the block of both begins, row by row; those on the
     diagonal are whole;
   - by_position and by_velocity have a slot for each pair (a, b);
   - other Jacobians have a slot for each row and unknown; other results one for each number.
   With ENERGY_FULL and ENERGY_TRIANGLE, triangles are whole matrices or upper triangles of numbers, row by row. */
typedef struct {
    @batch batch;
    @unknowns unknowns[ENERGY_KINDS];
    /* Numbers and velocities of the unknowns that all elements share, in declared order. */
    const @real *shared, *shared_velocities;
    /* The state of each element. If it has no numbers, the state follows the parameters in `batch.parameters`.
       ENERGY_NEXT may write its result to the same array: each element reads its old state before it writes the new
       one. */
    @column state;
} @mixed_batch;

/* Numbers that hold an unknown, and in how many coordinates it moves. */
ENERGY_FN int32_t @kind_size(int32_t kind, int of_increments) {
    switch (kind % ENERGY_SHARED) {
    case ENERGY_SCALAR:
        return 1;
    case ENERGY_VEC2:
    case ENERGY_POINT2:
        return 2;
    case ENERGY_VEC4:
        return 4;
    case ENERGY_ROTATION:
        return of_increments ? 3 : 4;
    default:
        return 3;
    }
}

/* Reads the unknowns of an element, or their velocities. */
ENERGY_ROUTINE void @read_unknowns(const @layout *layout, const @mixed_batch *all, int of_increments, size_t element,
                                   @real *numbers) {
    const @column *own = of_increments ? &all->batch.v : &all->batch.x;
    const @real *shared = of_increments ? all->shared_velocities : all->shared;
    size_t counts[ENERGY_KINDS], read[ENERGY_KINDS];
    int32_t unknown, at = 0;
    memset(counts, 0, sizeof counts);
    memset(read, 0, sizeof read);
    for (unknown = 0; unknown < layout->unknowns; unknown++) {
        if (layout->kinds[unknown] < ENERGY_SHARED) {
            counts[layout->kinds[unknown]]++;
        }
    }
    for (unknown = 0; unknown < layout->unknowns; unknown++) {
        const int32_t kind = layout->kinds[unknown] % ENERGY_SHARED;
        const int32_t size = @kind_size(kind, of_increments);
        const @real *from;
        int32_t j;
        if (own->numbers != NULL) {
            from = NULL;
        } else if (layout->kinds[unknown] >= ENERGY_SHARED) {
            from = shared;
            shared += size;
        } else {
            const @unknowns *of_kind = &all->unknowns[kind];
            const uint32_t index = of_kind->indices[element * counts[kind] + read[kind]];
            from = (of_increments ? of_kind->velocities : of_kind->numbers) + (size_t)index * (size_t)size;
            read[kind]++;
        }
        for (j = 0; j < size; j++) {
            const size_t place = element * own->per_element + (size_t)at * own->per_number;
            numbers[at] = from == NULL ? own->numbers[place] : from[j];
            at++;
        }
    }
}

/* Reads the parameters of an element, `count` with its state. */
ENERGY_ROUTINE void @read_parameters(const @layout *layout, const @mixed_batch *all, size_t element, int32_t count,
                                     @real *numbers) {
    const int is_apart = all->state.numbers != NULL;
    @read(&all->batch.parameters, element, is_apart ? count - layout->state : count, numbers);
    if (is_apart) {
        @read(&all->state, element, layout->state, numbers + (count - layout->state));
    }
}

/* Stores or adds a number at its slot. */
ENERGY_FN void @put(const @result *to, uint32_t slot, int32_t j, @real number) {
    @real *place = to->numbers + (size_t)slot + (size_t)j;
    if (slot == ENERGY_NO_SLOT) {
        return;
    }
    if (to->layout == ENERGY_STORED) {
        *place = number;
    } else {
#if defined(__CUDA_ARCH__)
        atomicAdd(place, number);
#else
        *place = *place + number;
#endif
    }
}

/* Entry (row, column) of a symmetric matrix in its triangle. */
ENERGY_FN int32_t @in_triangle(const @layout *layout, int32_t row, int32_t column) {
    const int32_t first = row < column ? row : column, last = row < column ? column : row;
    return layout->is_in_blocks ? @in_blocks(layout->increments / 3, row, column)
                                : first * layout->increments - first * (first + 1) / 2 + last;
}

/* Entry (row, column) of a matrix of all increments. */
ENERGY_FN int32_t @in_square(const @layout *layout, int32_t row, int32_t column) {
    return layout->is_in_blocks
               ? 9 * (row / 3 * (layout->increments / 3) + column / 3) + 3 * (row % 3) + column % 3
               : row * layout->increments + column;
}

ENERGY_FN enum energy_form @form_of(int32_t routine, int32_t place) {
    switch (routine) {
    case ENERGY_GRADIENT:
    case ENERGY_CONSTRAINT_JACOBIAN:
    case ENERGY_JACOBIAN:
    case ENERGY_NEXT_JACOBIANS:
        return place == 1 ? ENERGY_ROWS : ENERGY_NUMBERS;
    case ENERGY_HESSIAN:
    case ENERGY_GAUSS_NEWTON:
    case ENERGY_CONSTRAINT_HESSIAN:
        return place == 0 ? ENERGY_NUMBERS : (place == 1 ? ENERGY_ROWS : ENERGY_TRIANGLES);
    case ENERGY_HESSIAN_VECTOR:
    case ENERGY_FORCE:
        return ENERGY_ROWS;
    case ENERGY_JACOBIANS:
        return place == 0 ? ENERGY_ROWS : ENERGY_SQUARE;
    default:
        return ENERGY_NUMBERS;
    }
}

/* Writes the blocks of a matrix to their slots. Returns the next slot. */
ENERGY_ROUTINE const uint32_t *@put_blocks(const @layout *layout, const @result *to, int is_triangle,
                                           const uint32_t *slots, const @real *numbers) {
    int32_t a, b, row, column, first_row = 0;
    for (a = 0; a < layout->unknowns; a++) {
        const int32_t rows = @kind_size(layout->kinds[a], 1);
        int32_t first_column = 0;
        for (b = 0; b < layout->unknowns; b++) {
            const int32_t columns = @kind_size(layout->kinds[b], 1);
            for (row = 0; row < rows && (!is_triangle || a <= b); row++) {
                for (column = 0; column < columns; column++) {
                    const int32_t i = first_row + row, j = first_column + column;
                    @put(to, *slots, row * columns + column,
                         numbers[is_triangle ? @in_triangle(layout, i, j) : @in_square(layout, i, j)]);
                }
            }
            slots += !is_triangle || a <= b ? 1 : 0;
            first_column += columns;
        }
        first_row += rows;
    }
    return slots;
}

/* Writes rows of increments to their slots: one for each row and unknown. */
ENERGY_ROUTINE void @put_rows(const @layout *layout, const @result *to, const uint32_t *slots, int32_t count,
                              const @real *numbers) {
    int32_t number = 0, unknown = 0, j;
    while (number < count) {
        const int32_t size = @kind_size(layout->kinds[unknown], 1);
        for (j = 0; j < size; j++) {
            @put(to, *slots, j, numbers[number + j]);
        }
        slots++;
        number += size;
        unknown = unknown + 1 < layout->unknowns ? unknown + 1 : 0;
    }
}

/* Numbers of one triangle. */
ENERGY_FN int32_t @triangle_size(const @layout *layout) {
    return @in_triangle(layout, layout->increments - 1, layout->increments - 1) + 1;
}

/* Writes triangles as whole matrices, or as upper triangles of numbers. */
ENERGY_ROUTINE void @write_triangles(const @layout *layout, const @result *to, size_t element, int32_t count,
                                     const @real *numbers) {
    const int32_t size = @triangle_size(layout);
    int32_t first, row, column, j = 0;
    for (first = 0; first < count; first += size) {
        for (row = 0; row < layout->increments; row++) {
            for (column = to->layout == ENERGY_FULL ? 0 : row; column < layout->increments; column++) {
                to->numbers[element * to->per_element + (size_t)j * to->per_number] =
                    numbers[first + @in_triangle(layout, row, column)];
                j++;
            }
        }
    }
}

/* Writes or adds a result of an element. */
ENERGY_ROUTINE void @mixed_write(const @layout *layout, const @result *to, int32_t routine, int32_t place,
                                 size_t element, int32_t count, const @real *numbers) {
    const enum energy_form form = @form_of(routine, place);
    int32_t j;
    if (to->numbers == NULL) {
        return;
    }
    if (to->layout == ENERGY_ADDED || to->layout == ENERGY_STORED) {
        const uint32_t *slots = to->slots + element * to->per_element;
        if (form == ENERGY_SQUARE && count > 0) {
            (void)@put_blocks(layout, to, 0, slots, numbers);
        } else if (form == ENERGY_TRIANGLES) {
            for (j = 0; j < count; j += @triangle_size(layout)) {
                slots = @put_blocks(layout, to, 1, slots, numbers + j);
            }
        } else if (form == ENERGY_ROWS) {
            @put_rows(layout, to, slots, count, numbers);
        } else {
            for (j = 0; j < count; j++) {
                @put(to, slots[j], 0, numbers[j]);
            }
        }
    } else if (form == ENERGY_TRIANGLES && to->layout != ENERGY_AS_RETURNED) {
        @write_triangles(layout, to, element, count, numbers);
    } else {
        for (j = 0; j < count; j++) {
            to->numbers[element * to->per_element + (size_t)j * to->per_number] = numbers[j];
        }
    }
}

/* Whether a routine reads a vector or velocities. */
ENERGY_FN int @reads_velocities(int32_t routine) {
    return routine == ENERGY_HESSIAN_VECTOR || routine == ENERGY_FORCE || routine == ENERGY_JACOBIANS;
}

/* Reads all inputs of an element: unknowns or rest shape, velocities, parameters with the state, stored numbers. */
ENERGY_ROUTINE void @read_all(const @element *element, const @layout *layout, const @mixed_batch *all, int32_t routine,
                              size_t i, @real *work) {
    @real *v = work + @moving(element), *parameters = v + element->coordinates;
    if (routine == ENERGY_REST) {
        @read(&all->batch.x, i, element->rest, work);
        /* The rest shape does not depend on the state. */
        @read(&all->batch.parameters, i, element->parameters - layout->state, parameters);
        return;
    }
    @read_unknowns(layout, all, 0, i, work);
    if (@reads_velocities(routine)) {
        @read_unknowns(layout, all, 1, i, v);
    }
    @read_parameters(layout, all, i, element->parameters, parameters);
    @read(&all->batch.stored, i, element->stored, parameters + element->parameters);
}

/* Runs a routine of an element on many elements, in order. For ENERGY_REST, `batch.x` is the rest shape. `work` has
   room for all inputs and results of one. */
ENERGY_ROUTINE void @mixed_run_each(const @element *element, const @layout *layout, int32_t routine, @mixed_batch *all,
                                    size_t first, size_t count, @real *work) {
    const int32_t none[3] = {0, 0, 0};
    const int is_known = routine >= 0 && routine < ENERGY_ROUTINES;
    const int32_t *sizes = is_known ? element->sizes[routine] : none;
    const int has_velocities = @reads_velocities(routine);
    @real *v = work + @moving(element), *parameters = v + element->coordinates;
    @real *stored = parameters + element->parameters;
    @real *results[3];
    const @real *arguments[4];
    size_t i;
    int32_t place;
    results[0] = stored + element->stored;
    results[1] = results[0] + sizes[0];
    results[2] = results[1] + sizes[1];
    arguments[0] = work;
    arguments[1] = has_velocities ? v : parameters;
    arguments[2] = has_velocities ? parameters : stored;
    arguments[3] = stored;
    for (i = first; i < first + count; i++) {
        unsigned flags;
        @read_all(element, layout, all, routine, i, work);
        flags = element->run(routine, arguments, results);
        for (place = 0; place < 3; place++) {
            @mixed_write(layout, &all->batch.results[place], routine, place, i, sizes[place], results[place]);
        }
        @note(&all->batch, i, flags);
    }
}
