/* Runs a routine on vectors of elements: arguments and results are those of the element's function. Returns the lanes
   whose results the scalar function must compute. */
typedef uint32_t @lanes_run(int32_t routine, const @lanes *const *arguments, @lanes *const *results);

/* Loads rows of `count` numbers each, which are `stride` apart, as vectors. */
ENERGY_FN void @lanes_load_all(const @real *rows, size_t stride, int32_t count, @lanes *numbers) {
    int32_t j;
    if (count < @LANES) {
        for (j = 0; j < count; j++) {
            numbers[j] = @lanes_strided(rows + j, stride);
        }
        return;
    }
    for (j = 0; j + @LANES <= count; j += @LANES) {
        @lanes_load_rows(rows + j, stride, numbers + j);
    }
    /* The last square covers numbers again. */
    if (j < count) {
        @lanes_load_rows(rows + (count - @LANES), stride, numbers + (count - @LANES));
    }
}

/* Reads the inputs of as many elements as there are lanes. */
ENERGY_FN void @lanes_read(const @column *from, size_t first, int32_t count, @lanes *numbers) {
    const @real *place = from->numbers + first * from->per_element;
    int32_t j;
    if (from->per_number == 1U && from->per_element != 1U) {
        @lanes_load_all(place, from->per_element, count, numbers);
        return;
    }
    for (j = 0; j < count; j++) {
        numbers[j] = from->per_element == 1U ? @lanes_load(place) : @lanes_strided(place, from->per_element);
        place += from->per_number;
    }
}

ENERGY_FN void @lanes_read_points(const @batch *batch, const @column *from, size_t first, int32_t count,
                                  @lanes *numbers) {
    if (batch->stencils == NULL) {
        @lanes_read(from, first, count, numbers);
    } else {
        const int32_t points = count / 3;
        int32_t point, lane;
        for (point = 0; point < points; point++) {
            size_t places[@LANES];
            for (lane = 0; lane < @LANES; lane++) {
                places[lane] = 3U * (size_t)batch->stencils[(first + (size_t)lane) * (size_t)points + (size_t)point];
            }
            numbers[3 * point] = @lanes_gathered(from->numbers, places);
            numbers[3 * point + 1] = @lanes_gathered(from->numbers + 1, places);
            numbers[3 * point + 2] = @lanes_gathered(from->numbers + 2, places);
        }
    }
}

/* Copies less than sixteen numbers. Compilers would call a function for lengths that they do not know. */
ENERGY_FN void @copy_few(const @real *from, int32_t count, @real *to) {
    int32_t j = 0;
    if ((count & 8) != 0) {
        memcpy(to, from, 8 * sizeof *to);
        j = 8;
    }
    if ((count & 4) != 0) {
        memcpy(to + j, from + j, 4 * sizeof *to);
        j += 4;
    }
    if ((count & 2) != 0) {
        memcpy(to + j, from + j, 2 * sizeof *to);
        j += 2;
    }
    if ((count & 1) != 0) {
        to[j] = from[j];
    }
}

/* Stores vectors as rows of `count` numbers each, which are `stride` apart. */
ENERGY_FN void @lanes_store_all(const @lanes *numbers, int32_t count, @real *rows, size_t stride) {
    int32_t j, lane;
    if (count < 3) {
        for (j = 0; j < count; j++) {
            for (lane = 0; lane < @LANES; lane++) {
                rows[(size_t)lane * stride + (size_t)j] = numbers[j][lane];
            }
        }
    } else if (count >= @LANES) {
        for (j = 0; j + @LANES <= count; j += @LANES) {
            @lanes_store_rows(numbers + j, rows + j, stride);
        }
        /* The last square covers numbers again. */
        if (j < count) {
            @lanes_store_rows(numbers + (count - @LANES), rows + (count - @LANES), stride);
        }
    } else {
        @lanes square[@LANES];
        @real all[@LANES * @LANES];
        for (j = 0; j < @LANES; j++) {
            square[j] = numbers[j < count ? j : count - 1];
        }
        @lanes_store_rows(square, all, @LANES);
        for (j = 0; j < @LANES; j++) {
            @copy_few(all + j * @LANES, count, rows + (size_t)j * stride);
        }
    }
}

/* Asks for the cache lines of rows that will be written soon, if a row is longer than a few lines: rows that are written
   side by side are no pattern that processors foresee. There may be no such rows; then nothing happens. */
