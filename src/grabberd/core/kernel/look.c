/* A live field's content: rows that were delivered before, a picture that the grabber draws, and what a sideways
   shift is found by (as content_check.StaleRows, content_check.no_picture and shifted_rows.py). */
#include "field.h"

enum { EVIDENCE = 40, EDGE_ROWS = 4, FEW = 16, SNOW_SIGMA = 25 };
static const double SNOW_CORRELATION = 0.1;

WIDE static uint64_t hash_of(const uint64_t *words, const uint64_t *weights, int64_t count) {
    uint64_t sum = 0;
    for (int64_t i = 0; i < count; i++) sum += words[i] * weights[i];
    return sum;
}

WIDE static int64_t unlike(const uint64_t *one, const uint64_t *other, int64_t count) {
    int64_t sum = 0;
    for (int64_t i = 0; i < count; i++) sum += one[i] != other[i];
    return sum;
}

/* How many groups of eight pixels have more than one grey value. */
WIDE static int64_t contrast_of(const uint64_t *words, int64_t count) {
    int64_t sum = 0;
    for (int64_t i = 0; i < count; i++) sum += words[i] != (words[i] >> 8 | words[i] << 56);
    return sum;
}

WIDE static void add_to(uint16_t *restrict sums, const uint8_t *restrict line, int64_t columns) {
    for (int64_t i = 0; i < columns; i++) sums[i] = (uint16_t)(sums[i] + line[i]);
}

INLINE void means_over(const uint16_t *column_sums, int64_t bins, int32_t count, int16_t *means) {
    for (int64_t i = 0; i < bins; i++, column_sums += BIN_COLUMNS)
        means[i] = (int16_t)((column_sums[0] + column_sums[1] + column_sums[2] + column_sums[3] + count / 2) / count);
}

/* Means of bins over so many rows, rounded half up. */
WIDE static void write_means(const uint16_t *column_sums, int64_t bins, int64_t rows, int16_t *means) {
    const int32_t usual = BLOCK_ROWS * BIN_COLUMNS; /* known to the compiler, it needs no division */
    if (rows == BLOCK_ROWS) means_over(column_sums, bins, usual, means);
    else means_over(column_sums, bins, (int32_t)rows * BIN_COLUMNS, means);
}

void look_at_line(const Lines *lines, const Look *look, Notes *notes, int64_t row) {
    int64_t count = words_of(lines->columns), bins = lines->columns / BIN_COLUMNS, blocks = lines->rows / BLOCK_ROWS;
    const uint64_t *words = look->words + row * count;
    look->hashes[row] = hash_of(words, look->weights, count);
    if (look->good) look->differing[row] = unlike(words, look->good + row * count, count);
    add_to(notes->column_sums, (const uint8_t *)words, lines->columns);
    int64_t block = (row + 1) / BLOCK_ROWS - 1;
    bool is_whole = block < blocks - 1 ? (row + 1) % BLOCK_ROWS == 0 : row + 1 == lines->rows;
    if (block < 0 || !is_whole) return;
    write_means(notes->column_sums, bins, row + 1 - block * BLOCK_ROWS, look->means + block * bins);
    memset(notes->column_sums, 0, (size_t)lines->columns * sizeof *notes->column_sums);
}

static const uint8_t *line_of(const Lines *lines, const Look *look, int64_t row) {
    return (const uint8_t *)(look->words + row * words_of(lines->columns));
}

static bool are_even(const Lines *lines, const Look *look, int64_t step) {
    for (int64_t row = EDGE_ROWS; row < lines->rows - EDGE_ROWS; row += step) {
        const uint8_t *line = line_of(lines, look, row);
        if (memcmp(line, line + 1, (size_t)lines->columns - 1)) return false;
    }
    return true;
}

static int64_t drawn(const Lines *lines, const Look *look) {
    if (lines->rows <= 2 * EDGE_ROWS) return PICTURE;
    bool alike = true;
    for (int64_t row = EDGE_ROWS + 1; alike && row < lines->rows - EDGE_ROWS; row++)
        alike = look->hashes[row] == look->hashes[EDGE_ROWS];
    if (alike) return are_even(lines, look, lines->rows) ? FLAT : BARS;
    return are_even(lines, look, FEW) && are_even(lines, look, 1) ? BARS : PICTURE;
}

typedef struct {
    int64_t x, y, xx, yy, xy;
} Sums;

WIDE static void add_pairs(const uint8_t *restrict x, const uint8_t *restrict y, int64_t columns, Sums *sums) {
    int32_t of[5] = {0};
    for (int64_t i = 0; i < columns; i++)
        of[0] += x[i], of[1] += y[i], of[2] += x[i] * x[i], of[3] += y[i] * y[i], of[4] += x[i] * y[i];
    sums->x += of[0], sums->y += of[1], sums->xx += of[2], sums->yy += of[3], sums->xy += of[4];
}

