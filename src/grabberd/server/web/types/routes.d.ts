// The daemon's routes as the page asks for them: from an address to its body and its answer, out of OpenAPI.
import type { AnalysisMap } from "./open_documents.d.ts";
import type { paths } from "./openapi.d.ts";

type Method = "get" | "post" | "put" | "patch" | "delete";

/** `captures/${string}` and `captures/{capture_id}` are both `captures/{}`. */
type Segments<P extends string> = P extends `${infer Head}/${infer Tail}` ? `${Segment<Head>}/${Segments<Tail>}` : Segment<P>;
type Segment<S extends string> = string extends S ? "{}" : `${number}` extends S ? "{}" : S extends `{${string}}` ? "{}" : S;
type WithoutQuery<P extends string> = P extends `${infer Path}?${string}` ? Path : P;
type BelowRoot<P> = P extends `/api/v1${infer Path}` ? Path : never;

/** Every route by its address below /api/v1, with `{}` for each of its parameters. */
type Routes = { [P in keyof paths as Segments<BelowRoot<P>>]: paths[P] };

type Operation<M extends Method, P extends string> =
  Segments<WithoutQuery<P>> extends keyof Routes ? Routes[Segments<WithoutQuery<P>>][M] : undefined;

type Json<Message> = Message extends { content: { "application/json": infer Document } } ? Document : never;
type Succeeded = 200 | 201 | 202;

/** Answers that OpenAPI leaves open, as the page reads them. */
interface Open {
  "/captures/{}/analyses/{}/maps": AnalysisMap;
}

type Success<Responses> =
  204 extends keyof Responses ? null : { [S in keyof Responses & Succeeded]: Json<Responses[S]> }[keyof Responses & Succeeded];

/** The document that a request is answered with; null where the answer has none. */
export type Answer<M extends Method, P extends string> =
  Segments<WithoutQuery<P>> extends keyof Open
    ? Open[Segments<WithoutQuery<P>>]
    : Operation<M, P> extends { responses: infer Responses } ? Success<Responses> : never;

/** The document that a request takes. */
export type Body<M extends Method, P extends string> = Operation<M, P> extends { requestBody?: infer Message } ? Json<Message> : never;

export interface RequestOptions<Document> {
  /** Sent as JSON. */
  body?: Document;
  /** Idempotency-Key: a request that is repeated with it is carried out once. */
  key?: string;
  headers?: Record<string, string>;
  signal?: AbortSignal;
}

/** An address that OpenAPI does not know is refused by an argument that nobody can give. */
type Rest<M extends Method, P extends string> =
  Operation<M, P> extends { responses: unknown } ? [options?: RequestOptions<Body<M, P>>] : [unknown_route: never];

type Request<M extends Method> = <P extends string>(path: P, ...rest: Rest<M, P>) => Promise<Answer<M, P>>;

export interface Api {
  get: Request<"get">;
  post: Request<"post">;
  put: Request<"put">;
  patch: Request<"patch">;
  delete: Request<"delete">;
  /** The address of something to be downloaded or shown. */
  url(path: string): string;
}
