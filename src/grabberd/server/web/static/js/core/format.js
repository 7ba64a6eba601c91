// Numbers, times and sizes as people read them.

/** @import { Values } from "./texts.js" */

/** @typedef {ReturnType<typeof createFormat>} Format */
/** @typedef {string | number} Time ISO 8601, or milliseconds since 1970 */

/** @param {string} language @param {(key: string, values?: Values) => string} t */
export function createFormat(language, t) {
  const region = language === "en" ? "en-GB" : language; // the day before the month
  const clock = new Intl.DateTimeFormat(region, { hour: "2-digit", minute: "2-digit", second: "2-digit", hourCycle: "h23" });
  const day = new Intl.DateTimeFormat(region, { day: "numeric", month: "short", year: "numeric" });
  const moment = new Intl.DateTimeFormat(region, {
    day: "numeric", month: "short", hour: "2-digit", minute: "2-digit", hourCycle: "h23",
  });
  const hour = new Intl.DateTimeFormat(region, { hour: "2-digit", minute: "2-digit", hourCycle: "h23" });
  const near = new Intl.RelativeTimeFormat(region, { numeric: "auto" });

  /** By digits: to make one takes far longer than to use it. @type {Map<number, Intl.NumberFormat>} */
  const numbers = new Map();

  /** @param {number | null | undefined} value @param {number} [digits] after the point */
  function number(value, digits = 0) {
    if (value === null || value === undefined || !Number.isFinite(value)) return "–";
    const known = numbers.get(digits) ?? new Intl.NumberFormat(region, { minimumFractionDigits: digits, maximumFractionDigits: digits });
    numbers.set(digits, known);
    return known.format(value);
  }

  /** A duration in its two largest units: "12 s", "3 min 20 s", "2 h 5 min", "4 d 3 h". @param {number} seconds */
  function duration(seconds) {
    const s = Math.max(0, Math.floor(seconds));
    if (s < 60) return t("core.duration.s", { s });
    if (s < 3600) return t("core.duration.min", { min: Math.floor(s / 60), s: s % 60 });
    if (s < 86400) return t("core.duration.h", { h: Math.floor(s / 3600), min: Math.floor((s % 3600) / 60) });
    return t("core.duration.d", { d: Math.floor(s / 86400), h: Math.floor((s % 86400) / 3600) });
  }

  /** @param {number} bytes */
  function size(bytes) {
    if (bytes >= 1e9) return `${number(bytes / 1e9, 1)} GB`;
    return bytes >= 1e6 ? `${number(bytes / 1e6, 1)} MB` : `${number(bytes / 1e3)} kB`;
  }

  /** A day in words: "today", "yesterday", else its date. @param {Time} utc */
  function dayIn(utc) {
    const ago = Math.round((midnight(date(Date.now())) - midnight(date(utc))) / 86_400_000);
    return ago === 0 || ago === 1 ? near.format(-ago, "day") : day.format(date(utc));
  }

  /** @param {Time} time */
  const date = (time) => new Date(time);
  return {
    number, duration, size,
    /** Time of day. @param {Time} utc */
    time: (utc) => clock.format(date(utc)),
    /** Day. @param {Time} utc */
    day: (utc) => day.format(date(utc)),
    /** Day and time. @param {Time} utc */
    moment: (utc) => moment.format(date(utc)),
    dayIn,
    /** Day and time in words: "today 14:05". @param {Time} utc */
    when: (utc) => `${dayIn(utc)} ${hour.format(date(utc))}`,
    /** The same with seconds, where captures of one minute stand beside each other. @param {Time} utc */
    instant: (utc) => `${dayIn(utc)} ${clock.format(date(utc))}`,
  };
}

/** @param {Date} time */
const midnight = (time) => new Date(time.getFullYear(), time.getMonth(), time.getDate()).getTime();
