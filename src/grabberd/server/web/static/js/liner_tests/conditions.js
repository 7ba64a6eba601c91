// Whether what a recipe asks for is so at the moment, as far as the instrument knows. Nothing here touches the page.

/** @import { Sample } from "../live/curves_message.js" */
/** @import { Device, Logger, Recipe } from "types/documents" */

/** Within this a gauge shows no vacuum: its zero is off by some tenths. */
const NONE_KPA = 1;
/** A wall whose width stays within this stands still: ten times what its measurement scatters by. */
const STILL_MM = 0.4;
/** A share of the targets that a wall which has not closed shows to each view. */
const ENOUGH = 0.9;
const GONE_KPA = 20;

/**
 * @typedef {object} Condition
 * @property {"device" | "measures" | "targets" | "wall" | "pulsation" | "liner"} name
 * @property {"good" | "warn" | "bad" | "idle"} level
 * @property {string} word its text, by key
 * @property {Record<string, number>} values of the text
 */

/**
 * @param {Device | null} device
 * @param {Record<string, Logger>} loggers
 * @param {Pick<Sample, "widths">[]} samples of the last seconds
 * @param {number} targets of the object model; 0 where it is not known
 * @param {Recipe} recipe
 * @returns {Condition[]}
 */
export function conditionsOf(device, loggers, samples, targets, recipe) {
  if (!device) return [condition("device", "bad", "away")];
  return [readiness(device), measures(device), targetsOf(device, targets, recipe), wall(samples, recipe), vacuum("pulsation", device, loggers, recipe), vacuum("liner", device, loggers, recipe)];
}

/** @param {Condition["name"]} name @param {Condition["level"]} level @param {string} word @param {Record<string, number>} [values] @returns {Condition} */
const condition = (name, level, word, values = {}) => ({ name, level, word, values });

/** @param {Device} device */
function readiness({ state, health }) {
  if ((state !== "ready" && state !== "capturing") || health.start === "refused") return condition("device", "bad", "notReady");
  return health.start === "doubtful" ? condition("device", "warn", "doubtful") : condition("device", "good", "ready");
}

/** @param {Device} device */
function measures(device) {
  const can = device.lacks.length === 0;
  return condition("measures", can ? "good" : "bad", can ? "ready" : "lacking");
}

/** @param {Device} device @param {number} targets @param {Recipe} recipe */
function targetsOf(device, targets, recipe) {
  const views = device.live?.views;
  if (!views) return condition("targets", "idle", "unknown");
  const values = { left: views.left, right: views.right, of: targets };
  if (recipe.pulsates !== false || !targets) return condition("targets", "idle", "counted", values); // a closing wall hides some
  const enough = Math.min(views.left, views.right) >= ENOUGH * targets;
  return condition("targets", enough ? "good" : "warn", "counted", values);
}

/** @param {Pick<Sample, "widths">[]} samples @param {Recipe} recipe */
function wall(samples, recipe) {
  const widths = samples.flatMap((sample) => sample.widths.slice(0, 1).flatMap(({ width_mm }) => (width_mm === null ? [] : [width_mm])));
  if (widths.length < 3) return condition("wall", "idle", "unknown");
  const moved_mm = Math.max(...widths) - Math.min(...widths);
  const moves = moved_mm > STILL_MM;
  const level = recipe.pulsates === null ? "idle" : moves === recipe.pulsates ? "good" : "warn";
  return condition("wall", level, moves ? "moves" : "still", { mm: moved_mm });
}

/** @param {"pulsation" | "liner"} name @param {Device} device @param {Record<string, Logger>} loggers @param {Recipe} recipe */
function vacuum(name, device, loggers, recipe) {
  const channels = Object.values(loggers).flatMap((logger) => Object.values(logger.channels));
  const channel = channels.find(({ quantity, devices }) => quantity === name && (!devices.length || devices.includes(device.name)));
  if (!channel) return condition(name, "idle", "noGauge");
  if (channel.kpa === null) return condition(name, "warn", "silent");
  const level = levelOf(name, channel.kpa, recipe.kind);
  return condition(name, level, level === "warn" ? `wrong_${wanted(name, recipe.kind)}` : "now", { kpa: channel.kpa });
}

/** What a recipe asks of a chamber. @param {"pulsation" | "liner"} name @param {Recipe["kind"]} kind @returns {"none" | "milking" | "open"} */
function wanted(name, kind) {
  if (kind === "reference" || kind === "artificial-teat") return "none";
  return name === "liner" && (kind === "ramp" || kind === "milking" || kind === "overpressure") ? "milking" : "open";
}

/** @param {"pulsation" | "liner"} name @param {number} kpa @param {Recipe["kind"]} kind @returns {Condition["level"]} */
function levelOf(name, kpa, kind) {
  const state = wanted(name, kind);
  if (state === "open") return "idle";
  return (state === "none" ? Math.abs(kpa) <= NONE_KPA : kpa >= GONE_KPA) ? "good" : "warn";
}
