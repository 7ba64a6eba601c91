// Overview: which liner, which test, and what was found before.
import { el, fill, symbol } from "../core/dom.js";
import { createHistory } from "./history.js";
import { createLiner, keptWish } from "./liner.js";
import { kindIn } from "./words.js";

/** @import { Context } from "../core/context.js" */
/** @import { Recipe } from "types/documents" */

/** @param {Context} context */
export function createOverview(context) {
  const { t, api } = context;
  const wish = keptWish();
  const history = createHistory(context);
  const liner = createLiner(context, wish, () => history.show(wish.liner));
  const recipes = el("ol", { class: "tests-recipes" });
  const element = el("div", { class: "stack" }, liner.element, el("section", { class: "stack", "aria-labelledby": "tests-which" }, el("h2", { id: "tests-which" }, t("tests.which")), recipes), history.element);

  /** @param {Recipe} recipe */
  function item(recipe) {
    return el("li", {}, el("a", { class: "card tests-recipe", href: `#tests/${recipe.kind}`, data: { recipe: recipe.kind } },
      el("strong", {}, kindIn(context, recipe.kind)), el("span", {}, t(`tests.about.${recipe.kind}`)), symbol("next")));
  }

  history.show(wish.liner);
  api.get("/tests/recipes").then((found) => fill(recipes, ...found.recipes.map(item)), context.refused);
  return {
    element,
    unmount() {
      liner.unmount();
      history.unmount();
    },
  };
}
