/* The normal equations of a disc's fit, and their solution. */
#include "disc.h"

/* Products of so many rows with so many, three at most: their sums then stay in registers. */
INLINE void add_products(const Sheet *sheet, int first, int count, int other, int others, Lanes (*sums)[ROWS]) {
    Lanes sum[3][3];
    const float *one = sheet->design + first * sheet->padded, *beside = sheet->design + other * sheet->padded;
    for (int a = 0; a < count; a++)
        for (int b = 0; b < others; b++) sum[a][b] = all(0.0f);
    for (int64_t i = 0; i < sheet->padded; i += EIGHT) {
        Lanes left[3], right[3];
        for (int a = 0; a < count; a++) left[a] = lanes_at(one + a * sheet->padded + i);
        for (int b = 0; b < others; b++) right[b] = lanes_at(beside + b * sheet->padded + i);
        for (int a = 0; a < count; a++)
            for (int b = 0; b < others; b++) sum[a][b] += left[a] * right[b];
    }
    for (int a = 0; a < count; a++)
        for (int b = 0; b < others; b++) sums[first + a][other + b] = sum[a][b];
}

INLINE void add_rows(const Sheet *sheet, Lanes *sums) {
    Lanes sum[ROWS];
    for (int a = 0; a < ROWS; a++) sum[a] = all(0.0f);
    for (int64_t i = 0; i < sheet->padded; i += EIGHT)
        for (int a = 0; a < ROWS; a++) sum[a] += lanes_at(sheet->design + a * sheet->padded + i);
    for (int a = 0; a < ROWS; a++) sums[a] = sum[a];
}

WIDE void products_of(const Sheet *sheet, int lane, Quad normal[COLUMNS][COLUMNS]) {
    Lanes sums[ROWS + 1][ROWS];
    add_products(sheet, 0, 3, 0, 3, sums), add_products(sheet, 0, 3, 3, 3, sums), add_products(sheet, 0, 3, 6, 2, sums);
    add_products(sheet, 3, 3, 3, 3, sums), add_products(sheet, 3, 3, 6, 2, sums), add_products(sheet, 6, 2, 6, 2, sums);
    add_rows(sheet, sums[ROWS]);
    for (int a = 3; a < ROWS; a++)
        for (int b = 0; b < a / 3 * 3; b++) sums[a][b] = all(0.0f);
    for (int a = 0; a < ROWS; a++) {
        Lanes eight = sums_of_eight(sums[a]);
        for (int b = a; b < ROWS; b++) normal[CONTRAST + a][CONTRAST + b][lane] = (double)eight[b];
    }
    Lanes eight = sums_of_eight(sums[ROWS]);
    normal[BACKGROUND][BACKGROUND][lane] = (double)sheet->pixels;
    for (int b = 0; b < ROWS; b++) normal[BACKGROUND][CONTRAST + b][lane] = (double)eight[b];
}

WIDE void solve(Quad normal[NUMBERS][COLUMNS], Quad step[NUMBERS], Quad *variance_x, Quad *variance_y) {
    Quad inverse[NUMBERS], lower[NUMBERS][NUMBERS], scaled[NUMBERS];
    for (int i = 0; i < NUMBERS; i++) {
        Quad pivot = normal[i][i];
        step[i] = normal[i][REST];
        for (int k = 0; k < i; k++) {
            Quad sum = normal[k][i];
            for (int m = 0; m < k; m++) sum -= scaled[m] * lower[k][m];
            scaled[k] = sum, lower[i][k] = sum * inverse[k];
            pivot -= sum * lower[i][k];
            step[i] -= lower[i][k] * step[k];
        }
        inverse[i] = 1.0 / pivot;
    }
    for (int i = NUMBERS - 1; i >= 0; i--) {
        step[i] *= inverse[i];
        for (int m = i + 1; m < NUMBERS; m++) step[i] -= lower[m][i] * step[m];
    }
    *variance_y = inverse[Y];
    *variance_x = inverse[X] + lower[Y][X] * lower[Y][X] * inverse[Y];
}
