/* Reads the number of an element and its inputs, as often as there are; writes the Hessian, full, and the projected one. */
#include <stdio.h>
#include "elements.h"

int main(int argc, char **argv) {
    FILE *file = fopen(argv[argc - 1], "rb");
    int32_t number;
    while (fread(&number, sizeof number, 1, file) == 1) {
        double rest[8], parameters[8], x[12], stored[32], value, gradient[12], triangle[90], matrix[144];
        const int32_t n = number == 0 ? 12 : 9;
        unsigned flags = 0U;
        if (fread(rest, sizeof *rest, number == 0 ? 0 : 6, file) + fread(parameters, sizeof *parameters, 2, file) +
                fread(x, sizeof *x, (size_t)n, file) !=
            (size_t)(number == 0 ? 0 : 6) + 2U + (size_t)n) {
            return 2;
        }
        if (number == 0) {
            flags |= quadratic_hinge_f64_hessian(x, parameters, stored, &value, gradient, triangle);
        } else {
            flags |= st_vk_f64_rest(rest, parameters, stored);
            flags |= st_vk_f64_hessian(x, parameters, stored, &value, gradient, triangle);
        }
        energy_f64_full_matrix(n / 3, triangle, matrix);
        fwrite(matrix, sizeof *matrix, (size_t)(n * n), stdout);
        flags |= number == 0 ? quadratic_hinge_f64_projected_hessian(x, parameters, stored, &value, gradient, matrix)
                             : st_vk_f64_projected_hessian(x, parameters, stored, &value, gradient, matrix);
        fwrite(matrix, sizeof *matrix, (size_t)(n * n), stdout);
        if (flags != 0U) {
            return 3;
        }
    }
    return 0;
}
