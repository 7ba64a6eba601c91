// The fields of a capture as they were recorded, one at a time, both views or one of them.
import { FIELD_S, reasonIn, totalOf } from "../captures/words.js";
import { el, setText, symbol } from "../core/dom.js";

/** @import { Context } from "../core/context.js" */
/** @import { Capture } from "types/documents" */

const PAUSE_MS = 90;
// The newest fields of a running capture, which may not be on the disk yet: it is written to twice a second.
const UNWRITTEN = 100;
const STEPS = [[-25, "back25"], [-1, "back"], [1, "next"], [25, "next25"]];
const VIEWS = ["both", "left", "right"];
// Without a signal a grabber delivers a picture of its own, or nothing: then the picture is not there.
const IN_THE_FILE = new Set(["received", "damaged", "no_signal"]);

/** @param {Context} context */
export function createPictures(context) {
  const { t, api, format } = context;
  const image = el("img", { alt: "", hidden: true, on: { load: () => arrived(true), error: () => arrived(false) } });
  const captions = el("div", { class: "picture-captions small" });
  const missing = el("p", { class: "picture-missing", hidden: true });
  const frame = el("div", { class: "picture-frame" }, image, missing);
  const words = el("p", { class: "number", role: "status" });
  const slider = el("input", { class: "slider", type: "range", min: 0, max: 0, value: 0, "aria-label": t("capture.whichField"), on: { input: () => go(Number(slider.value)) } });
  const buttons = STEPS.map(([by, name]) => el("button", { class: "button", type: "button", data: { step: by }, "aria-label": t(`capture.step.${name}`), on: { click: () => go(n + Number(by)) } }, Number(by) < 0 && symbol("back"), Math.abs(Number(by)) > 1 && Math.abs(Number(by)), Number(by) > 0 && symbol("next")));
  const element = el("div", { class: "stack pictures" }, frame, captions, slider, el("div", { class: "row between" }, words, el("div", { class: "row" }, buttons)), choices());
  /** @type {Capture | null} */
  let capture = null;
  let n = 0;
  let view = "both";
  let timer = 0;
  let failed = false;

  /** @param {boolean} whole */
  function arrived(whole) {
    failed = !whole;
    image.hidden = failed;
  }

  function choices() {
    const one = (/** @type {string} */ name) => el("label", {}, el("input", { type: "radio", name: "picture-view", checked: name === "both", on: { change: () => look(name) } }), t(`capture.view.${name}`));
    return el("div", { class: "choices", role: "radiogroup", "aria-label": t("capture.whichView") }, VIEWS.map(one));
  }

  /** @param {number} to */
  function go(to) {
    if (!capture) return;
    n = Math.min(Math.max(to, 0), readableOf(capture) - 1);
    slider.value = String(n);
    clearTimeout(timer);
    timer = setTimeout(fetchPicture, PAUSE_MS);
    tell(capture);
  }

  function fetchPicture() {
    if (!capture) return;
    const there = IN_THE_FILE.has(outcomeOf(capture, n).outcome);
    if (!there) return void (image.hidden = true);
    image.src = api.url(`/captures/${encodeURIComponent(capture.id)}/fields/${n}.png`);
    image.alt = t("capture.picture", { n, s: format.number(n * FIELD_S, 2) });
  }

  /** @param {Capture} capture */
  function tell(capture) {
    const { outcome, reason } = outcomeOf(capture, n);
    setText(words, `${t("capture.field", { n, s: format.number(n * FIELD_S, 2) })} · ${t(`capture.outcome.${outcome}`)}`);
    missing.hidden = outcome === "received";
    setText(missing, outcome === "received" ? "" : `${t(`capture.isNot.${outcome}`)} ${reasonIn(context, reason)}.`);
  }

  /** @param {string} name */
  function look(name) {
    view = name;
    const share = capture ? shareOf(context, capture) : 0.5;
    const [first, end] = { both: [0, 1], left: [0, share], right: [share, 1] }[view] ?? [0, 1];
    frame.style.aspectRatio = String((4 / 3) * (end - first));
    image.style.inlineSize = `${100 / (end - first)}%`;
    image.style.marginInlineStart = `${(-100 * first) / (end - first)}%`;
    captions.replaceChildren(...(view === "both" ? ["left", "right"] : [view]).map((one) => el("span", { class: `picture-${one}` }, t(`capture.view.${one}`))));
    captions.style.gridTemplateColumns = view === "both" ? `${share}fr ${1 - share}fr` : "1fr";
  }

  return {
    element, go,
    /** @param {Capture} now */
    show(now) {
      const before = capture;
      capture = now;
      const total = readableOf(now);
      element.hidden = total === 0;
      slider.max = String(Math.max(0, total - 1));
      if (!before && total) look("both");
      if ((!before || readableOf(before) === 0) && total) go(Math.min(now.pre_trigger_fields, total - 1));
      else if (failed) fetchPicture();
    },
    unmount: () => clearTimeout(timer),
  };
}

/** Number of fields that can be read: of a running capture the newest are not on the disk yet. @param {Capture} capture */
function readableOf(capture) {
  return capture.verdict === null ? Math.max(0, totalOf(capture) - UNWRITTEN) : totalOf(capture);
}

/** Outcome of a field, and its reason. @param {Capture} capture @param {number} n */
function outcomeOf(capture, n) {
  const found = capture.ledger.entries.find((entry) => entry.first_n <= n && n < entry.first_n + entry.count);
  return found ?? { outcome: "received", reason: "" };
}

/** Share of the picture that is the left view, as its grabber is set now; half if the grabber is gone. @param {Context} context @param {Capture} capture */
function shareOf(context, capture) {
  const device = context.store.get().state?.devices?.[capture.device];
  const columns = device?.stream?.columns;
  return device?.views.left && typeof columns === "number" ? device.views.left.end_column / columns : 0.5;
}
