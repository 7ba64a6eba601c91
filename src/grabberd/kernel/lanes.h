/* Eight numbers at once, in the compiler's own words: whatever the processor has of them is used. */
#ifndef GRABBERD_LANES_H
#define GRABBERD_LANES_H

#include "kernel.h"

enum { EIGHT = 8 };
typedef float Lanes __attribute__((vector_size(32)));
typedef int32_t WholeLanes __attribute__((vector_size(32)));

/* Some of the sixteen numbers of two, by their places. */
#if defined(__clang__)
#define PICK(one, other, ...) __builtin_shufflevector(one, other, __VA_ARGS__)
#else
#define PICK(one, other, ...) __builtin_shuffle(one, other, (WholeLanes){__VA_ARGS__})
#endif

INLINE Lanes lanes_at(const float *from) {
    Lanes lanes;
    memcpy(&lanes, from, sizeof lanes);
    return lanes;
}
INLINE Lanes all(float value) { return value - (Lanes){0}; }
INLINE Lanes choose(WholeLanes which, Lanes one, Lanes other) {
    return (Lanes)((which & (WholeLanes)one) | (~which & (WholeLanes)other));
}
INLINE Lanes greater(Lanes one, Lanes other) { return choose(one > other, one, other); }

INLINE float greatest_of(Lanes lanes) {
    float most = lanes[0];
    for (int i = 1; i < EIGHT; i++) most = lanes[i] > most ? lanes[i] : most;
    return most;
}

INLINE float sum_of(Lanes lanes) {
    return ((lanes[0] + lanes[4]) + (lanes[2] + lanes[6])) + ((lanes[1] + lanes[5]) + (lanes[3] + lanes[7]));
}

/* e to the power of numbers from −80 to 0, to 1e-7 of itself (Cephes' polynomial). */
INLINE Lanes exponential(Lanes x) {
    Lanes whole = (x * 1.44269504f + 12582912.0f) - 12582912.0f;
    Lanes rest = (x - whole * 0.693359375f) + whole * 2.12194440e-4f;
    Lanes value = 1.9875691500e-4f * rest + 1.3981999507e-3f;
    value = value * rest + 8.3334519073e-3f;
    value = value * rest + 4.1665795894e-2f;
    value = value * rest + 1.6666665459e-1f;
    value = value * rest + 5.0000001201e-1f;
    value = value * rest * rest + rest + 1.0f;
    return value * (Lanes)((__builtin_convertvector(whole, WholeLanes) + 127) << 23);
}

#endif
