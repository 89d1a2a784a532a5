/* Runs a routine of an element on many elements of mixed unknowns, as many at a time as there are lanes. `work` and
   `rows` have room for all inputs and results of one vector of elements, `single` for those of one element. Results are
   written or added in the order of the elements. */
ENERGY_ROUTINE void @mixed_run_lanes(const @element *element, const @layout *layout, @lanes_run *run, int32_t routine,
                                     @mixed_batch *all, @lanes *work, @real *rows, @real *single) {
    const int is_single = routine <= ENERGY_REST || routine >= ENERGY_ROUTINES;
    const int32_t *sizes = element->sizes[is_single ? ENERGY_REST : routine];
    const int has_velocities = @reads_velocities(routine);
    const int32_t parameters = @moving(element) + element->coordinates, stored = parameters + element->parameters;
    const int32_t inputs = stored + element->stored;
    @lanes *results[3];
    @real *row;
    const @lanes *arguments[4];
    const size_t whole = is_single ? 0U : all->batch.count - all->batch.count % @LANES;
    size_t first;
    int32_t place, lane;
    results[0] = work + inputs;
    results[1] = results[0] + sizes[0];
    results[2] = results[1] + sizes[1];
    arguments[0] = work;
    arguments[1] = work + (has_velocities ? @moving(element) : parameters);
    arguments[2] = work + (has_velocities ? parameters : stored);
    arguments[3] = work + stored;
    for (first = 0U; first < whole; first += @LANES) {
        uint32_t rare;
        memset(rows, 0, (size_t)(@LANES * inputs) * sizeof *rows);
        for (lane = 0; lane < @LANES; lane++) {
            @read_all(element, layout, all, routine, first + (size_t)lane, rows + lane * inputs);
        }
        @lanes_load_all(rows, (size_t)inputs, inputs, work);
        rare = run(routine, arguments, results);
        /* Results follow each other, and so do their rows. */
        for (place = 0, row = rows; place < 3; row += @LANES * sizes[place], place++) {
            @lanes_store_all(results[place], sizes[place], row, (size_t)sizes[place]);
        }
        for (lane = 0; lane < @LANES; lane++) {
            if ((rare >> lane & 1U) != 0U) {
                @mixed_run_each(element, layout, routine, all, first + (size_t)lane, 1U, single);
                continue;
            }
            for (place = 0, row = rows; place < 3; row += @LANES * sizes[place], place++) {
                @mixed_write(layout, &all->batch.results[place], routine, place, first + (size_t)lane, sizes[place],
                             row + lane * sizes[place]);
            }
            @note(&all->batch, first + (size_t)lane, 0U);
        }
    }
    @mixed_run_each(element, layout, routine, all, whole, all->batch.count - whole, single);
}
