// Requests to the daemon, and its refusals.

/** @import { Problem } from "types/documents" */
/** @import { Api, RequestOptions } from "types/routes" */

const ROOT = "/api/v1";

/** A refusal of the daemon (RFC 9457), or of the way to it: then its status is 0. */
export class ApiProblem extends Error {
  /** @param {number} status 0 where no answer came @param {Partial<Problem>} document */
  constructor(status, document) {
    super(document.detail || document.title || `HTTP ${status}`);
    this.status = status;
    this.detail = document.detail ?? "";
    this.hint = document.hint ?? "";
    this.kind = String(document.type ?? "").split(":").pop() ?? "";
  }
}

/** The HTTP status that a request failed with; undefined where the page itself failed. @param {unknown} error */
export function statusOf(error) {
  return error instanceof ApiProblem ? error.status : undefined;
}

/** @param {{onUnauthorised: () => void}} hooks @returns {Api} */
export function createApi(hooks) {
  /** @param {string} method @param {string} path below /api/v1 @param {RequestOptions<unknown>} [options] */
  async function request(method, path, options = {}) {
    const answer = await ask(method, path, options);
    const document = await read(answer);
    if (answer.ok) return document;
    if (answer.status === 401 && !options.headers?.Authorization) hooks.onUnauthorised();
    throw new ApiProblem(answer.status, document ?? {});
  }

  /** @param {string} method */
  const by = (method) => (/** @type {string} */ path, /** @type {RequestOptions<unknown>} */ options) => request(method, path, options);
  const requests = { get: by("GET"), post: by("POST"), put: by("PUT"), patch: by("PATCH"), delete: by("DELETE"), url };
  // An answer is taken to be as OpenAPI has it and not looked at again: the daemon's own tests hold it to that.
  return /** @type {Api} */ (/** @type {unknown} */ (requests));
}

/** @param {string} path below /api/v1 */
function url(path) {
  return `${ROOT}${path}`;
}

/** @param {string} method @param {string} path @param {RequestOptions<unknown>} options */
async function ask(method, path, options) {
  /** @type {Record<string, string>} */
  const headers = { ...options.headers };
  if (options.body !== undefined) headers["Content-Type"] = "application/json";
  if (options.key) headers["Idempotency-Key"] = options.key;
  const body = options.body === undefined ? undefined : JSON.stringify(options.body);
  try {
    return await fetch(url(path), { method, headers, body, signal: options.signal });
  } catch (error) {
    if (options.signal?.aborted) throw error;
    throw new ApiProblem(0, { title: "no answer", type: "urn:grabberd:problem:no-answer" });
  }
}

/** @param {Response} answer */
async function read(answer) {
  if (answer.status === 204) return null;
  const isJson = (answer.headers.get("content-type") ?? "").includes("json");
  return isJson ? answer.json() : answer.text();
}

/** A new Idempotency-Key: one for each intention, kept until its answer has come. */
export function newKey() {
  const bytes = crypto.getRandomValues(new Uint8Array(16));
  return Array.from(bytes, (byte) => byte.toString(16).padStart(2, "0")).join("");
}
