/* A disc's picture and its slopes by the numbers that describe it (as template.py). */
#include "disc.h"

typedef uint64_t Pairs __attribute__((vector_size(32)));

INLINE Lanes root_of(Lanes value) {
    float one[EIGHT];
    memcpy(one, &value, sizeof one);
    for (int i = 0; i < EIGHT; i++) one[i] = sqrtf(one[i]);
    memcpy(&value, one, sizeof one);
    return value;
}

/* Profile of an edge and its slope at a distance in σ. */
INLINE void look_up(const GreySettings *settings, Lanes distance, Lanes *inside, Lanes *density) {
    Lanes entry = (distance + 5.0f) * 512.0f + 0.5f;
    entry = choose(entry > 0.0f, entry, all(0.0f));
    entry = choose(entry < EDGE_VALUES - 1.0f, entry, all(EDGE_VALUES - 1.0f));
    WholeLanes at = __builtin_convertvector(entry, WholeLanes);
    Pairs left = {settings->edge[at[0]], settings->edge[at[1]], settings->edge[at[2]], settings->edge[at[3]]};
    Pairs right = {settings->edge[at[4]], settings->edge[at[5]], settings->edge[at[6]], settings->edge[at[7]]};
    const Lanes whole = __builtin_convertvector(at, Lanes), z = whole * (1.0f / 512.0f) - 5.0f;
    Lanes beyond = (entry - whole - 0.5f) * (1.0f / 512.0f), steep = PICK((Lanes)left, (Lanes)right, 1, 3, 5, 7, 9, 11, 13, 15);
    *inside = PICK((Lanes)left, (Lanes)right, 0, 2, 4, 6, 8, 10, 12, 14) - steep * beyond * (1.0f - 0.5f * z * beyond);
    *density = steep * (1.0f - z * beyond);
}

/* What the slopes at eight pixels are made of. */
typedef struct {
    Lanes v, u, down, across, along, sharp, distance, edge, inside;
} Edge;

/* Of some eights at once, step by step: each one's steps wait for one another. */
INLINE void edges_of(const float disc[NUMBERS], float blurring_x, const GreySettings *settings, const Sheet *sheet, int64_t first, int count,
                     Edge *edge) {
    const float narrow = 1.0f / disc[HALF_WIDTH], low = 1.0f / disc[HALF_HEIGHT];
    Lanes radius2[count], root[count], spread[count], density[count];
    for (int i = 0; i < count; i++) {
        edge[i].v = lanes_at(sheet->y + first + i * EIGHT) - disc[Y];
        edge[i].u = (lanes_at(sheet->x + first + i * EIGHT) - disc[X] - disc[LEAN] * edge[i].v) * narrow;
    }
    for (int i = 0; i < count; i++) edge[i].down = edge[i].v * low, edge[i].across = edge[i].u * narrow;
    for (int i = 0; i < count; i++) radius2[i] = edge[i].u * edge[i].u + edge[i].down * edge[i].down + 1e-6f;
    for (int i = 0; i < count; i++) edge[i].along = edge[i].down * low - disc[LEAN] * edge[i].u * narrow;
    for (int i = 0; i < count; i++)
        spread[i] = blurring_x * (edge[i].across * edge[i].across) + disc[BLURRING] * (edge[i].along * edge[i].along) + 1e-6f;
    for (int i = 0; i < count; i++) spread[i] = root_of(spread[i]), root[i] = root_of(radius2[i]);
    for (int i = 0; i < count; i++) edge[i].sharp = 1.0f / spread[i];
    for (int i = 0; i < count; i++) edge[i].distance = (radius2[i] - root[i]) * edge[i].sharp;
    for (int i = 0; i < count; i++) look_up(settings, edge[i].distance, &edge[i].inside, density + i);
    for (int i = 0; i < count; i++) edge[i].edge = disc[CONTRAST] * density[i] * edge[i].sharp;
}

INLINE void write_eight(float *design, int64_t padded, int row, Lanes values) { memcpy(design + (row - CONTRAST) * padded, &values, sizeof values); }

/* What is left of eight pixels' grey values, and their slopes by the place along x; or by all eight numbers. */
INLINE void write_slopes(const float disc[NUMBERS], const Edge *edge, Lanes grey, bool all_of_them, float *design, int64_t padded) {
    const float low = 1.0f / disc[HALF_HEIGHT];
    Lanes by_x = edge->edge * edge->across;
    write_eight(design, padded, X, by_x);
    write_eight(design, padded, REST, grey - (disc[BACKGROUND] + disc[CONTRAST] * edge->inside));
    if (!all_of_them) return;
    write_eight(design, padded, CONTRAST, edge->inside);
    write_eight(design, padded, HALF_WIDTH, edge->edge * edge->u * edge->across);
    write_eight(design, padded, HALF_HEIGHT, edge->edge * edge->down * edge->down * low);
    write_eight(design, padded, BLURRING, 0.5f * edge->edge * edge->sharp * edge->distance * (edge->along * edge->along));
    write_eight(design, padded, Y, edge->edge * edge->along);
    write_eight(design, padded, LEAN, by_x * edge->v);
}

INLINE void picture_of(const float *restrict disc, float blurring_x, const GreySettings *settings, bool all_of_them, Sheet *sheet) {
    enum { SEVERAL = 4 };
    const int64_t padded = sheet->padded;
    Edge edge[SEVERAL];
    int64_t first = 0;
    for (; first + SEVERAL * EIGHT <= padded; first += SEVERAL * EIGHT) {
        edges_of(disc, blurring_x, settings, sheet, first, SEVERAL, edge);
        for (int i = 0; i < SEVERAL; i++)
            write_slopes(disc, edge + i, lanes_at(sheet->grey + first + i * EIGHT), all_of_them, sheet->design + first + i * EIGHT, padded);
    }
    for (; first < padded; first += EIGHT) {
        edges_of(disc, blurring_x, settings, sheet, first, 1, edge);
        write_slopes(disc, edge, lanes_at(sheet->grey + first), all_of_them, sheet->design + first, padded);
    }
    for (int k = 0; k < ROWS; k++)
        for (int64_t i = sheet->pixels; i < padded; i++) sheet->design[k * padded + i] = 0.0f;
}

WIDE void picture_disc(const float *disc, float blurring_x, const GreySettings *settings, Sheet *sheet) {
    picture_of(disc, blurring_x, settings, true, sheet);
}

WIDE void picture_chords(const float *disc, float blurring_x, const GreySettings *settings, Sheet *sheet) {
    picture_of(disc, blurring_x, settings, false, sheet);
}
