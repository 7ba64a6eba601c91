/* Rows of a field: copied out of a driver's buffer, doubled, quantised and packed (as field.py). */
#include "field.h"

WIDE static void every_other(const uint8_t *restrict from, int64_t columns, uint8_t *restrict to) {
    for (int64_t i = 0; i < columns; i++) to[i] = from[2 * i];
}

void copy_line(const Lines *lines, int64_t row, uint8_t *to) {
    const uint8_t *from = lines->luma + row * lines->row_stride;
    if (lines->column_stride == 1) memcpy(to, from, (size_t)lines->columns);
    else if (lines->column_stride == 2) every_other(from, lines->columns, to);
    else
        for (int64_t i = 0; i < lines->columns; i++) to[i] = from[i * lines->column_stride];
}

/* A quarter of four grey values' sum, rounded half to even. */
INLINE uint8_t quarter(int sum) { return (uint8_t)((sum + 1 + (sum >> 2 & 1)) >> 2); }

/* ¼ (1 2 1) along the line, its ends repeated. */
WIDE static void smooth_line(const uint8_t *restrict from, int64_t columns, uint8_t *restrict to) {
    int64_t last = columns - 1;
    for (int64_t i = 1; i < last; i++) to[i] = quarter(from[i - 1] + 2 * from[i] + from[i + 1]);
    to[0] = quarter(3 * from[0] + from[last ? 1 : 0]);
    to[last] = quarter(3 * from[last] + from[last ? last - 1 : 0]);
}

WIDE static void mean_of(const uint8_t *restrict one, const uint8_t *restrict other, int64_t columns, uint8_t *restrict to) {
    for (int64_t i = 0; i < columns; i++) to[i] = (uint8_t)((one[i] + other[i] + 1) >> 1);
}

WIDE static void exceeds(const uint8_t *restrict line, uint8_t threshold, int64_t columns, uint8_t *restrict set) {
    for (int64_t i = 0; i < columns; i++) set[i] = line[i] > threshold ? 255 : 0;
}

WIDE static void exceeds_map(const uint8_t *restrict line, const uint8_t *restrict map, int64_t columns, uint8_t *restrict set) {
    for (int64_t i = 0; i < columns; i++) set[i] = line[i] > map[i] ? 255 : 0;
}

/* Eight pixels as a number, the leftmost in its lowest byte. */
INLINE uint64_t leftmost_low(uint64_t word) {
#if defined(__BYTE_ORDER__) && __BYTE_ORDER__ == __ORDER_BIG_ENDIAN__
    return __builtin_bswap64(word);
#else
    return word;
#endif
}

/* Bytes that are 0 or 255 as bits. */
WIDE static void pack_bits(const uint64_t *restrict set, int64_t count, uint8_t *restrict out) {
    for (int64_t i = 0; i < count; i++) {
        uint64_t word = leftmost_low(set[i]) & UINT64_C(0x0102040810204080);
        word |= word >> 32, word |= word >> 16, word |= word >> 8;
        out[i] = (uint8_t)word;
    }
}

/* Eight pixels by eight bits, mirrored at the diagonal that keeps the rightmost pixel's highest bit (Hacker's Delight
   7-3): byte k, from the lowest on, has bit 7 − k of all eight pixels. */
WIDE static void mirror(const uint64_t *restrict line, int64_t count, uint64_t *restrict planes) {
    for (int64_t i = 0; i < count; i++) {
        uint64_t word = leftmost_low(line[i]), swap = (word ^ word >> 9) & UINT64_C(0x0055005500550055);
        word ^= swap ^ swap << 9;
        swap = (word ^ word >> 18) & UINT64_C(0x0000333300003333);
        word ^= swap ^ swap << 18;
        swap = (word ^ word >> 36) & UINT64_C(0x000000000F0F0F0F);
        planes[i] = word ^ swap ^ swap << 36;
    }
}

WIDE static void write_plane(const uint64_t *restrict planes, int64_t count, int64_t plane, uint8_t *restrict out) {
    for (int64_t i = 0; i < count; i++) out[i] = (uint8_t)(planes[i] >> 8 * plane);
}

static void threshold_line(const uint8_t *line, int64_t columns, const Packing *packing, int64_t row, uint8_t *set) {
    if (packing->map) exceeds_map(line, packing->map + row * columns, columns, set);
    else if (packing->threshold < 0) memset(set, 255, (size_t)columns);
    else exceeds(line, (uint8_t)at_most(packing->threshold, 255), columns, set);
}

/* A line as row `row` of the packed field. */
static void emit(const Lines *lines, const Packing *packing, Stages *stages, int64_t row, const uint8_t *line) {
    int64_t columns = lines->columns, count = words_of(columns);
    if (packing->bits == 8) memcpy(packing->out + row * columns, line, (size_t)columns);
    else if (packing->bits == 1) {
        threshold_line(line, columns, packing, row, stages->set);
        pack_bits((const uint64_t *)stages->set, count, packing->out + row * count);
    } else {
        mirror((const uint64_t *)line, count, stages->planes);
        for (int64_t plane = 0; plane < packing->bits; plane++)
            write_plane(stages->planes, count, plane, packing->out + (plane * packed_rows(lines, packing) + row) * count);
    }
}

/* Packs a line of the camera, and the missing line before it, if there is one. */
void pack_line(const Lines *lines, const Packing *packing, Stages *stages, int64_t row, const uint8_t *line) {
    if (!packing->doubled) {
        emit(lines, packing, stages, row, line);
        return;
    }
    if (packing->smoothed) {
        smooth_line(line, lines->columns, stages->smooth[row & 1]);
        line = stages->smooth[row & 1];
    }
    emit(lines, packing, stages, 2 * row + packing->parity, line);
    if (row) {
        mean_of(stages->before, line, lines->columns, stages->between);
        emit(lines, packing, stages, 2 * row - 1 + packing->parity, stages->between);
    } else if (packing->parity) emit(lines, packing, stages, 0, line);
    if (row == lines->rows - 1 && !packing->parity) emit(lines, packing, stages, 2 * row + 1, line);
    stages->before = line;
}

bool make_stages(Stages *stages, int64_t columns) {
    int64_t room = WORD * words_of(columns);
    uint8_t **part[] = {&stages->line[0], &stages->line[1], &stages->smooth[0], &stages->smooth[1], &stages->between, &stages->set};
    const int64_t parts = sizeof part / sizeof *part;
    stages->memory = calloc((size_t)parts + 1, (size_t)room); /* what lies behind a line stays 0 */
    if (!stages->memory) return false;
    for (int64_t i = 0; i < parts; i++) *part[i] = stages->memory + i * room;
    stages->planes = (uint64_t *)(stages->memory + parts * room);
    return true;
}

int pack_field(const Lines *lines, const Packing *packing) {
    Stages stages = {0};
    if (!make_stages(&stages, lines->columns)) return NO_MEMORY;
    for (int64_t row = 0; row < lines->rows; row++) {
        uint8_t *line = stages.line[row & 1];
        copy_line(lines, row, line);
        pack_line(lines, packing, &stages, row, line);
    }
    free(stages.memory);
    return DONE;
}
