// Pinning and deleting a capture.
import { atRest, labelsIn } from "../captures/words.js";
import { el, fill, setText, symbol } from "../core/dom.js";

/** @import { Context } from "../core/context.js" */
/** @import { Capture } from "types/documents" */

/** @param {Context} context @param {(capture: Capture) => void} changed */
export function createKeep(context, changed) {
  const { t, api, format } = context;
  const pin = el("button", { class: "button", type: "button", data: { do: "pin" }, on: { click: turn } });
  const remove = el("button", { class: "button danger", type: "button", data: { do: "delete" }, "aria-describedby": "delete-why", on: { click: ask } }, symbol("delete"), t("capture.delete.action"));
  const why = el("p", { class: "muted", id: "delete-why" });
  const element = el("section", { class: "card stack", hidden: !context.may("operator") }, el("h2", {}, t("capture.keep.title")), el("p", { class: "muted" }, t("capture.keep.about")), el("div", { class: "row" }, pin, remove), why);
  /** @type {Capture | null} */
  let capture = null;

  /** @param {Capture} now */
  function show(now) {
    capture = now;
    const reason = now.pinned ? "pinned" : atRest(now) ? null : now.state;
    fill(pin, symbol("pin"), t(now.pinned ? "capture.keep.unpin" : "capture.keep.pin"));
    pin.disabled = now.state === "armed";
    remove.disabled = reason !== null;
    setText(why, reason ? t(`capture.delete.why.${reason}`) : "");
    why.hidden = reason === null;
  }

  async function turn() {
    if (!capture) return;
    const now = await api.patch(pathOf(capture), { body: { pinned: !capture.pinned } }).catch(context.refused);
    if (now) changed(now);
  }

  async function ask() {
    if (!capture) return;
    const path = pathOf(capture);
    const name = [format.moment(capture.created_utc), labelsIn(context, capture)].filter(Boolean).join(" · ");
    const sure = await context.confirm({ title: t("capture.delete.title"), text: t("capture.delete.text", { name }), action: t("capture.delete.action"), danger: true });
    if (!sure) return;
    try {
      await api.delete(path);
      context.announce(t("capture.delete.done"), { kind: "good" });
      context.go("captures");
    } catch (problem) {
      context.refused(problem);
    }
  }

  return { element, show };
}

/** @param {Capture} capture @returns {`/captures/${string}`} */
const pathOf = (capture) => `/captures/${encodeURIComponent(capture.id)}`;
