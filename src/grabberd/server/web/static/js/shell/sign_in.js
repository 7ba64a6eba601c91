// Signing in: a token is shown once, and traded for a session that no page can read.
import { ApiProblem } from "../core/api.js";
import { el, fill, symbol } from "../core/dom.js";

/** @import { Context } from "../core/context.js" */

/** @param {Context} context */
export function createSignIn(context) {
  const { t } = context;
  const input = el("input", {
    class: "input", id: "token", type: "password", name: "token", required: true,
    autocomplete: "current-password", autocapitalize: "none", spellcheck: "false", "aria-describedby": "token-hint",
  });
  const button = el("button", { class: "button primary wide", type: "submit" }, t("signin.submit"));
  const refusal = el("div", { class: "refusal", role: "alert" });
  const form = el("form", { class: "card sign-in" },
    el("h1", {}, t("signin.title")),
    el("p", { id: "token-hint", class: "muted" }, t("signin.hint")),
    el("label", { class: "field", for: "token" }, el("span", { class: "field-label" }, t("signin.token")), input),
    refusal,
    button,
  );
  form.addEventListener("submit", async (event) => {
    event.preventDefault();
    button.disabled = true;
    fill(refusal);
    fill(refusal, await signIn(context, input.value.trim()));
    button.disabled = false;
  });
  return form;
}

/** @param {Context} context @param {string} token @returns {Promise<HTMLElement | null>} a refusal, or nothing */
async function signIn({ api, store, t }, token) {
  try {
    const headers = { Authorization: `Bearer ${token}` };
    const session = await api.post("/session", { headers });
    const state = await api.get("/state");
    store.set({ session, state });
    return null;
  } catch (problem) {
    const words = wordsOf(problem, t);
    return el("p", { class: "refused" }, symbol("bad"), el("span", {}, words));
  }
}

/** @param {unknown} problem @param {(key: string) => string} t */
function wordsOf(problem, t) {
  if (!(problem instanceof ApiProblem)) return t("signin.wrong");
  if (problem.status === 0) return t("core.noAnswer");
  if (problem.kind === "token-expired") return t("signin.expired");
  if (problem.status === 401 || problem.status === 400) return t("signin.wrong");
  if (problem.status === 429) return t("signin.tooMany");
  return problem.detail || t("signin.wrong");
}