ENERGY_FN void @prefetch_rows(const @real *rows, int32_t count, size_t stride) {
    const size_t line = 64U, bytes = (size_t)count * sizeof *rows;
    size_t lane, byte;
    if (bytes <= 2U * line) {
        return;
    }
    for (lane = 0U; lane < @LANES; lane++) {
        const uintptr_t row = (uintptr_t)rows + lane * stride * sizeof *rows;
        for (byte = 0U; byte < bytes; byte += line) {
            __builtin_prefetch((const void *)(row + byte), 1);
        }
    }
}

/* Writes a result of a vector of elements. `block` is the number of numbers that have a slot together; `spare` has room
   for the result. */
ENERGY_FN void @lanes_write(const @result *to, size_t first, int32_t count, int32_t block, int32_t coordinates,
                            const @lanes *numbers, @lanes *spare) {
    @real *place;
    int32_t j, lane;
    if (to->numbers == NULL || count == 0) {
        return;
    }
    place = to->numbers + first * to->per_element;
    if (to->layout == ENERGY_AS_RETURNED && to->per_element == 1U) {
        for (j = 0; j < count; j++) {
            @lanes_store(numbers[j], place + (size_t)j * to->per_number);
        }
    } else if (to->layout == ENERGY_AS_RETURNED && to->per_number == 1U) {
        @lanes_store_all(numbers, count, place, to->per_element);
        @prefetch_rows((const @real *)((uintptr_t)place + @LANES * to->per_element * sizeof *place), count, to->per_element);
    } else {
        @real *rows = (@real *)(void *)spare;
        @lanes_store_all(numbers, count, rows, (size_t)count);
        for (lane = 0; lane < @LANES; lane++) {
            @write(to, first + (size_t)lane, count, block, coordinates, rows + lane * count);
        }
    }
}

/* Runs a routine of an element on many elements. `work` has room for all inputs and results of one vector of elements
   and for what is written of one result, `single` for inputs and results of one element. Results are written or added
   in the order of the elements. */
ENERGY_FN void @run_lanes(const @element *element, @lanes_run *run, int32_t routine, @batch *batch, @lanes *work,
                          @real *single) {
    /* Rest shapes and single vertices are computed one at a time: each vector would need one vertex for all its elements. */
    const int is_single = routine == ENERGY_REST || routine == ENERGY_VERTEX;
    const int32_t *sizes = element->sizes[is_single ? ENERGY_REST : routine];
    const int has_velocities =
        routine == ENERGY_HESSIAN_VECTOR || routine == ENERGY_FORCE || routine == ENERGY_JACOBIANS;
    @lanes *x = work, *v = x + element->coordinates, *parameters = v + element->coordinates;
    @lanes *stored = parameters + element->parameters;
    @lanes *results[3];
    const @lanes *arguments[4];
    const size_t whole = is_single ? 0U : batch->count - batch->count % @LANES;
    size_t first;
    int32_t place, j, lane;
    results[0] = stored + element->stored;
    results[1] = results[0] + sizes[0];
    results[2] = results[1] + sizes[1];
    arguments[0] = x;
    arguments[1] = has_velocities ? v : parameters;
    arguments[2] = has_velocities ? parameters : stored;
    arguments[3] = stored;
    for (first = 0U; first < whole; first += @LANES) {
        uint32_t rare;
        @lanes_read_points(batch, &batch->x, first, element->coordinates, x);
        if (has_velocities) {
            @lanes_read_points(batch, &batch->v, first, element->coordinates, v);
        }
        if (first == 0U || batch->parameters.per_element != 0U) {
            @lanes_read(&batch->parameters, first, element->parameters, parameters);
        }
        @lanes_read(&batch->stored, first, element->stored, stored);
        rare = run(routine, arguments, results);
        if (rare == 0U) {
            for (place = 0; place < 3; place++) {
                @lanes_write(&batch->results[place], first, sizes[place], @slot_size(routine, place, sizes[place]),
                             element->coordinates, results[place], results[2] + sizes[2]);
            }
            if (batch->flags != NULL) {
                memset(batch->flags + first, 0, @LANES);
            }
            continue;
        }
        for (lane = 0; lane < @LANES; lane++) {
            if ((rare >> lane & 1U) != 0U) {
                @run_each(element, routine, batch, first + (size_t)lane, 1U, single);
                continue;
            }
            for (place = 0; place < 3; place++) {
                for (j = 0; j < sizes[place]; j++) {
                    single[j] = results[place][j][lane];
                }
                @write(&batch->results[place], first + (size_t)lane, sizes[place],
                       @slot_size(routine, place, sizes[place]), element->coordinates, single);
            }
            if (batch->flags != NULL) {
                batch->flags[first + (size_t)lane] = 0U;
            }
        }
    }
    @run_each(element, routine, batch, whole, batch->count - whole, single);
}
