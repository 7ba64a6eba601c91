// Says that the daemon is away, and since when.
import { el, setText, symbol } from "../core/dom.js";

/** @import { Context } from "../core/context.js" */

const PATIENCE_MS = 1500;

/** @param {Context} context */
export function createBanner(context) {
  const { t, format, store } = context;
  const words = el("span");
  const banner = el("div", { class: "banner bad", hidden: true }, symbol("away"), words);
  const region = el("div", { role: "alert" }, banner);
  let timer = 0;
  store.subscribe(
    (known) => known.connection,
    ({ online, since }) => {
      clearTimeout(timer);
      if (online) banner.hidden = true;
      else timer = setTimeout(() => {
        setText(words, t("core.away", { time: format.time(since) }));
        banner.hidden = false;
      }, PATIENCE_MS);
    },
  );
  return region;
}
