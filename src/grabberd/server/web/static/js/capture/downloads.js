// Taking a capture home: points in several formats, and the whole of it as one file.
import { ApiProblem } from "../core/api.js";
import { el, fill, symbol } from "../core/dom.js";

/** @import { Context } from "../core/context.js" */
/** @import { PointSample } from "./sample.js" */
/** @import { Capture, Problem } from "types/documents" */

/** Bytes of one point in each format; approximate for Parquet, which is compressed, and for MAT and C3D, which have room for every target in every field. */
const BYTES = { csv: 176, ply: 68, parquet: 95, mat: 105, c3d: 24 };
/** Formats that may be refused: an optional package is missing, or the capture is too long for them. */
const REFUSABLE = ["parquet", "mat", "c3d"];
const KINDS = /** @type {(keyof typeof BYTES)[]} */ (Object.keys(BYTES));

/** @param {Context} context */
export function createDownloads(context) {
  const { t, api, format } = context;
  const list = el("ul", { class: "downloads" });
  const hint = el("div", { role: "alert" });
  const element = el("section", { class: "card stack" }, el("h2", {}, t("capture.download.title")), list, hint);

  /** @param {Capture} capture @param {PointSample | null} sample of its points, or null */
  function show(capture, sample) {
    const path = /** @type {const} */ (`/captures/${encodeURIComponent(capture.id)}`);
    const points = capture.runs.length ? KINDS.map((kind) => item(kind, `${path}/points.${kind}`, `${capture.id}-points.${kind}`, sample && t("capture.download.about", { size: format.size(sample.points * BYTES[kind]) }))) : [];
    const file = item("file", `${path}/file`, `${capture.id}.grab`, format.size(capture.size_bytes));
    fill(list, ...points, file);
  }

  /** @param {string} kind @param {string} path @param {string} name @param {string | null} size */
  function item(kind, path, name, size) {
    const link = el("a", { class: "button", href: api.url(path), download: name, data: { download: kind }, on: REFUSABLE.includes(kind) ? { click: (event) => tryFirst(event, link, path) } : {} }, symbol("download"), t(`capture.download.kind.${kind}`));
    return el("li", {}, link, el("span", { class: "small muted" }, t(`capture.download.what.${kind}`), size && ` · ${size}`));
  }

  /** The request is tried first, because a browser would save the refusal as the file; its head costs nothing. @param {Event} event @param {HTMLAnchorElement} link @param {string} path */
  async function tryFirst(event, link, path) {
    if (link.dataset.tried) return;
    event.preventDefault();
    const answer = await fetch(api.url(path), { method: "HEAD" }).catch(() => null);
    if (!answer) return context.refused(new ApiProblem(0, {}));
    if (!answer.ok) return refused(await reason(path));
    link.dataset.tried = "yes";
    link.click();
  }

  /** A head has no body, so what is refused is asked for once more. @param {string} path @returns {Promise<Partial<Problem>>} */
  async function reason(path) {
    const answer = await fetch(api.url(path));
    return answer.json().catch(() => ({ detail: answer.statusText }));
  }

  /** @param {Partial<Problem>} problem */
  function refused(problem) {
    fill(hint, el("div", { class: "note is-warn" }, symbol("warn"), el("div", {}, el("strong", {}, problem.detail), problem.hint && el("p", {}, problem.hint))));
  }
  return { element, show };
}
