/* Evaluates records of inputs: for each, the number of an element, and its inputs. */
#include <stdio.h>
#include <stdlib.h>
#include "elements.h"

static REAL *numbers(FILE *file, int32_t count) {
    REAL *list = (REAL *)calloc((size_t)count + 1, sizeof *list);
    if (fread(list, sizeof *list, (size_t)count, file) != (size_t)count) {
        exit(2);
    }
    return list;
}

int main(int argc, char **argv) {
    FILE *file = fopen(argv[argc - 1], "rb");
    int32_t number;
    if (!energy_arithmetic()) {
        return 3;
    }
    while (fread(&number, sizeof number, 1, file) == 1) {
        const ELEMENT *element = elements[number];
        REAL *rest = numbers(file, element->rest), *parameters = numbers(file, element->parameters);
        REAL *x = numbers(file, element->coordinates), *v = numbers(file, element->coordinates);
        REAL *stored = (REAL *)calloc((size_t)element->stored + 1, sizeof *stored);
        const REAL *of_rest[2];
        int32_t routine;
        unsigned flags;
        of_rest[0] = rest;
        of_rest[1] = parameters;
        flags = element->run(ENERGY_REST, of_rest, &stored);
        fwrite(&flags, sizeof flags, 1, stdout);
        for (routine = ENERGY_REST + 1; routine < ENERGY_ROUTINES && flags == 0U; routine++) {
            const int32_t *sizes = element->sizes[routine];
            const int has_velocities = routine == ENERGY_HESSIAN_VECTOR || routine == ENERGY_FORCE || routine == ENERGY_JACOBIANS;
            const REAL *arguments[4];
            REAL *results[3];
            unsigned of_routine;
            int i;
            if (sizes[0] + sizes[1] + sizes[2] == 0) {
                continue;
            }
            arguments[0] = x;
            arguments[1] = has_velocities ? v : parameters;
            arguments[2] = has_velocities ? parameters : stored;
            arguments[3] = stored;
            for (i = 0; i < 3; i++) {
                results[i] = (REAL *)calloc((size_t)sizes[i] + 1, sizeof **results);
            }
            of_routine = element->run(routine, arguments, results);
            fwrite(&of_routine, sizeof of_routine, 1, stdout);
            for (i = 0; i < 3; i++) {
                fwrite(results[i], sizeof **results, (size_t)sizes[i], stdout);
                free(results[i]);
            }
        }
        for (routine = 0; element->vertex != NULL && routine < element->coordinates / 3 && flags == 0U; routine++) {
            REAL results[13];
            const unsigned of_vertex =
                element->vertex(routine, x, parameters, stored, results, results + 1, results + 4);
            fwrite(&of_vertex, sizeof of_vertex, 1, stdout);
            fwrite(results, sizeof *results, 13, stdout);
        }
        free(rest);
        free(parameters);
        free(x);
        free(v);
        free(stored);
    }
    return 0;
}
