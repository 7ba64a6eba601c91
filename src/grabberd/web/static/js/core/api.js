// Requests to the daemon, and its refusals in words.

const ROOT = "/api/v1";

/** What the daemon, or the way to it, says no with. */
export class ApiProblem extends Error {
  /** @param {number} status 0 where no answer came @param {any} document */
  constructor(status, document) {
    super(document.detail || document.title || `HTTP ${status}`);
    this.status = status;
    this.title = document.title ?? "";
    this.detail = document.detail ?? "";
    this.hint = document.hint ?? "";
    this.kind = String(document.type ?? "").split(":").pop() ?? "";
    this.document = document;
  }
}

/**
 * @typedef {object} Options
 * @property {any} [body] sent as JSON
 * @property {string} [key] Idempotency-Key: what comes twice with it is done once
 * @property {Record<string, string>} [headers]
 * @property {AbortSignal} [signal]
 */

/** @param {{onUnauthorised: () => void}} hooks */
export function createApi(hooks) {
  /** @param {string} method @param {string} path below /api/v1 @param {Options} [options] */
  async function request(method, path, options = {}) {
    const answer = await ask(method, path, options);
    const document = await read(answer);
    if (answer.ok) return document;
    if (answer.status === 401 && !options.headers?.Authorization) hooks.onUnauthorised();
    throw new ApiProblem(answer.status, document ?? {});
  }

  /** @param {string} method */
  const by = (method) => (/** @type {string} */ path, /** @type {Options} */ options) => request(method, path, options);
  return { get: by("GET"), post: by("POST"), put: by("PUT"), patch: by("PATCH"), delete: by("DELETE"), url };
}

/** The address of something to be downloaded or shown. @param {string} path below /api/v1 */
function url(path) {
  return `${ROOT}${path}`;
}

/** @param {string} method @param {string} path @param {Options} options */
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
