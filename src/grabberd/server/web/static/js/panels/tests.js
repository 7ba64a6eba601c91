// Guided tests of a liner: chosen, made step by step, and read.
import { el, fill, symbol } from "../core/dom.js";
import { createMaking } from "../liner_tests/making.js";
import { createOverview } from "../liner_tests/overview.js";
import { createRecipe } from "../liner_tests/recipe.js";
import { createResult } from "../liner_tests/result.js";
import { kindIn, note } from "../liner_tests/words.js";

/** @import { PanelContext } from "./index.js" */

/** @typedef {{element: HTMLElement, unmount: () => void}} View */

export const panel = {
  title: "tests.title",

  /** @param {HTMLElement} element @param {PanelContext} context */
  mount(element, context) {
    const { t, api } = context;
    const { kind = "", id = "", test = "" } = context.parameters;
    const title = el("h1", {}, t("tests.title"));
    const place = el("div");
    const back = kind || test ? el("a", { class: "button plain", href: "#tests" }, symbol("back"), t("tests.title")) : null;
    element.append(el("div", {}, back, title), place);
    /** @type {View | null} */
    let view = null;
    let ended = false;

    /** @param {View} one */
    function show(one) {
      view = one;
      fill(place, one.element);
    }

    async function open() {
      const { recipes } = await api.get("/tests/recipes");
      const recipe = recipes.find((one) => one.kind === kind);
      if (ended) return;
      if (!recipe) return fill(place, note("warn", t("tests.unknown", { kind })));
      fill(title, kindIn(context, recipe.kind));
      show(id ? createMaking(context, recipe, id) : createRecipe(context, recipe));
    }

    if (test) show(createResult(context, test));
    else if (kind) open().catch(context.refused);
    else show(createOverview(context));
    return {
      unmount() {
        ended = true;
        view?.unmount();
      },
    };
  },
};
