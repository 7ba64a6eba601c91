// Entry point: loads the first view's texts, creates store and shell, opens the stream of changes.
import { createConnection } from "./core/connection.js";
import { createContext } from "./core/context.js";
import { createTexts } from "./core/texts.js";
import { createShell } from "./shell/shell.js";

/** @import { First } from "./core/context.js" */
/** @import { Catalogue } from "./core/texts.js" */

/** @type {First} */
const first = JSON.parse(document.getElementById("first")?.textContent ?? "{}");
const language = document.documentElement.lang;

/** Texts of the language. @param {string} name @returns {Promise<Record<string, Catalogue>>} */
async function catalogues(name) {
  const answer = await fetch(new URL(`../texts/${name}.json`, import.meta.url));
  if (!answer.ok) throw new Error(`texts ${name}: ${answer.status}`); // as after an upgrade, which has other addresses
  return answer.json();
}

const texts = createTexts(await catalogues(language), language, () => catalogues(`${language}.rest`));
const context = createContext(first, texts);
const connection = createConnection(context.store, context.api);
// The frame without its panel, which the daemon wrote into the page, was there to be seen at once.
document.getElementById("waiting")?.replaceWith(createShell(context));
context.store.subscribe(
  (known) => known.session !== null,
  (isKnown) => (isKnown ? connection.start() : connection.stop()),
);
