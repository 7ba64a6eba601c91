// Documents that OpenAPI leaves open ("any JSON object"): only the parts that the page reads. Where OpenAPI comes to
// describe one of them, its declaration here gives way to an alias in documents.d.ts.

/** A camera behind its mirrors: interior and exterior orientation, as far as it is drawn. */
export interface CalibrationView {
  first_column: number;
  end_column: number;
  pixel_x_mm: number;
  pixel_y_mm: number;
  /** −1 where an odd number of mirrors makes the view left-handed. */
  handedness: number;
  f_mm: number;
  x0_px: number;
  y0_px: number;
  omega_rad: number;
  phi_rad: number;
  kappa_rad: number;
  X0_mm: number;
  Y0_mm: number;
  Z0_mm: number;
}

export interface Calibration {
  id: string;
  image: { columns: number; lines: number };
  views: Record<string, CalibrationView>;
}

/** Of the report of a calibration that was made here. */
export interface CalibrationReport {
  capture: { fields: number } | null;
  identification: { found: Record<string, number>; of: number };
  result: {
    sigma0: number;
    image_points: number;
    unmodelled_px: number;
    rms_px: Record<string, { x: number; y: number }>;
  };
  blunders: unknown[];
  validation: { rmse_mm: PerAxis & { xyz: number } } | null;
  /** Expected σ, mm: for each plane of the volume a grid for each axis. */
  volume: { planes: { total: Record<keyof PerAxis, (number | null)[][]> }[] };
  warnings: string[];
}

export interface PerAxis {
  x: number;
  y: number;
  z: number;
}

/** An object model as a capture keeps it; the route `/devices/{}/object` answers with lists instead. */
export interface StoredObject {
  name?: string;
  targets: { id: number; row: number; column: number; x_mm: number; y_mm: number; z_mm: number }[];
}

/** What a run was made with. */
export interface MadeWith {
  calibration?: Calibration | null;
  object?: StoredObject | null;
}

/** A table of an analysis, column by column. */
export interface Table {
  columns: { name: string; values: (number | null)[] }[];
}

/** An analysis in numbers. */
export interface Analysis {
  tables: Record<string, Table | undefined>;
  states: { targets: Table }[];
}

/** The targets that a capture of the calibration frame shows: the result of a job "identify". */
export interface Identification {
  of: number;
  picture: { field: number; y0: number; y_step: number };
  views: Record<string, IdentifiedView>;
  moved: boolean;
  problem: { message: string; hint: string } | null;
}

export interface IdentifiedView {
  found: (Place & { target: number })[];
  missing: number[];
  other: Place[];
}

export interface Place {
  x_px: number;
  y_px: number;
}

/** The result of a job "check". */
export interface CheckResult {
  verdict: string;
  reasons: string[];
  seen: number;
  of: number;
  rmse: { xyz_mm: number };
  parallax_px: number;
}

/** Columns with a value for each target; null where there is none. */
export interface PlacedColumns {
  target: number[];
  x_mm: (number | null)[];
  y_mm: (number | null)[];
  z_mm: (number | null)[];
}

/** The targets of one field, or of one phase of the mean cycle. The column "reason" alone has texts. */
export interface AnalysisMap {
  field: number | null;
  phase: number | null;
  units: Record<string, string>;
  columns: PlacedColumns & { row: number[]; column: number[] } & Record<string, (number | null)[]>;
}

/** What an analysis is told beside the points. */
export interface AnalysisInputs {
  reference?: string | Record<string, number>;
  material?: { law?: string; zones?: unknown; [number: string]: unknown };
  vacuum?: { pulsation?: VacuumSource; liner?: VacuumSource; offset?: Record<string, number>; lag?: Record<string, number> };
  sought_kpa?: number;
  plane?: string | { point_mm: number[]; normal: number[] };
  heights_mm?: number[];
  phases?: number;
  free_rows?: number[];
}

/** Numbers of a course over time, or the logger's file. */
export type VacuumSource = "log" | Record<string, number>;
