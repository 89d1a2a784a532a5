"""Adjoints of functions of mixed unknowns are differences of their results, with rotations that stay of unit length."""

import numpy as np
import warp as wp

import energies as e

wp.config.quiet = True
wp.set_device("cpu")
N, real, vec, quat = 16, wp.float64, wp.vec3d, wp.vec4d
random = np.random.default_rng(7)
ARM = wp.constant(vec(0.3, -0.2, 0.5))


@wp.kernel
def value(x: wp.array(dtype=vec), q: wp.array(dtype=quat), y: wp.array(dtype=vec), U: wp.array(dtype=real)):
    i = wp.tid()
    U[i] = e.arm_f64_value(x[i], q[i], y[i], ARM, real(2.0))


@wp.kernel
def gradient(x: wp.array(dtype=vec), q: wp.array(dtype=quat), y: wp.array(dtype=vec), g: wp.array2d(dtype=real)):
    i = wp.tid()
    found = e.arm_f64_gradient(x[i], q[i], y[i], ARM, real(2.0))
    for j in range(9):
        g[i, j] = found[j]


@wp.kernel
def thrust(
    x: wp.array(dtype=vec),
    q: wp.array(dtype=quat),
    v: wp.array(dtype=vec),
    w: wp.array(dtype=vec),
    f: wp.array2d(dtype=real),
):
    i = wp.tid()
    found = e.thrust_f64_force(x[i], q[i], v[i], w[i], ARM, real(0.7))
    for j in range(6):
        f[i, j] = found[j]


@wp.kernel
def anchor(a: wp.array(dtype=vec), q: wp.array(dtype=quat), y: wp.array(dtype=vec), c: wp.array2d(dtype=real)):
    i = wp.tid()
    found = e.anchor_f64_constraint(a[i], q[i], y[i], ARM, real(1.0), real(0.0))
    for j in range(3):
        c[i, j] = found[j]


@wp.kernel
def turning(
    s: wp.array(dtype=real), q: wp.array(dtype=quat), b: wp.array(dtype=vec), r: wp.array2d(dtype=real)
):
    i = wp.tid()
    found = e.turning_f64_residual(s[i], q[i], real(0.5), b[i])
    for j in range(2):
        r[i, j] = found[j]


def turned(q, delta):
    """exp(delta) q, which turns by the length of delta."""
    angle = np.linalg.norm(delta, axis=1, keepdims=True)
    w, v = np.cos(angle / 2), np.sinc(angle / (2 * np.pi)) / 2 * delta
    return product(w, v, q)


def product(w, v, q):
    a, b = q[:, :1], q[:, 1:]
    return np.hstack([w * a - (v * b).sum(1, keepdims=True), w * b + a * v + np.cross(v, b)])


def moved(array, axis, step):
    numbers = array.numpy()
    if numbers.shape[1:] == (4,):
        delta = np.zeros((N, 3))
        delta[:, axis] = step
        numbers = turned(numbers, delta)
    else:
        numbers = numbers.reshape(N, -1).copy()
        numbers[:, axis] += step
    return wp.array(numbers.reshape(array.numpy().shape), dtype=array.dtype)


def check(what, kernel, inputs, columns, h=1e-6):
    shape = (N,) if columns == 1 else (N, columns)
    output = wp.zeros(shape, dtype=real, requires_grad=True)
    incoming = random.normal(size=shape)
    tape = wp.Tape()
    with tape:
        wp.launch(kernel, N, inputs=inputs, outputs=[output])
    tape.backward(grads={output: wp.array(incoming, dtype=real)})
    for number, one in enumerate(inputs):
        if not one.requires_grad:
            continue
        adjoint = one.grad.numpy().reshape(N, -1)
        is_rotation = one.dtype is quat
        for axis in range(3 if is_rotation else adjoint.shape[1]):
            both = []
            for sign in (1.0, -1.0):
                changed = list(inputs)
                changed[number] = moved(one, axis, sign * h)
                found = wp.zeros(shape, dtype=real)
                wp.launch(kernel, N, inputs=changed, outputs=[found])
                both.append(found.numpy())
            truth = ((both[0] - both[1]) / (2 * h) * incoming).reshape(N, -1).sum(1)
            own = adjoint[:, axis]
            if is_rotation:
                # The change of q is (0, delta) q / 2.
                delta = np.zeros((N, 3))
                delta[:, axis] = 0.5
                own = (adjoint * product(np.zeros((N, 1)), delta, one.numpy())).sum(1)
            error = np.abs(own - truth).max() / (1.0 + np.abs(truth).max())
            assert error < 1e-8, (what, number, axis, error)
        if is_rotation:
            assert np.abs((adjoint * one.numpy()).sum(1)).max() < 1e-12, (what, "not tangent")
    print(f"{what}: adjoints agree")


def vectors():
    return wp.array(random.normal(size=(N, 3)), dtype=vec, requires_grad=True)


q = random.normal(size=(N, 4))
rotation = wp.array(q / np.linalg.norm(q, axis=1, keepdims=True), dtype=quat, requires_grad=True)
check("value", value, [vectors(), rotation, vectors()], 1)
rotation.grad.zero_()
check("gradient", gradient, [vectors(), rotation, vectors()], 9)
rotation.grad.zero_()
check("force", thrust, [vectors(), rotation, vectors(), vectors()], 6)
rotation.grad.zero_()
check("constraint", anchor, [vectors(), rotation, vectors()], 3)
rotation.grad.zero_()
state = wp.array(random.normal(size=(N, 3)), dtype=vec)
scalars = wp.array(random.normal(size=N), dtype=real, requires_grad=True)
check("residual", turning, [scalars, rotation, state], 2)
