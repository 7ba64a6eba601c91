// The capture that was requested last: it is not over before it was seen to run, or to be at rest.
import { deviceOf } from "../core/store.js";

/** @import { Context } from "../core/context.js" */
/** @import { Known } from "../core/store.js" */

const LOOK_MS = 3000; // a capture of a few fields may end before any state shows that it ran

/** @param {Context} context @param {() => void} seen it runs, or has come and gone */
export function createRequested({ store, api }, seen) {
  /** @type {string | null} */
  let requested = null;

  /** @param {string | null} id of a capture that was seen */
  function began(id) {
    if (id === null || id !== requested) return;
    requested = null;
    seen();
  }

  /** Asks for it where no state has shown it: it may have ended meanwhile, or states come late. @param {string} id */
  async function look(id) {
    if (id !== requested) return;
    const capture = await api.get(`/captures/${encodeURIComponent(id)}`).catch(() => null);
    if (capture?.verdict === null) setTimeout(look, LOOK_MS, id);
    else began(id);
  }

  const unmount = store.subscribe(currentOf, began);
  return {
    unmount,
    /** @param {string} id */
    follow(id) {
      requested = id;
      setTimeout(look, LOOK_MS, id);
    },
    /** True while it is not seen to run. */
    isAwaited: () => requested !== null,
  };
}

/** @param {Known} known */
function currentOf(known) {
  const device = deviceOf(known);
  return device?.capture_id ?? device?.armed_capture_id ?? device?.sealing_capture_id ?? null;
}
