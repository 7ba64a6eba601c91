// Documents that OpenAPI leaves open ("any JSON object"): only the parts that the page reads. Where OpenAPI comes to
// describe one of them, its declaration here gives way to an alias in documents.d.ts.

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
  vacuum?: { pulsation?: VacuumSource; liner?: VacuumSource; offset?: "light" | Record<string, number>; lag?: Record<string, number> };
  sought_kpa?: number;
  flow_stop?: { kpa: number; sigma_kpa: number };
  plane?: string | { point_mm: number[]; normal: number[] };
  heights_mm?: number[];
  phases?: number;
}

/** Numbers of a course over time, the logger's file, or what was recorded with the capture. */
export type VacuumSource = "log" | "channel" | { channel: string } | Record<string, number>;
