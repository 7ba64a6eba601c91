// One test: what to do, how things stand, and the one press that captures.
import { newKey, statusOf } from "../core/api.js";
import { el, fill, setText, symbol } from "../core/dom.js";
import { situationOf } from "../operate/situation.js";
import { createConditions } from "./conditions_card.js";
import { createEvaluation } from "./evaluation.js";
import { createLiner, keptWish } from "./liner.js";
import { createNumbers } from "./numbers.js";
import { missingIn, requestOf } from "./wish.js";
import { note } from "./words.js";

/** @import { Context } from "../core/context.js" */
/** @import { Recipe, RecipeStep } from "types/documents" */

/** @param {Context} context @param {Recipe} recipe */
export function createRecipe(context, recipe) {
  const { t, texts, store, api, may, go, format } = context;
  const { kind } = recipe;
  const wish = keptWish();
  const captures = kind !== "wear"; // its captures are those of the other tests
  const evaluation = recipe.several ? createEvaluation(context, recipe) : null;
  const numbers = el("div");
  const liner = createLiner(context, wish, () => {
    fill(numbers, createNumbers(context, kind, wish, show));
    evaluation?.show(wish.liner);
    show();
  });
  const conditions = captures ? createConditions(context, recipe) : null;
  const why = el("p", { class: "start-why", id: "test-why", role: "status" });
  const start = el("button", { class: "button good large wide", type: "button", data: { do: "capture-test" }, "aria-describedby": "test-why", on: { click: submit } }, symbol("start"), t("tests.start", { s: format.number(recipe.duration_s) }));
  const press = may("operator") ? el("div", { class: "stack" }, start, why) : note("idle", t("tests.viewer"));
  const steps = el("section", { class: "card stack", "aria-labelledby": "tests-steps" }, el("h2", { id: "tests-steps" }, t("tests.steps")), el("ol", { class: "tests-steps" }, recipe.steps.map((step) => el("li", {}, stepIn(step)))));
  const element = el("div", { class: "tests-two" }, el("div", { class: "stack" }, liner.element, steps), el("div", { class: "stack" }, captures && numbers, captures && press, conditions?.element, evaluation?.element));
  let key = newKey();
  let busy = false;

  /** @param {RecipeStep} step */
  function stepIn({ name, text }) {
    return texts.has(`tests.step.${kind}.${name}`) ? t(`tests.step.${kind}.${name}`) : text;
  }

  function show() {
    const { why: refused, running, armed } = situationOf(store.get(), may("operator"));
    const missing = missingIn(kind, wish);
    const reason = running || armed ? t("tests.why.capturing") : refused ? t(`operate.why.${refused}`) : missing ? t(`tests.why.${missing}`) : "";
    start.disabled = busy || reason !== "";
    setText(why, reason);
  }

  /** With the same key until an answer has come, so that one lost on the way starts no second capture. */
  async function submit() {
    if (busy) return;
    busy = true;
    show();
    try {
      const capture = await api.post("/captures", { body: requestOf(recipe, wish, context.device()?.name), key });
      go("tests", kind, capture.id);
    } catch (problem) {
      if (statusOf(problem)) key = newKey();
      context.refused(problem);
      busy = false;
      show();
    }
  }

  fill(numbers, createNumbers(context, kind, wish, show));
  evaluation?.show(wish.liner);
  const end = store.subscribe((known) => known, show);
  return {
    element,
    unmount() {
      end();
      liner.unmount();
      conditions?.unmount();
      evaluation?.unmount();
    },
  };
}
