/* Entry (row, column) of a symmetric matrix of 3x3 blocks in its triangle of blocks. */
ENERGY_FN int32_t @in_blocks(int32_t points, int32_t row, int32_t column) {
    const int32_t i = row / 3 < column / 3 ? row / 3 : column / 3, j = row / 3 < column / 3 ? column / 3 : row / 3;
    const int32_t r = row / 3 <= column / 3 ? row % 3 : column % 3, c = row / 3 <= column / 3 ? column % 3 : row % 3;
    return 9 * (i * points - i * (i + 1) / 2 + j) + 3 * r + c;
}

/* Writes a triangle of 3x3 blocks as a full matrix, row by row. */
ENERGY_FN void @full_matrix(int32_t points, const @real *triangle, @real *matrix) {
    const int32_t n = 3 * points;
    const @real *block = triangle;
    int32_t i, j, r, c;
    for (i = 0; i < n; i += 3) {
        for (j = i; j < n; j += 3) {
            for (r = 0; r < 3; r++) {
                for (c = 0; c < 3; c++) {
                    matrix[(i + r) * n + j + c] = block[3 * r + c];
                    if (i < j) {
                        matrix[(j + c) * n + i + r] = block[3 * r + c];
                    }
                }
            }
            block += 9;
        }
    }
}

/* One rotation of Jacobi's method in the plane of p and q: makes b[p][q] zero. The rows of v turn with it. */
ENERGY_FN void @rotate(@real *b, @real *v, int32_t n, int32_t p, int32_t q) {
    const @real difference = @sub(b[q * n + q], b[p * n + p]), twice = @add(b[p * n + q], b[p * n + q]);
    const @real theta = @div(difference, twice), size = @abs(theta);
    const @real t = @div(theta < 0.0@ ? -1.0@ : 1.0@, @add(size, @sqrt(@mul_add(theta, theta, 1.0@))));
    const @real c = @div(1.0@, @sqrt(@mul_add(t, t, 1.0@))), s = @mul(t, c);
    int32_t k;
    for (k = 0; k < n; k++) {
        const @real x = b[k * n + p], y = b[k * n + q];
        b[k * n + p] = @mul_add(c, x, -@mul(s, y));
        b[k * n + q] = @mul_add(s, x, @mul(c, y));
    }
    for (k = 0; k < n; k++) {
        const @real x = b[p * n + k], y = b[q * n + k], f = v[p * n + k], g = v[q * n + k];
        b[p * n + k] = @mul_add(c, x, -@mul(s, y));
        b[q * n + k] = @mul_add(s, x, @mul(c, y));
        v[p * n + k] = @mul_add(c, f, -@mul(s, g));
        v[q * n + k] = @mul_add(s, f, @mul(c, g));
    }
}

/* Replaces a symmetric n x n matrix by the nearest positive semi-definite one: negative eigenvalues become 0. `work` has
   room for 2 n^2 numbers. Returns whether the matrix changed; one with numbers that are not finite does not. */
ENERGY_RARE int @project(@real *a, @real *work, int32_t n) {
    @real *b = work, *v = work + n * n;
    @real largest = 0.0@;
    int32_t sweep, p, q, k, changed = 0, rotations = 1;
    for (k = 0; k < n * n; k++) {
        b[k] = a[k];
        v[k] = k / n == k % n ? 1.0@ : 0.0@;
        largest = @max(largest, @abs(a[k]));
    }
    if (!@are_finite(a, n * n) || largest == 0.0@) {
        return 0;
    }
    for (sweep = 0; sweep < 40 && rotations > 0; sweep++) {
        rotations = 0;
        for (p = 0; p < n; p++) {
            for (q = p + 1; q < n; q++) {
                if (@abs(b[p * n + q]) > @mul(@power_of_two(-@DIGITS - 2), largest)) {
                    @rotate(b, v, n, p, q);
                    rotations++;
                }
            }
        }
    }
    for (k = 0; k < n; k++) {
        const @real eigenvalue = b[k * n + k];
        if (eigenvalue < 0.0@) {
            changed = 1;
            for (p = 0; p < n; p++) {
                for (q = 0; q < n; q++) {
                    a[p * n + q] = @mul_add(@mul(-eigenvalue, v[k * n + p]), v[k * n + q], a[p * n + q]);
                }
            }
        }
    }
    /* Both triangles are rounded alike. */
    for (p = 0; p < n && changed; p++) {
        for (q = 0; q < p; q++) {
            a[p * n + q] = a[q * n + p];
        }
    }
    return changed;
}
