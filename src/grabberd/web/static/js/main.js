// Entry point: loads the texts, creates store and shell, opens the stream of changes.
import { createConnection } from "./core/connection.js";
import { createContext } from "./core/context.js";
import { createShell } from "./shell/shell.js";

/** @import { First } from "./core/context.js" */
/** @import { Catalogue } from "./core/texts.js" */

/** @type {First} */
const first = JSON.parse(document.getElementById("first")?.textContent ?? "{}");
const language = document.documentElement.lang;

/** Every text of the language. @returns {Promise<Catalogue>} */
async function catalogue() {
  const answer = await fetch(new URL(`../texts/${language}.json`, import.meta.url));
  return answer.json();
}

const context = createContext(first, await catalogue(), language);
const connection = createConnection(context.store, context.api);
// The frame without its panel, which the daemon wrote into the page, was there to be seen at once.
document.getElementById("waiting")?.replaceWith(createShell(context));
context.store.subscribe(
  (known) => known.session !== null,
  (isKnown) => (isKnown ? connection.start() : connection.stop()),
);
