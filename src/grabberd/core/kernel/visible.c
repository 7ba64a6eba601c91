/* Targets that a view cannot show (as facing.Facing.unseen). */
#include "space.h"

static const double TURNED_AWAY_COSINE2 = 0.010926199633097178, APART_PX = 2.0, BEHIND_MM = 1.0;
static const double CROWDED_PX = 4.0, NARROW_COSINE = 0.36, LIMB_COSINE = 0.17, BEYOND_COSINE = 0.25;

/* Difference between neighbours along a row or a column. */
INLINE void slope_at(const Wall *wall, int64_t targets, int step, int64_t own, const double *places_mm, double slope[3]) {
    const int64_t *of = wall->slope_of + 3 * targets * step + own;
    const double *weight = wall->slope_weight + 3 * targets * step + own;
    const double *from = places_mm + 3 * of[0], *to = places_mm + 3 * of[2 * targets], *middle = places_mm + 3 * of[targets];
    if (weight[targets] == 0) /* but at the edge */
        for (int k = 0; k < 3; k++) slope[k] = weight[0] * from[k] + weight[2 * targets] * to[k];
    else
        for (int k = 0; k < 3; k++) slope[k] = weight[0] * from[k] + weight[targets] * middle[k] + weight[2 * targets] * to[k];
}

static double square_of(const double one[3]) { return one[0] * one[0] + one[1] * one[1] + one[2] * one[2]; }

/* Products of normals and lines of sight, and of their squares; and which targets face away. */
WIDE static void face(const World *world, const double *places_mm, Facing *facing) {
    const Wall *wall = &world->wall;
    int64_t targets = world->targets;
    for (int64_t i = 0; i < targets; i++) {
        double along[3], across[3], sight[3];
        slope_at(wall, targets, 0, i, places_mm, along), slope_at(wall, targets, 1, i, places_mm, across);
        const double normal[3] = {along[1] * across[2] - along[2] * across[1], along[2] * across[0] - along[0] * across[2],
                                  along[0] * across[1] - along[1] * across[0]};
        double square = square_of(normal);
        for (int v = 0; v < VIEWS; v++) {
            for (int k = 0; k < 3; k++) sight[k] = world->rig.center_mm[v][k] - places_mm[3 * i + k];
            double toward = wall->side * (sight[0] * normal[0] + sight[1] * normal[1] + sight[2] * normal[2]);
            double length2 = square * square_of(sight);
            bool is_away = toward < 0 || toward * toward < TURNED_AWAY_COSINE2 * length2;
            facing->toward[v * targets + i] = toward, facing->length2[v * targets + i] = length2;
            facing->unseen[v * targets + i] = is_away ? TURNED_AWAY : 0;
        }
    }
}

/* Whether a stretch of the wall is before a target. */
static bool is_before(const Wall *wall, const double *image_px, const double *away_mm, int64_t begin, int64_t end, int64_t own) {
    const double *from = image_px + 2 * begin, *to = image_px + 2 * end, *at = image_px + 2 * own;
    double along[2] = {to[0] - from[0], to[1] - from[1]}, off[2] = {at[0] - from[0], at[1] - from[1]};
    double length2 = along[0] * along[0] + along[1] * along[1], share = off[0] * along[0] + off[1] * along[1];
    double beside = off[0] * along[1] - off[1] * along[0];
    if (!(share > 0 && share < length2 && beside * beside < wall->half_pitch_px * wall->half_pitch_px * length2)) return false;
    double near_mm = away_mm[begin] * length2 + share * (away_mm[end] - away_mm[begin]);
    return near_mm + BEHIND_MM * length2 < away_mm[own] * length2;
}

/* Whether a line turns away and back again: only then is anything behind it that faces the view. */
static bool folds(const int64_t *of, int64_t count, const double *toward) {
    int64_t last = count - 1;
    bool faced = false, turned = false;
    while (last > 0 && !(toward[of[last]] >= 0)) last--;
    for (int64_t i = 0; i < last; i++) turned |= faced && !(toward[of[i]] >= 0), faced |= toward[of[i]] >= 0;
    return turned;
}

