/* Runs a routine on vectors of elements: arguments and results are those of the element's function. Returns the lanes
   whose results the scalar function must compute. */
typedef uint32_t @lanes_run(int32_t routine, const @lanes *const *arguments, @lanes *const *results);

/* Reads the inputs of as many elements as there are lanes. */
ENERGY_FN void @lanes_read(const @column *from, size_t first, int32_t count, @lanes *numbers) {
    int32_t j, lane;
    for (j = 0; j < count; j++) {
        const @real *place = from->numbers + first * from->per_element + (size_t)j * from->per_number;
        for (lane = 0; lane < @LANES; lane++) {
            numbers[j][lane] = place[(size_t)lane * from->per_element];
        }
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
            for (lane = 0; lane < @LANES; lane++) {
                const size_t element = first + (size_t)lane;
                const @real *vertex = from->numbers + 3U * (size_t)batch->stencils[element * (size_t)points + (size_t)point];
                numbers[3 * point][lane] = vertex[0];
                numbers[3 * point + 1][lane] = vertex[1];
                numbers[3 * point + 2][lane] = vertex[2];
            }
        }
    }
}

/* Writes a result of a vector of elements, if all of its lanes are stored as they are returned. Returns whether they
   are. */
ENERGY_FN int @lanes_write(const @result *to, size_t first, int32_t count, const @lanes *numbers) {
    @real *place = to->numbers + first * to->per_element;
    int32_t j, lane;
    if (to->layout != ENERGY_AS_RETURNED) {
        return 0;
    }
    for (lane = 0; lane < @LANES; lane++) {
        @real *row = place + (size_t)lane * to->per_element;
        const @real *from = (const @real *)(const void *)numbers + lane;
        for (j = 0; j < count; j++) {
            row[(size_t)j * to->per_number] = from[(size_t)j * @LANES];
        }
    }
    return 1;
}

/* Runs a routine of an element on many elements. `work` has room for all inputs and results of one vector of elements,
   `single` for those of one element. Results are written or added in the order of the elements. */
ENERGY_FN void @run_lanes(const @element *element, @lanes_run *run, int32_t routine, @batch *batch, @lanes *work,
                          @real *single) {
    const int32_t *sizes = element->sizes[routine];
    const int has_velocities =
        routine == ENERGY_HESSIAN_VECTOR || routine == ENERGY_FORCE || routine == ENERGY_JACOBIANS;
    @lanes *x = work, *v = x + element->coordinates, *parameters = v + element->coordinates;
    @lanes *stored = parameters + element->parameters;
    @lanes *results[3];
    const @lanes *arguments[4];
    const size_t whole = routine == ENERGY_REST ? 0U : batch->count - batch->count % @LANES;
    size_t first;
    int32_t place, j, lane;
    int is_written[3];
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
        for (place = 0; place < 3; place++) {
            is_written[place] = batch->results[place].numbers == NULL ||
                                @lanes_write(&batch->results[place], first, sizes[place], results[place]);
        }
        for (lane = 0; lane < @LANES; lane++) {
            if ((rare >> lane & 1U) != 0U) {
                @run_each(element, routine, batch, first + (size_t)lane, 1U, single);
                continue;
            }
            for (place = 0; place < 3; place++) {
                if (!is_written[place]) {
                    for (j = 0; j < sizes[place]; j++) {
                        single[j] = results[place][j][lane];
                    }
                    @write(&batch->results[place], first + (size_t)lane, sizes[place],
                           @slot_size(routine, place, sizes[place]), element->coordinates, single);
                }
            }
            if (batch->flags != NULL) {
                batch->flags[first + (size_t)lane] = 0U;
            }
        }
    }
    @run_each(element, routine, batch, whole, batch->count - whole, single);
}
