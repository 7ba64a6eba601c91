// The daemon's documents by the page's names for them. Each is taken from the route that answers with it, so that
// neither the page nor this file depends on what OpenAPI calls its schemas.
import type { paths } from "./openapi.d.ts";
import type { Answer, Body } from "./routes.d.ts";

export type State = Answer<"get", "/state">;
export type Device = State["devices"][string];
export type Live = NonNullable<Device["live"]>;
export type HealthPart = Device["health"]["parts"]["device"];
export type Rig = NonNullable<Device["rig"]>;
export type FieldOrder = NonNullable<Device["field_order"]>;
export type Storage = State["storage"];
export type Views = Device["views"];
export type Session = Answer<"get", "/session">;
export type Role = Session["role"];
export type Threshold = NonNullable<Body<"put", "/settings">["threshold"]>;
export type Settings = Answer<"get", "/settings">;
export type Illumination = Answer<"get", "/devices/{}/light">;
export type ViewIllumination = Illumination["views"][string];
export type CurvesMessage = Answer<"get", "/devices/{}/curves">;
export type Pulsation = Answer<"get", "/devices/{}/pulsation">;

export type Capture = Answer<"get", "/captures/{}">;
export type CaptureList = Answer<"get", "/captures">;
export type CaptureFacets = NonNullable<CaptureList["facets"]>;
export type CapturesPatch = NonNullable<Body<"patch", "/captures">>;
/** What became of something that was asked for several captures. */
export type Batch = Answer<"post", "/captures/deletion">;
type Ledger = Capture["ledger"];
export type LedgerPage = Answer<"get", "/captures/{}/ledger">;
export type LedgerEntry = Ledger["entries"][number];
export type LedgerEvent = Ledger["events"][number];
export type Run = Capture["runs"][number];
/** How well a run was measured. */
export type CaptureAnalysis = NonNullable<Capture["analysis"]>;
export type Quantity = NonNullable<CaptureAnalysis["quantities"]>[number];
export type Coverage = NonNullable<Capture["coverage"]>;
type Points = Answer<"get", "/captures/{}/points">;
export type FieldPoints = Points["fields"][number];
export type NewestPoints = Answer<"get", "/devices/{}/points">;
export type ObjectModel = Answer<"get", "/devices/{}/object">;

export type Job = Answer<"get", "/jobs/{}">;
export type JobProblem = NonNullable<Job["problem"]>;
type JobResult = NonNullable<Job["result"]>;
/** A job that is done, with the result of its kind. */
export type JobWith<Result> = Omit<Job, "result"> & { result: Result };
export type AnalysisResult = Extract<JobResult, { analysis: number }>;
export type MeasurementResult = Extract<JobResult, { run: number; points: number }>;
export type CheckResult = Extract<JobResult, { parallax_px: number }>;
export type LinerTestResult = Extract<JobResult, { test: string }>;
export type Identification = Extract<JobResult, { picture: unknown }>;
export type SoughtTarget = NonNullable<Identification["asks"]>[number];
export type IdentifiedView = Identification["views"][string];
export type TargetMark = NonNullable<NonNullable<Body<"post", "/captures/{capture_id}/identification">>["marks"]>[number];
export type ImagePosition = IdentifiedView["other"][number];
export type CalibrationRow = Answer<"get", "/calibrations">["calibrations"][number];
export type CalibrationFrame = Answer<"get", "/calibration-frames">["calibration_frames"][number];
export type UnusableFrame = Answer<"get", "/calibration-frames">["unusable"][number];

export type Calibration = Answer<"get", "/calibrations/{}">;
export type CalibrationView = Calibration["views"][string];
export type CalibrationReport = Answer<"get", "/calibrations/{}/report.json">;
export type CalibrationValidity = NonNullable<CalibrationReport["validity"]>;
export type ViewValidity = CalibrationValidity["views"][number];
export type ViewMovement = CalibrationValidity["movements"][number];
export type CalibrationAcceptance = CalibrationReport["acceptance"];
export type AcceptanceReason = CalibrationAcceptance["reasons"][number];
export type RigComparison = CalibrationAcceptance["rig"][number];
export type PerAxis = Record<"x" | "y" | "z", number>;
export type MadeWith = Answer<"get", "/captures/{}/runs/{}">["made_with"];
export type StoredObject = NonNullable<MadeWith["object"]>;

export type Analysis = Answer<"get", "/captures/{}/analyses/{}">;
export type Table = Analysis["tables"][string];
export type AnalysisPreparation = Answer<"post", "/captures/{}/analysis/inputs">;
export type AnalysisRow = Answer<"get", "/captures/{}/analyses">["analyses"][number];

export type Profile = Answer<"get", "/profiles/{}/{}">;
export type ProfileRow = Answer<"get", "/profiles">["profiles"][number];

export type Logger = NonNullable<State["loggers"]>[string];
export type Recipe = Answer<"get", "/tests/recipes">["recipes"][number];
export type RecipeStep = Recipe["steps"][number];
export type LinerTestRow = Answer<"get", "/tests">["tests"][number];
export type LinerTest = Answer<"get", "/tests/{}">;
export type TestCheck = LinerTest["checks"][number];
export type TestQuantity = LinerTest["quantities"][number];
export type CheckVerdict = TestCheck["verdict"];

export type Study = Answer<"get", "/study">;
export type QuantityStudied = Study["quantities"][number];

/** A refusal, as RFC 9457 has it. */
export type Problem = paths["/api/v1/captures/{capture_id}"]["get"]["responses"][404]["content"]["application/problem+json"];
