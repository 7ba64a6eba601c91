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

INLINE Lanes only(WholeLanes which, Lanes lanes) { return (Lanes)(which & (WholeLanes)lanes); }

INLINE float greatest_of(Lanes lanes) {
    lanes = greater(lanes, PICK(lanes, lanes, 4, 5, 6, 7, 0, 1, 2, 3));
    lanes = greater(lanes, PICK(lanes, lanes, 2, 3, 0, 1, 6, 7, 4, 5));
    return lanes[0] > lanes[1] ? lanes[0] : lanes[1];
}

/* ((0 + 4) + (2 + 6)) + ((1 + 5) + (3 + 7)) */
INLINE float sum_of(Lanes lanes) {
    lanes += PICK(lanes, lanes, 4, 5, 6, 7, 0, 1, 2, 3);
    lanes += PICK(lanes, lanes, 2, 3, 0, 1, 6, 7, 4, 5);
    return lanes[0] + lanes[1];
}

/* e to the power of numbers from −80 to 0, to 1e-7 of itself (Cephes' polynomial). Several at once, step by step: each
   one's steps wait for one another, and a processor looks only so far ahead for others. */
INLINE void exponentials(Lanes *x, int count) {
    static const float TERMS[6] = {1.9875691500e-4f, 1.3981999507e-3f, 8.3334519073e-3f, 4.1665795894e-2f, 1.6666665459e-1f, 5.0000001201e-1f};
    Lanes whole[count], value[count];
    for (int i = 0; i < count; i++) whole[i] = (x[i] * 1.44269504f + 12582912.0f) - 12582912.0f;
    for (int i = 0; i < count; i++) x[i] = (x[i] - whole[i] * 0.693359375f) + whole[i] * 2.12194440e-4f;
    for (int i = 0; i < count; i++) value[i] = TERMS[0] * x[i] + TERMS[1];
    for (int term = 2; term < 6; term++)
        for (int i = 0; i < count; i++) value[i] = value[i] * x[i] + TERMS[term];
    for (int i = 0; i < count; i++) value[i] = value[i] * x[i] * x[i] + x[i] + 1.0f;
    for (int i = 0; i < count; i++) x[i] = value[i] * (Lanes)((__builtin_convertvector(whole[i], WholeLanes) + 127) << 23);
}

#endif
