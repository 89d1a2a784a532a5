"""Adjoints of generated functions are generated derivatives: for an energy, a force, a constraint and a residual."""

import numpy as np
import warp as wp

import energies as e

wp.config.quiet = True
wp.set_device("cpu")
N, real, vec = 64, wp.float64, wp.vec3d
mat33 = wp.types.matrix(shape=(3, 3), dtype=real)
random = np.random.default_rng(5)
DRAG = wp.constant(wp.float64(0.7))


@wp.kernel
def rest(u: wp.array2d(dtype=wp.vec2d), stored: wp.array2d(dtype=real), flags: wp.array(dtype=wp.int32)):
    i = wp.tid()
    flags[i] = e.st_vk_f64_rest(u[i, 0], u[i, 1], u[i, 2], real(3.0), real(2.0), stored[i])


@wp.kernel
def st_vk(x: wp.array2d(dtype=vec), mu: wp.array(dtype=real), stored: wp.array2d(dtype=real), U: wp.array(dtype=real)):
    i = wp.tid()
    U[i] = e.st_vk_f64_value(x[i, 0], x[i, 1], x[i, 2], real(3.0), mu[i], stored[i])


@wp.kernel
def st_vk_gradient(
    x: wp.array2d(dtype=vec), mu: wp.array(dtype=real), stored: wp.array2d(dtype=real), g: wp.array2d(dtype=vec)
):
    i = wp.tid()
    found = e.st_vk_f64_gradient(x[i, 0], x[i, 1], x[i, 2], real(3.0), mu[i], stored[i])
    for j in range(3):
        g[i, j] = found[j]


@wp.kernel(enable_backward=False)
def st_vk_hessian(
    x: wp.array2d(dtype=vec),
    mu: wp.array(dtype=real),
    stored: wp.array2d(dtype=real),
    g: wp.array2d(dtype=vec),
    blocks: wp.array2d(dtype=wp.mat33d),
    flags: wp.array(dtype=wp.int32),
):
    i = wp.tid()
    flags[i] = e.st_vk_f64_hessian(x[i, 0], x[i, 1], x[i, 2], real(3.0), mu[i], stored[i], g[i], blocks[i])


@wp.kernel
def st_vk_product(
    x: wp.array2d(dtype=vec),
    v: wp.array2d(dtype=vec),
    mu: wp.array(dtype=real),
    stored: wp.array2d(dtype=real),
    p: wp.array2d(dtype=vec),
):
    i = wp.tid()
    found = e.st_vk_f64_hessian_vector(
        x[i, 0], x[i, 1], x[i, 2], v[i, 0], v[i, 1], v[i, 2], real(3.0), mu[i], stored[i]
    )
    for j in range(3):
        p[i, j] = found[j]


@wp.kernel
def st_vk_vertex(
    x: wp.array2d(dtype=vec), mu: wp.array(dtype=real), stored: wp.array2d(dtype=real), g: wp.array2d(dtype=vec)
):
    i = wp.tid()
    for j in range(3):
        found = e.st_vk_f64_vertex(j, x[i, 0], x[i, 1], x[i, 2], real(3.0), mu[i], stored[i])
        g[i, j] = found[0]


@wp.kernel
def drag(x: wp.array2d(dtype=vec), v: wp.array2d(dtype=vec), f: wp.array2d(dtype=vec)):
    i = wp.tid()
    found = e.drag_f64_force(x[i, 0], x[i, 1], v[i, 0], v[i, 1], DRAG)
    f[i, 0] = found[0]
    f[i, 1] = found[1]


@wp.kernel
def lengths(x: wp.array2d(dtype=vec), c: wp.array2d(dtype=real)):
    i = wp.tid()
    found = e.lengths_f64_constraint(x[i, 0], x[i, 1], x[i, 2], real(1.0), real(0.0))
    c[i, 0] = found[0]
    c[i, 1] = found[1]


@wp.kernel
def circle(u: wp.array2d(dtype=real), r: wp.array2d(dtype=real)):
    i = wp.tid()
    found = e.circle_f64_residual(u[i, 0], u[i, 1], real(2.0))
    r[i, 0] = found[0]
    r[i, 1] = found[1]


@wp.kernel
def twisted(x: wp.array2d(dtype=vec), U: wp.array(dtype=real)):
    i = wp.tid()
    U[i] = e.twisted_f64_value(x[i, 0], x[i, 1], x[i, 2], real(2.0), real(0.5))


def back(kernel, inputs, output, incoming):
    """Runs a kernel and its adjoint. Returns the output and the adjoints of inputs that have one."""
    tape = wp.Tape()
    with tape:
        wp.launch(kernel, N, inputs=inputs, outputs=[output])
    tape.backward(grads={output: wp.array(incoming, dtype=output.dtype)})
    adjoints = [one.grad.numpy().copy() for one in inputs if one.requires_grad]
    tape.zero()
    return output.numpy().copy(), adjoints


def points(count):
    return wp.array(random.normal(size=(N, count, 3)), dtype=vec, requires_grad=True)