static void hide(const World *world, int view, const double *places_mm, const double *image_px, Facing *facing) {
    const Wall *wall = &world->wall;
    int64_t *unseen = facing->unseen + view * world->targets;
    for (int64_t line = 0; line < wall->lines; line++) {
        const int64_t *of = wall->line + wall->line_begin[line];
        int64_t count = wall->line_begin[line + 1] - wall->line_begin[line];
        if (!folds(of, count, facing->toward + view * world->targets)) continue;
        for (int64_t i = 0; i < count; i++) {
            double sight[3];
            for (int k = 0; k < 3; k++) sight[k] = world->rig.center_mm[view][k] - places_mm[3 * of[i] + k];
            facing->away_mm[of[i]] = sqrt(square_of(sight));
        }
        for (int64_t i = 0; i < count; i++)
            for (int64_t k = 0; !unseen[of[i]] && k + 1 < count; k++)
                if (k != i && k + 1 != i && is_before(wall, image_px, facing->away_mm, of[k], of[k + 1], of[i])) unseen[of[i]] = HIDDEN;
    }
}

static double cosine_of(const Facing *facing, int64_t at) {
    return facing->length2[at] > 0 ? facing->toward[at] / sqrt(facing->length2[at]) : 1.0;
}

/* A pair of neighbours, by the gap between their images' edges; one at the limb may be no blob, but shines faintly. */
static void merge_pair(double gap_px, const double cosine[2], int64_t *unseen[2]) {
    const int64_t code[2] = {*unseen[0], *unseen[1]};
    for (int k = 0; k < 2; k++) {
        int64_t own = code[k], other = code[1 - k];
        if (own == TURNED_AWAY || own == HIDDEN || other == HIDDEN) continue;
        bool is_faint = cosine[1 - k] < LIMB_COSINE && cosine[1 - k] > -BEYOND_COSINE && cosine[k] < NARROW_COSINE;
        if (other != TURNED_AWAY && gap_px < APART_PX) *unseen[k] = MERGED;
        else if (is_faint && gap_px < CROWDED_PX) *unseen[k] = at_least(own, CROWDED);
    }
}

static void merge(const World *world, int view, const double *image_px, Facing *facing) {
    int64_t first = view * world->targets, *unseen = facing->unseen + first;
    double most_px = 2 * world->radius_lines + CROWDED_PX;
    for (int64_t pair = 0; pair < world->pairs; pair++) {
        int64_t of[2] = {world->neighbours[2 * pair], world->neighbours[2 * pair + 1]};
        double x = image_px[2 * of[0]] - image_px[2 * of[1]], y = image_px[2 * of[0] + 1] - image_px[2 * of[1] + 1];
        double apart2 = x * x + y * y;
        if (!(apart2 < most_px * most_px)) continue;
        double cosine[2] = {cosine_of(facing, first + of[0]), cosine_of(facing, first + of[1])};
        double gap_px = sqrt(apart2) - world->radius_lines * (larger(cosine[0], 0.0) + larger(cosine[1], 0.0));
        merge_pair(gap_px, cosine, (int64_t *[2]){unseen + of[0], unseen + of[1]});
    }
}

void find_unseen(const World *world, const double *places_mm, const double *image_px, Facing *facing) {
    if (!world->wall.slope_of) { /* nothing is known of a wall */
        memset(facing->unseen, 0, VIEWS * (size_t)world->targets * sizeof *facing->unseen);
        return;
    }
    face(world, places_mm, facing);
    for (int v = 0; v < VIEWS; v++) {
        hide(world, v, places_mm, image_px + 2 * world->targets * v, facing);
        merge(world, v, image_px + 2 * world->targets * v, facing);
    }
}
