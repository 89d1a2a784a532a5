/* What generated CUDA needs of its compiler, for a compiler of C++: device code runs on the host, one thread after the
   other. It stands before the code. */
#ifndef CUDA_ON_HOST_H
#define CUDA_ON_HOST_H

#include <cmath>
#include <cstdint>

#define __CUDACC__
#define __CUDA_ARCH__ 800
#define __host__
#define __device__
#define __global__ static
#define __forceinline__ inline __attribute__((always_inline, unused))
#define __noinline__ __attribute__((noinline, unused))

enum cudaError_t { cudaSuccess, cudaErrorInvalidValue };
typedef void *cudaStream_t;
static inline cudaError_t cudaGetLastError() { return cudaSuccess; }

struct Place {
    unsigned x;
};
static Place blockIdx, blockDim, threadIdx;

/* Operations that compilers never contract. */
#define OPERATIONS(real, letter, fma_rn)                                                      \
    static inline real __##letter##add_rn(real a, real b) { return a + b; }                   \
    static inline real __##letter##sub_rn(real a, real b) { return a - b; }                   \
    static inline real __##letter##mul_rn(real a, real b) { return a * b; }                   \
    static inline real __##letter##div_rn(real a, real b) { return a / b; }                   \
    static inline real __##letter##sqrt_rn(real a) { return std::sqrt(a); }                   \
    static inline real fma_rn(real a, real b, real c) { return std::fma(a, b, c); }
OPERATIONS(double, d, __fma_rn)
OPERATIONS(float, f, __fmaf_rn)

template <class T>
static inline T atomicAdd(T *place, T number) {
    const T before = *place;
    *place = before + number;
    return before;
}

/* Stands for KERNEL<<<blocks, threads, 0, stream>>>(batch). */
template <class Batch>
static void run_on_host(void (*kernel)(Batch), unsigned blocks, unsigned threads, cudaStream_t, const Batch &batch) {
    blockDim.x = threads;
    for (blockIdx.x = 0U; blockIdx.x < blocks; blockIdx.x++) {
        for (threadIdx.x = 0U; threadIdx.x < threads; threadIdx.x++) {
            kernel(batch);
        }
    }
}

/* Runs a routine by its kernel. Its counts are those of the loops on a processor. */
template <class Batch>
static void launched(cudaError_t (*launch)(int32_t, const Batch *, cudaStream_t), int32_t routine, Batch *batch) {
    uint32_t counts[2] = {0U, 0U};
    batch->counts = counts;
    if (launch(routine, batch, nullptr) != cudaSuccess) {
        counts[0] = UINT32_MAX;
    }
    batch->counts = nullptr;
    batch->flagged = counts[0];
    batch->unsettled_count = counts[1];
}

#endif
