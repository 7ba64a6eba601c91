// A small liner for the tests: three rows of four targets on an arc, as the API gives it.
export const ROWS = 3;
export const COLUMNS = 4;

export function objectDocument() {
  const targets = Array.from({ length: ROWS * COLUMNS }, (_, i) => ({ row: Math.floor(i / COLUMNS), column: i % COLUMNS }));
  const angle = targets.map(({ column }) => (column - (COLUMNS - 1) / 2) * 0.5);
  return {
    name: "liner",
    target: targets.map((_, i) => i + 1),
    row: targets.map(({ row }) => row),
    column: targets.map(({ column }) => column),
    x_mm: targets.map(({ row }) => (row - 1) * 6.5),
    y_mm: angle.map((a) => 13 * Math.sin(a)),
    z_mm: angle.map((a) => 13 * Math.cos(a)),
  };
}

/** The newest points, but for those that are missing. */
export function pointsDocument(missing = []) {
  const object = objectDocument();
  const kept = object.target.map((_, i) => i).filter((i) => !missing.includes(object.target[i]));
  const of = (values) => kept.map((i) => values[i]);
  const same = (value) => kept.map(() => value);
  return {
    n: 7, utc: "2026-03-01T09:00:00.000Z", target: of(object.target),
    x_mm: of(object.x_mm), y_mm: of(object.y_mm), z_mm: of(object.z_mm).map((z) => z - 2),
    sigma_x_mm: same(0.02), sigma_y_mm: same(0.03), sigma_z_mm: same(0.06), residual_px: same(0.1),
  };
}