def zeros(*shape, of=real):
    return wp.zeros(shape, dtype=of, requires_grad=True)


def differences(kernel, inputs, number, shape, of=real, h=1e-6):
    """Central differences of a kernel's output by all numbers of one input, one input number at a time."""
    x = inputs[number].numpy()
    columns = []
    for k in range(x.reshape(N, -1).shape[1]):
        both = []
        for sign in (1.0, -1.0):
            moved = x.copy().reshape(N, -1)
            moved[:, k] += sign * h
            changed = list(inputs)
            changed[number] = wp.array(moved.reshape(x.shape), dtype=inputs[number].dtype)
            out = wp.zeros(shape, dtype=of)
            wp.launch(kernel, N, inputs=changed, outputs=[out])
            both.append(out.numpy().reshape(N, -1))
        columns.append((both[0] - both[1]) / (2 * h))
    return np.stack(columns, axis=2)


def close(a, b, tolerance, what):
    error = np.abs(a - b).max() / np.abs(b).max()
    assert error < tolerance, (what, error)
    print(f"{what}: {error:.1e}")


x = points(3)
sheet = np.tile([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]], (N, 1, 1)) + 0.1 * random.normal(size=(N, 3, 2))
stored, flags = wp.zeros((N, e.ELEMENTS["st_vk_f64"]["stored"]), dtype=real), wp.zeros(N, dtype=wp.int32)
wp.launch(rest, N, inputs=[wp.array(sheet, dtype=wp.vec2d), stored, flags])
assert not flags.numpy().any()
constant = wp.array(np.full(N, 2.0), dtype=real)

_, (adjoint,) = back(st_vk, [x, constant, stored], zeros(N), np.ones(N))
v = random.normal(size=(N, 3, 3))
gradient, (product,) = back(st_vk_gradient, [x, constant, stored], zeros(N, 3, of=vec), v)
assert (adjoint == gradient).all(), "the adjoint of the value has other bits than the gradient"
g, blocks = wp.zeros((N, 3), dtype=vec), wp.zeros((N, 9), dtype=wp.mat33d)
wp.launch(st_vk_hessian, N, inputs=[x, constant, stored, g, blocks, flags])
hessian = blocks.numpy().reshape(N, 3, 3, 3, 3).transpose(0, 1, 3, 2, 4).reshape(N, 9, 9)
assert (hessian == hessian.transpose(0, 2, 1)).all()
close(product.reshape(N, 9), np.einsum("nij,nj->ni", hessian, v.reshape(N, 9)), 1e-13, "Hessian-vector product by tape")
other = wp.array(v, dtype=vec, requires_grad=True)
x.requires_grad = False
found, (by_vector,) = back(st_vk_product, [x, other, constant, stored], zeros(N, 3, of=vec), v)
assert (found == product).all() and (by_vector == product).all(), "products differ"
x.requires_grad = True

# What is not known is not a number, and only where it is asked for.
asked = wp.array(np.full(N, 2.0), dtype=real, requires_grad=True)
_, (adjoint, by_parameter) = back(st_vk, [x, asked, stored], zeros(N), np.arange(N) % 2)
assert np.isfinite(adjoint).all() and (np.isnan(by_parameter) == (np.arange(N) % 2 == 1)).all()
of_vertices, (adjoint,) = back(st_vk_vertex, [x, constant, stored], zeros(N, 3, of=vec), v)
assert np.isnan(adjoint).all()
close(of_vertices, gradient, 1e-13, "gradients of vertices")

positions, velocities = points(2), points(2)
incoming = random.normal(size=(N, 2, 3))
_, adjoints = back(drag, [positions, velocities], zeros(N, 2, of=vec), incoming)
for number, (adjoint, what) in enumerate(zip(adjoints, ("force by positions", "force by velocities"), strict=True)):
    truth = differences(drag, [positions, velocities], number, (N, 2), vec)
    close(adjoint.reshape(N, 6), np.einsum("nij,ni->nj", truth, incoming.reshape(N, 6)), 1e-8, what)

x, incoming = points(3), random.normal(size=(N, 2))
_, (adjoint,) = back(lengths, [x], zeros(N, 2), incoming)
truth = differences(lengths, [x], 0, (N, 2))
close(adjoint.reshape(N, 9), np.einsum("nij,ni->nj", truth, incoming), 1e-8, "constraint")

u = wp.array(random.normal(size=(N, 2)), dtype=real, requires_grad=True)
_, (adjoint,) = back(circle, [u], zeros(N, 2), incoming)
truth = differences(circle, [u], 0, (N, 2))
close(adjoint, np.einsum("nij,ni->nj", truth, incoming), 1e-8, "residual")

# Points that coincide run the general path inside a kernel: the spring has a kink there, and no NaN comes back.
together = np.zeros((N, 3, 3))
_, (adjoint,) = back(twisted, [wp.array(together, dtype=vec, requires_grad=True)], zeros(N), np.ones(N))
assert np.isfinite(adjoint).all()
print("adjoints agree")
