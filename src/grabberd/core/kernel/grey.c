/* Grey values of a packed field: those above the threshold, and the background (as labelling.target_bits, noise.background_in). */
#include "grey.h"

enum { CHUNK = 64, SAMPLED_EVERY_PX = 32 };
static const double LEAST_NOISE = 0.28867513459481287, QUARTILE = 0.6745;
typedef uint8_t Bytes __attribute__((vector_size(32)));
typedef uint64_t Words __attribute__((vector_size(32)));

/* Eight bytes that are 0 or 255 as eight bits, the first in the highest. */
INLINE uint8_t packed(const uint8_t *set) {
    uint8_t bits = 0;
#if defined(__BYTE_ORDER__) && __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__
    uint64_t word;
    memcpy(&word, set, sizeof word);
    bits = (uint8_t)((word & UINT64_C(0x0102040810204080)) * UINT64_C(0x0101010101010101) >> 56);
#else
    for (int i = 0; i < 8; i++) bits |= set[i] & (0x80 >> i);
#endif
    return bits;
}

/* Of 64 bytes; most are background, and are not looked at one by one. */
INLINE void chunk_at_least(const uint8_t *from, uint8_t least, uint8_t *bits, int64_t count) {
    Bytes left, right;
    memcpy(&left, from, sizeof left);
    memcpy(&right, from + sizeof left, sizeof right);
    left = (Bytes)(left >= least), right = (Bytes)(right >= least);
    Words any = (Words)(left | right);
    if (!(any[0] | any[1] | any[2] | any[3])) return;
    uint8_t set[CHUNK];
    memcpy(set, &left, sizeof left);
    memcpy(set + sizeof left, &right, sizeof right);
    for (int64_t i = 0; i < count; i++) bits[i] = packed(set + 8 * i);
}

WIDE static void row_at_least(const uint8_t *row, int64_t columns, uint8_t least, uint8_t *bits) {
    int64_t column = 0;
    for (; column + CHUNK <= columns; column += CHUNK) chunk_at_least(row + column, least, bits + column / 8, CHUNK / 8);
    if (column == columns) return;
    uint8_t rest[CHUNK] = {0};
    memcpy(rest, row + column, (size_t)(columns - column));
    chunk_at_least(rest, least, bits + column / 8, (columns - column + 7) / 8);
    if (columns % 8) bits[columns / 8] &= (uint8_t)(0xff << (8 - columns % 8));
}

/* Marks where the number stored in the planes exceeds a level, comparing from the highest bit down. */
static void planes_above(const GreyPicture *picture, int64_t row, uint8_t *bits) {
    int64_t middle = 128 >> picture->bits, step = 256 >> picture->bits, size = picture->rows * picture->stride;
    int64_t level = picture->threshold > middle ? (picture->threshold - middle) / step : 0;
    for (int64_t k = 0; k < picture->stride; k++) {
        const uint8_t *byte = picture->data + row * picture->stride + k;
        uint8_t above = 0, equal = 0xff;
        for (int64_t weight = picture->bits - 1; weight >= 0; weight--, byte += size) {
            if (level >> weight & 1) equal &= *byte;
            else above |= equal & *byte, equal &= (uint8_t)~*byte;
        }
        bits[k] = above;
    }
}

/* The pixels above the threshold, `stride` bytes a row, all 0 before. */
void bits_above(const GreyPicture *picture, uint8_t *bits, int64_t stride) {
    if (picture->bits == 8 && picture->threshold >= 255) return;
    uint8_t least = picture->threshold < 0 ? 0 : (uint8_t)(picture->threshold + 1);
    for (int64_t row = 0; row < picture->rows; row++) {
        if (picture->bits == 8) row_at_least(picture->data + row * picture->stride, picture->columns, least, bits + row * stride);
        else planes_above(picture, row, bits + row * stride);
    }
}

static int64_t level_at(const GreyPicture *picture, int64_t row, int64_t column) {
    const uint8_t *byte = picture->data + row * picture->stride + (column >> 3);
    int64_t level = 0;
    for (int64_t plane = 0; plane < picture->bits; plane++, byte += picture->rows * picture->stride)
        level = 2 * level + (*byte >> (7 - (column & 7)) & 1);
    return level;
}

/* So many grey values of a row, as `unpack` gives them. */
void greys_of(const GreyPicture *picture, int64_t row, int64_t column, int64_t count, float *grey) {
    const uint8_t *from = picture->data + row * picture->stride + column;
    if (picture->bits == 8)
        for (int64_t i = 0; i < count; i++) grey[i] = from[i];
    else
        for (int64_t i = 0; i < count; i++)
            grey[i] = (float)((level_at(picture, row, column + i) << (8 - picture->bits)) + (128 >> picture->bits));
}

/* Where the cumulated histogram reaches so much (as np.interp). */
static double quantile(const double *cumulated, int64_t count, double wanted) {
    int64_t at = count;
    while (cumulated[at] > wanted) at--;
    if (at == count || cumulated[at] == wanted) return (double)at - 0.5;
    return 1.0 / (cumulated[at + 1] - cumulated[at]) * (wanted - cumulated[at]) + ((double)at - 0.5);
}

/* Neighbours are alike, and adding to the same number again and again takes time: by turns into four. */
static void count_levels(const GreyPicture *picture, int64_t often[GREYS]) {
    int64_t by_turns[4][GREYS] = {{0}};
    int64_t first = picture->parity == PROGRESSIVE ? 0 : picture->parity;
    for (int64_t row = first; row < picture->rows; row += SAMPLED_EVERY_PX / picture->y_step)
        for (int64_t column = 0; column < picture->columns; column++)
            by_turns[column & 3][picture->bits == 8 ? picture->data[row * picture->stride + column] : level_at(picture, row, column)]++;
    for (int i = 0; i < GREYS; i++) often[i] = by_turns[0][i] + by_turns[1][i] + by_turns[2][i] + by_turns[3][i];
}

Background background_in(const GreyPicture *picture) {
    int64_t often[GREYS] = {0}, levels = INT64_C(1) << picture->bits;
    count_levels(picture, often);
    double cumulated[GREYS + 1] = {0}, step = (double)(GREYS >> picture->bits);
    for (int64_t i = 0; i < levels; i++) cumulated[i + 1] = cumulated[i] + (double)often[i];
    double all = cumulated[levels], lower = quantile(cumulated, levels, 0.25 * all);
    double level = quantile(cumulated, levels, 0.5 * all), upper = quantile(cumulated, levels, 0.75 * all);
    double noise = (((double)often[0] > 0.25 * all) ? upper - level : level - lower) / QUARTILE;
    return (Background){(larger(level, 0.0) + 0.5) * step - 0.5, larger(noise, LEAST_NOISE) * step};
}
