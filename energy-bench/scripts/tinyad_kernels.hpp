// Textbook formulas of the benchmark's kernels over any scalar type, differentiated by TinyAD.
//
// `symbolic_kernels.py --tinyad` compiles this file. `evaluate` reads the constants, then the unknowns of one element.
// It writes value, gradient and the upper triangle of 3×3 Hessian blocks (K5: residual and Jacobian).

#include <array>
#include <cmath>

#include <TinyAD/Scalar.hh>

namespace kernels {

template <class T>
using Vector = std::array<T, 3>;

template <class A, class B>
auto sub(const Vector<A>& a, const Vector<B>& b) {
    return Vector<decltype(a[0] - b[0])>{a[0] - b[0], a[1] - b[1], a[2] - b[2]};
}

template <class A, class B>
auto dot(const Vector<A>& a, const Vector<B>& b) {
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

template <class A, class B>
auto cross(const Vector<A>& a, const Vector<B>& b) {
    using C = decltype(a[0] * b[0]);
    return Vector<C>{a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

template <class T>
T norm(const Vector<T>& a) {
    using std::sqrt;
    return sqrt(dot(a, a));
}

template <class T>
T square(const T& a) {
    return a * a;
}

template <class T>
Vector<T> point(const T* x, int index) {
    return {x[3 * index], x[3 * index + 1], x[3 * index + 2]};
}

struct Spring {
    static constexpr int constants = 2, unknowns = 6;

    template <class T>
    static T value(const double* c, const T* x) {
        return c[0] / 2 * square<T>(norm(sub(point(x, 1), point(x, 0))) - c[1]);
    }
};

struct HairBend {
    static constexpr int constants = 1, unknowns = 9;

    template <class T>
    static T value(const double* c, const T* x) {
        const auto a = sub(point(x, 1), point(x, 0)), b = sub(point(x, 2), point(x, 1));
        return c[0] / 2 * (1.0 - dot(a, b) / (norm(a) * norm(b)));
    }
};

struct Hinge {
    static constexpr int constants = 2, unknowns = 12;

    template <class T>
    static T value(const double* c, const T* x) {
        using std::atan2;
        const auto start = point(x, 2);
        const auto e = sub(point(x, 3), start), a = sub(point(x, 0), start), b = sub(point(x, 1), start);
        const auto n1 = cross(e, a), n2 = cross(b, e);
        const T sine = dot(cross(n1, n2), e), cosine = dot(n1, n2) * norm(e);
        return c[0] * square<T>(atan2(sine, cosine) - c[1]);
    }
};

struct StVK {
    static constexpr int constants = 7, unknowns = 9;

    template <class T>
    static T value(const double* c, const T* x) {
        const double lambda = c[0], mu = c[1], area = c[2];
        const auto d1 = sub(point(x, 1), point(x, 0)), d2 = sub(point(x, 2), point(x, 0));
        Vector<T> f1, f2;
        for (int i = 0; i < 3; i++) {
            f1[i] = d1[i] * c[3] + d2[i] * c[5];
            f2[i] = d1[i] * c[4] + d2[i] * c[6];
        }
        const T e11 = (dot(f1, f1) - 1.0) / 2.0, e12 = dot(f1, f2) / 2.0, e22 = (dot(f2, f2) - 1.0) / 2.0;
        return area * (mu * (square(e11) + 2.0 * square(e12) + square(e22)) + lambda / 2 * square<T>(e11 + e22));
    }
};

template <class T>
struct Quaternion {
    T real;
    Vector<T> imaginary;
};

template <class T>
Quaternion<T> product(const Quaternion<T>& a, const Quaternion<T>& b) {
    Quaternion<T> result{a.real * b.real - dot(a.imaginary, b.imaginary), cross(a.imaginary, b.imaginary)};
    for (int i = 0; i < 3; i++) result.imaginary[i] += a.real * b.imaginary[i] + b.real * a.imaginary[i];
    return result;
}

struct PointToPlane {
    static constexpr int constants = 13, unknowns = 24;

    template <class T>
    static Vector<T> rotated(const Quaternion<T>& q, const double* v) {
        const Vector<double> original = point(v, 0);
        const auto first = cross(q.imaginary, original), second = cross(q.imaginary, first);
        Vector<T> result;
        for (int i = 0; i < 3; i++) result[i] = original[i] + 2.0 * (q.real * first[i] + second[i]);
        return result;
    }

    template <class T>
    static T value(const double* c, const T* x) {
        using std::cos, std::sin, std::sqrt;
        Quaternion<T> real{T(0.0), {T(0.0), T(0.0), T(0.0)}}, dual = real;
        for (int k = 0; k < 4; k++) {
            const auto turn = point(x, 2 * k), shift = point(x, 2 * k + 1);
            const T angle = norm(turn), sinc = sin(angle) / angle;
            const Quaternion<T> rotation{cos(angle), {turn[0] * sinc, turn[1] * sinc, turn[2] * sinc}};
            const Quaternion<T> motion = product(Quaternion<T>{T(0.0), shift}, rotation);
            real.real += c[k] * rotation.real;
            dual.real += c[k] / 2 * motion.real;
            for (int i = 0; i < 3; i++) {
                real.imaginary[i] += c[k] * rotation.imaginary[i];
                dual.imaginary[i] += c[k] / 2 * motion.imaginary[i];
            }
        }
        const T length = sqrt(square(real.real) + dot(real.imaginary, real.imaginary));
        for (Quaternion<T>* q : {&real, &dual}) {
            q->real /= length;
            for (T& entry : q->imaginary) entry /= length;
        }
        Quaternion<T> conjugate = real;
        for (T& entry : conjugate.imaginary) entry = -entry;
        const auto shift = product(dual, conjugate).imaginary;
        const auto moved = rotated(real, c + 4), normal = rotated(real, c + 7);
        Vector<T> offset;
        for (int i = 0; i < 3; i++) offset[i] = moved[i] + 2.0 * shift[i] - c[10 + i];
        return dot(normal, offset);
    }
};

template <class Kernel, bool hessian>
inline void evaluate(const double* in, double* out) {
    constexpr int n = Kernel::unknowns;
    using T = TinyAD::Double<n, hessian>;
    std::array<T, n> x;
    for (int i = 0; i < n; i++) x[i] = T(in[Kernel::constants + i], i);
    const T result = Kernel::value(in, x.data());
    *out++ = result.val;
    for (int i = 0; i < n; i++) *out++ = result.grad[i];
    if constexpr (hessian) {
        for (int i = 0; i < n; i += 3)
            for (int j = i; j < n; j += 3)
                for (int row = 0; row < 3; row++)
                    for (int column = 0; column < 3; column++) *out++ = result.Hess(i + row, j + column);
    }
}

}  // namespace kernels