/* Strong contrast that is uncorrelated from row to row. */
static bool is_snow(const Lines *lines, const Look *look) {
    Sums sums = {0};
    int64_t count = 0;
    for (int64_t row = FEW; row < lines->rows; row += FEW, count += lines->columns)
        add_pairs(line_of(lines, look, row), line_of(lines, look, row - 1), lines->columns, &sums);
    int64_t lower = count * sums.xx - sums.x * sums.x, upper = count * sums.yy - sums.y * sums.y;
    if (!count || lower < SNOW_SIGMA * SNOW_SIGMA * count * count) return false;
    return (double)(count * sums.xy - sums.x * sums.y) < SNOW_CORRELATION * sqrt((double)lower * (double)upper);
}

/* Of the same width as the hashes, marks take no conversion. */
WIDE static void mark_equal(const uint64_t *restrict seen, const uint64_t *restrict hashes, int64_t rows, uint64_t *restrict old) {
    for (int64_t row = 0; row < rows; row++) old[row] |= seen[row] == hashes[row];
}

/* Marks rows that are remembered, remembers these, and tells whether any is. */
static bool find_old(const Lines *lines, const Look *look, uint64_t *old) {
    uint64_t any = 0;
    for (int64_t k = 0; k < REMEMBERED; k++) mark_equal(look->seen + k * lines->rows, look->hashes, lines->rows, old);
    memcpy(look->seen + look->place * lines->rows, look->hashes, (size_t)lines->rows * sizeof *look->hashes);
    for (int64_t row = 0; row < lines->rows; row++) any |= old[row];
    return any != 0;
}

/* Pixel groups of a row by which its match means something. */
static int64_t evidence_of(const Lines *lines, const Look *look, const Notes *notes, int64_t row) {
    int64_t least = notes->contrast[row];
    for (int64_t k = 0; k < LEARNED; k++) least = within(look->learned[k * lines->rows + row], 0, least);
    return least;
}

static void find_stale(const Lines *lines, const Look *look, Notes *notes, Findings *findings) {
    int64_t rows = lines->rows, count = words_of(lines->columns), total = 0;
    bool all_old = true;
    for (int64_t row = 0; row < rows; row++) {
        total += notes->contrast[row] = contrast_of(look->words + row * count, count);
        all_old &= notes->old[row] || !notes->contrast[row];
    }
    if (total >= EVIDENCE && all_old) {
        findings->first = 0, findings->last = rows - 1;
        return;
    }
    for (int64_t row = 0; row < rows; row++) {
        int64_t sum = 0, first = -1, last = -1;
        for (; row < rows && notes->old[row]; row++) {
            int64_t evidence = evidence_of(lines, look, notes, row);
            if (evidence) first = first < 0 ? row : first, last = row;
            sum += evidence;
        }
        if (sum < EVIDENCE) continue;
        findings->first = first, findings->last = row == rows ? rows - 1 : last;
        return;
    }
}

Findings conclude(const Lines *lines, const Look *look, Notes *notes) {
    Findings findings = {drawn(lines, look), -1, -1};
    if (!findings.made_up && is_snow(lines, look)) findings.made_up = SNOW;
    if (!findings.made_up && find_old(lines, look, notes->old)) find_stale(lines, look, notes, &findings);
    return findings;
}

static bool make_notes(Notes *notes, const Lines *lines) {
    size_t rows = (size_t)lines->rows, columns = (size_t)lines->columns;
    notes->contrast = calloc(1, rows * (sizeof *notes->contrast + sizeof *notes->old) + columns * sizeof *notes->column_sums);
    if (!notes->contrast) return false;
    notes->old = (uint64_t *)(notes->contrast + rows), notes->column_sums = (uint16_t *)(notes->old + rows);
    return true;
}

int take_field(const Lines *lines, const Packing *packing, const Look *look, Findings *findings) {
    Stages stages = {0};
    Notes notes = {0};
    int status = make_stages(&stages, lines->columns) && make_notes(&notes, lines) ? DONE : NO_MEMORY;
    for (int64_t row = 0; status == DONE && row < lines->rows; row++) {
        uint64_t *words = look->words + row * words_of(lines->columns);
        words[words_of(lines->columns) - 1] = 0;
        copy_line(lines, row, (uint8_t *)words);
        look_at_line(lines, look, &notes, row);
        pack_line(lines, packing, &stages, row, (const uint8_t *)words);
    }
    if (status == DONE) *findings = conclude(lines, look, &notes);
    free(stages.memory);
    free(notes.contrast);
    return status;
}

