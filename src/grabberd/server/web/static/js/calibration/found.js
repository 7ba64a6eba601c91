// Step 3: which targets the capture shows in each view, and which are missing.
import { newKey, statusOf } from "../core/api.js";
import { el, fill, symbol } from "../core/dom.js";
import { createJob } from "../jobs/job.js";
import { latestJob } from "./latest_job.js";
import { addPose, createPoses, keepMarks, marksOf, MOST_POSES, posesTaken, removePose } from "./poses.js";
import { addressOf, note, way } from "./steps.js";
import { createTargetPicture } from "./target_picture.js";

/** @import { Context } from "../core/context.js" */
/** @import { Identification, JobWith, SoughtTarget, TargetMark } from "types/documents" */

const ENOUGH = 0.6;
const VIEWS = ["left", "right"];

/** @param {Context} context @param {string} id of the capture */
export function createFound(context, id) {
  const { t, api, may } = context;
  const job = createJob(context, { title: t("calibration.found.looking"), done: (/** @type {JobWith<Identification>} */ { result }) => show(result), busy: (on) => (ways.hidden = on) });
  const body = el("div", { class: "stack" });
  const ways = el("div", { class: "row between" });
  const poses = createPoses(context, (removed) => (removed === id ? context.go("calibration", "place") : list()));
  const element = el("div", { class: "stack" }, el("section", { class: "card stack" }, el("h2", {}, t("calibration.found.title")), job.element, body, poses.element, ways));
  /** @type {ReturnType<typeof createTargetPicture>[]} */
  let pictures = [];
  let ended = false;

  async function open() {
    const known = await latestJob(context, "identify", (subject) => subject === id);
    const usable = known && known.state !== "cancelled" ? known : may("operator") ? await submit() : null;
    if (ended) return;
    offer(null);
    if (usable) job.follow(usable);
    else fill(body, note("idle", t("calibration.viewer")));
  }

  async function submit() {
    const { labels } = await api.get(`/captures/${encodeURIComponent(id)}`);
    const body = { ...(labels.calibration_frame ? { calibration_frame: labels.calibration_frame } : {}), marks: marksOf(id) };
    return api.post(`/captures/${encodeURIComponent(id)}/identification`, { body, key: newKey() });
  }

  /** @param {Identification} result */
  function show(result) {
    const { views } = context.device() ?? {};
    const known = VIEWS.filter((name) => views && name in views); // none while the device is unknown
    for (const one of pictures) one.unmount();
    pictures = views ? known.map((name) => createTargetPicture(name, views[name], labelOf(name, result))) : [];
    const [sought] = result.asks ?? [];
    if (sought) fill(body, question(sought, pictures[0]));
    else fill(body, headOf(result), namesButton(), el("div", { class: "target-views" }, known.map((name, i) => viewOf(name, pictures[i], result))));
    const address = api.url(`/captures/${encodeURIComponent(id)}/fields/${result.picture.field}.png`);
    known.forEach((name, i) => pictures[i].show(address, result.picture, result.views[name]));
    offer(result);
  }

  /** What somebody has seen decides where the picture cannot. @param {TargetMark} mark */
  async function answer(mark) {
    keepMarks(id, [...marksOf(id), mark]);
    fill(body);
    try {
      job.follow(await submit());
    } catch (problem) {
      context.refused(problem);
    }
  }

  function startAgain() {
    keepMarks(id, []);
    fill(body);
    submit().then(job.follow, context.refused);
  }

  /** @param {Identification} result */
  function headOf(result) {
    if (result.problem) return refusal(result, result.problem);
    const missing = VIEWS.some((name) => result.views[name].missing.length > 0);
    return note(missing ? "warn" : "good", el("strong", {}, t(missing ? "calibration.found.some" : "calibration.found.all", { of: result.of })),
      el("p", {}, t("calibration.found.stands", { turn: context.format.number(result.turn_deg ?? 0) })));
  }

  /** Tells why the targets could not be identified, and how to fix it. @param {Identification} result @param {{message: string, hint: string}} problem */
  function refusal(result, problem) {
    const few = VIEWS.some((name) => result.views[name].other.length < ENOUGH * result.of);
    const fix = result.moved ? "fixStill" : result.mirrored ? "fixMirrored" : marksOf(id).length ? "fixAnswer" : few ? "fixLight" : "fixFrame";
    return note("bad", el("strong", {}, t(result.mirrored ? "calibration.found.mirrored" : "calibration.found.refused")), el("p", {}, t(`calibration.found.${fix}`)),
      el("p", { class: "small" }, el("strong", {}, t("lights.said")), " ", problem.message, " – ", problem.hint),
      marksOf(id).length ? el("button", { class: "button", type: "button", data: { do: "ask-again" }, on: { click: startAgain } }, t("calibration.found.askAgain")) : null);
  }

  /** The frame looks the same in several ways: asks where one target is. @param {SoughtTarget} sought @param {ReturnType<typeof createTargetPicture>} picture of the left view */
  function question({ target, x_mm, y_mm, places }, picture) {
    const place = { target, x: context.format.number(x_mm, 1), y: context.format.number(y_mm, 1) };
    if (may("operator")) picture?.ask(places, t("calibration.found.here", { target }), ({ x_px, y_px }) => answer({ view: "left", target, x_px, y_px }));
    return el("div", { class: "calibration-two" },
      note("warn", el("strong", {}, t("calibration.found.ask", { target })), el("p", {}, t("calibration.found.askWhich", place)), el("p", { class: "small" }, t("calibration.found.askWhy"))),
      el("section", { class: "stack tight target-question" }, el("h3", {}, t("live.view.left")), picture?.element));
  }

  function namesButton() {
    const button = el("button", { class: "button", type: "button", "aria-pressed": "true", data: { toggle: "names" } }, t("live.ids"));
    button.addEventListener("click", () => {
      const on = button.getAttribute("aria-pressed") !== "true";
      button.setAttribute("aria-pressed", String(on));
      for (const one of pictures) one.name(on);
    });
    return el("div", { class: "row" }, button);
  }

  /** @param {string} name @param {ReturnType<typeof createTargetPicture>} picture @param {Identification} result */
  function viewOf(name, picture, result) {
    const view = result.views[name];
    const missing = view.missing.length === result.of ? t("calibration.found.noneNamed") : view.missing.join(", ");
    return el("section", { class: "target-view stack", data: { view: name } }, el("h3", {}, labelOf(name, result)), picture.element,
      el("p", {}, el("strong", {}, t("calibration.found.missing")), " ", view.missing.length ? missing : t("calibration.found.nothing")),
      view.other.length ? el("p", { class: "muted small" }, context.tn("calibration.found.other", view.other.length)) : null);
  }

  /** @param {string} name @param {Identification} result */
  function labelOf(name, result) {
    return t("calibration.found.view", { view: t(`live.view.${name}`), n: result.views[name].found.length, of: result.of });
  }

  /** @param {Identification | null} result */
  function offer(result) {
    if (!may("operator")) return fill(ways);
    const isGood = result && !result.problem;
    if (isGood) addPose(context, id);
    list();
    fill(ways,
      el("div", { class: "row", on: { click: () => removePose(context, id) } }, way(addressOf("place"), t("calibration.found.placeAgain"), result?.problem && !result.moved && !result.asks?.length ? "primary" : ""), way(addressOf("take"), t("calibration.again"), result?.moved ? "primary" : "")),
      isGood ? el("div", { class: "row" }, another(), el("a", { class: "button primary", href: addressOf("adjust", id) }, t("calibration.next"), symbol("next"))) : null);
  }

  function another() {
    return posesTaken(context).length < MOST_POSES ? way(addressOf("place"), t("calibration.poses.another")) : null;
  }

  function list() {
    const taken = posesTaken(context);
    poses.element.hidden = taken.length === 0;
    poses.show(taken).catch(context.refused);
  }

  open().catch((problem) => {
    offer(null);
    if (statusOf(problem) === 404) fill(body, note("bad", t("calibration.take.gone")));
    else context.refused(problem);
  });
  return {
    element,
    unmount() {
      ended = true;
      job.unmount();
      poses.unmount();
      for (const one of pictures) one.unmount();
    },
  };
}
