// The settings of the next capture: length, fields before the start, labels. Remembered on this tablet.
import { el, setText } from "../core/dom.js";
import { keep, kept } from "../core/kept.js";
import { createNumberField } from "../core/number_field.js";
import { deviceOf, isSeveral, rateOf } from "../core/store.js";
import { KINDS, USUAL, isSound, lengthOf, limitsOf, namesSubject, nextOf, requestOf, wishFrom } from "./wish.js";
import { createLabelling } from "./labelling.js";
import { createLabels } from "./labels.js";
import { createRate } from "./rate.js";
import { createRequested } from "./requested.js";

/** @import { Context } from "../core/context.js" */
/** @import { Change, Wish } from "./wish.js" */

const STEPS = { seconds: 5, cycles: 5, fields: 50 };

/**
 * @param {Context} context
 * @param {{changed: () => void, labelled: () => void}} told of another wish, and of labels that a capture has now
 */
export function createForm(context, { changed, labelled }) {
  const { t, store, format } = context;
  /** @type {Wish} */
  const wish = { ...USUAL, ...wishFrom(kept("wish")) };
  const rate = () => rateOf(context.device());
  const slots = () => context.device()?.ring.slots ?? 32;

  const is = el("p", { class: "field-hint", id: "length-is" });
  const attributes = { class: "input number", id: "length-value", "aria-describedby": "length-is" };
  const value = createNumberField(context, attributes, (n) => wish.kind !== "stop" && set(wish.kind, n ?? NaN), () => limitsOf(wish, rate()));
  const stepper = el("div", { class: "stepper" }, step(-1, t("operate.length.less"), "−"), value.input, step(+1, t("operate.length.more"), "+"));
  const perMinute = createRate(context, wish, set, () => {
    show();
    changed();
  });
  const valueField = el("div", { class: "field" }, el("label", { class: "field-label", for: "length-value" }, t("operate.length.value")), stepper, value.problem);
  const before = el("input", { class: "slider", type: "range", id: "before", min: 0, step: 1, on: { input: () => set("before", Number(before.value)) } });
  const beforeWords = el("p", { class: "field-hint" });
  const wait = el("input", { type: "checkbox", checked: wish.wait, on: { change: () => set("wait", wait.checked) } });
  const all = el("input", { type: "checkbox", checked: wish.all, data: { wish: "all" }, on: { change: () => set("all", all.checked) } });
  const allField = el("label", { class: "check", hidden: true }, all, t("operate.all"));
  const isForAll = () => wish.all && isSeveral(store.get());
  const labels = createLabels(context, wish, typed);
  const labelling = createLabelling(context, wish, { gone: () => set("of", ""), sent });
  const requested = createRequested(context, changed);
  /** All that was typed is with its capture. */
  let stored = false;
  const running = () => deviceOf(store.get())?.capture_id ?? null;

  /** @type {Change} */
  function set(name, given) {
    wish[name] = given;
    keep("wish", wish);
    show();
    changed();
  }

  /** What is typed belongs to the capture that runs, whoever started it, or to the last one. @type {Change} */
  function typed(name, given) {
    const before = wish.labels;
    stored = false;
    if (running() && running() !== wish.of) labelling.send(); // to the capture that it was typed for
    wish.of = running() ?? wish.of;
    set(name, given);
    if (name !== "labels") return labelling.changed(null);
    relabel(before);
  }

  /** Has the labels sent that are no longer as they were. @param {Wish["labels"]} before */
  function relabel(before) {
    for (const label of Object.keys(wish.labels)) if (wish.labels[label] !== before[label]) labelling.changed(label);
  }

  function sent() {
    stored = true;
    show();
    labelled();
  }

  /** Requests the capture, or one of each device, and returns it, or the first. @param {string} key Idempotency-Key */
  async function request(key) {
    if (isForAll()) return (await context.api.post("/capture-groups", { body: requestOf(wish, { devices: "all" }, rate()), key })).captures[0];
    return context.api.post("/captures", { body: requestOf(wish, { device: context.device()?.name }, rate()), key });
  }

  /** @param {Partial<Wish>} changes */
  function take(changes) {
    Object.assign(wish, changes);
    stored = false;
    labels.fill();
    keep("wish", wish);
    show();
    changed();
  }

  /** @param {number} direction @param {string} label @param {string} sign */
  function step(direction, label, sign) {
    const press = () => {
      if (wish.kind === "stop") return;
      const by = STEPS[wish.kind];
      set(wish.kind, Math.max(by, (wish[wish.kind] || 0) + direction * by));
    };
    return el("button", { class: "button", type: "button", "aria-label": label, on: { click: press } }, sign);
  }

  function show() {
    valueField.hidden = wish.kind === "stop";
    perMinute.show();
    wish.perMinute = perMinute.value();
    value.show(wish.kind === "stop" ? null : wish[wish.kind]);
    const length = lengthOf(wish, rate());
    is.hidden = length === null || !isSound(wish, rate());
    if (length !== null) setText(is, t("operate.length.is", { seconds: format.number(length / rate(), 2), fields: format.number(length) }));
    labels.tell(running() ? "running" : wish.of ? "last" : "next", stored);
    element.classList.toggle("is-capturing", running() !== null);
    showBefore();
  }

  function showBefore() {
    wish.before = Math.min(wish.before, slots());
    before.max = String(slots());
    before.value = String(wish.before);
    const values = { seconds: format.number(wish.before / rate(), 2), fields: format.number(wish.before) };
    const words = wish.before ? t("operate.before.some", values) : t("operate.before.none");
    setText(beforeWords, words);
    before.setAttribute("aria-valuetext", words);
  }

  const element = el("section", { class: "card operate-form" },
    el("fieldset", { class: "field" }, el("legend", { class: "field-label" }, t("operate.length.title")),
      el("div", { class: "choices" }, KINDS.map((kind) => choice(kind)))),
    el("div", { class: "length-row" }, valueField, perMinute.element), is,
    el("div", { class: "field" }, el("label", { class: "field-label", for: "before" }, t("operate.before.title")), before, beforeWords),
    el("label", { class: "check" }, wait, t("operate.wait")),
    allField,
    labels.element,
  );
  labels.fill();

  /** What was typed and cannot be used is not kept for when this kind is chosen again. @param {Wish["kind"]} kind */
  function choose(kind) {
    if (kind !== "stop" && !Number.isFinite(wish[kind])) wish[kind] = USUAL[kind];
    set("kind", kind);
  }

  /** @param {Wish["kind"]} kind */
  function choice(kind) {
    const input = el("input", { type: "radio", name: "length", value: kind, checked: wish.kind === kind, on: { change: () => choose(kind) } });
    return el("label", {}, input, el("span", {}, t(`operate.length.${kind}`)));
  }

  const stop = store.subscribe((known) => `${rateOf(deviceOf(known))} ${deviceOf(known)?.capture_id}`, show);
  const count = store.subscribe(isSeveral, (several) => (allField.hidden = !several));
  const follow = store.subscribe((known) => known.session?.role, () => (element.hidden = !context.may("operator")));
  return {
    element,
    /** Requests the capture; what is labelled is that one from now on. @param {string} key Idempotency-Key */
    async submit(key) {
      await labelling.send();
      const { of, labels: before, note } = wish; // what is typed until the answer is there is not in the request
      wish.of = ""; // nor is it for the last capture
      const begun = await request(key).catch((problem) => {
        if (wish.labels === before && wish.note === note) wish.of = of;
        throw problem;
      });
      requested.follow(begun.id);
      take({ of: begun.id });
      relabel(before);
      if (wish.note !== note) labelling.changed(null);
    },
    /** True while a capture that was requested is not seen to run. */
    isRequested: requested.isAwaited,
    /** True if the labels are those of a cow whose capture is over. */
    isOver: () => wish.of !== "" && namesSubject(wish),
    /** Empties what says whose the last capture was. */
    async next() {
      await labelling.send();
      take(nextOf(wish));
      labels.focus();
    },
    isSound: () => isSound(wish, rate()),
    waits: () => wish.wait,
    unmount() {
      for (const end of [stop, requested.unmount, count, follow, perMinute.unmount, labelling.unmount]) end();
    },
  };
}
