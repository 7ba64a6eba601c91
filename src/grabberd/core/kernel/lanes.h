/* Eight numbers at once, in the compiler's own words: whatever the processor has of them is used. */
#ifndef GRABBERD_LANES_H
#define GRABBERD_LANES_H

#include "kernel.h"

enum { EIGHT = 8 };
typedef float Lanes __attribute__((vector_size(32)));
typedef int32_t WholeLanes __attribute__((vector_size(32)));
typedef uint32_t BitLanes __attribute__((vector_size(32)));

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
/* Lane by lane, it becomes one instruction. */
INLINE Lanes greater(Lanes one, Lanes other) {
    for (int i = 0; i < EIGHT; i++) one[i] = one[i] > other[i] ? one[i] : other[i];
    return one;
}

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

INLINE int32_t sum_of_whole(WholeLanes lanes) {
    lanes += PICK(lanes, lanes, 4, 5, 6, 7, 0, 1, 2, 3);
    lanes += PICK(lanes, lanes, 2, 3, 0, 1, 6, 7, 4, 5);
    return lanes[0] + lanes[1];
}

/* Sums of eight times eight. */
INLINE Lanes sums_of_eight(const Lanes *lanes) {
    Lanes two[4], four[2];
    for (int i = 0; i < 4; i++)
        two[i] = PICK(lanes[2 * i], lanes[2 * i + 1], 0, 8, 2, 10, 4, 12, 6, 14) + PICK(lanes[2 * i], lanes[2 * i + 1], 1, 9, 3, 11, 5, 13, 7, 15);
    for (int i = 0; i < 2; i++)
        four[i] = PICK(two[2 * i], two[2 * i + 1], 0, 1, 8, 9, 4, 5, 12, 13) + PICK(two[2 * i], two[2 * i + 1], 2, 3, 10, 11, 6, 7, 14, 15);
    return PICK(four[0], four[1], 0, 1, 2, 3, 8, 9, 10, 11) + PICK(four[0], four[1], 4, 5, 6, 7, 12, 13, 14, 15);
}

/* 2 to the power of numbers from −120 to 0, to 2e-7 of itself (a minimax polynomial). Several at once, step by step: each
   one's steps wait for one another, and a processor looks only so far ahead for others. */
INLINE void powers_of_two(Lanes *x, int count) {
    static const float TERMS[6] = {1.3276472e-3f, 9.6755410e-3f, 5.5507131e-2f, 2.4022120e-1f, 6.9314694e-1f, 1.0000001f};
    const float whole = 12582912.0f; /* added, it leaves the nearest whole number in the lowest bits */
    Lanes shifted[count], value[count];
    for (int i = 0; i < count; i++) shifted[i] = x[i] + whole;
    for (int i = 0; i < count; i++) x[i] -= shifted[i] - whole;
    for (int i = 0; i < count; i++) value[i] = TERMS[0] * x[i] + TERMS[1];
    for (int term = 2; term < 6; term++)
        for (int i = 0; i < count; i++) value[i] = value[i] * x[i] + TERMS[term];
    for (int i = 0; i < count; i++) x[i] = (Lanes)((BitLanes)value[i] + ((BitLanes)shifted[i] << 23));
}

#endif
