// Which captures belong together: by a label that tells several groups apart. Nothing here touches the page.

/** @import { Capture } from "types/documents" */

const FIRST = ["liner", "teat", "pulsator", "cow"];
/** Every capture is a group of its own only as long as there are few: each is compared with each. */
const FEW = 6;

/** Labels that make at least two groups, those first that are asked about most. @param {Capture[]} captures */
export function labelsOf(captures) {
  const names = [...new Set(captures.flatMap(({ labels }) => Object.keys(labels)))].sort();
  const sorted = [...FIRST.filter((one) => names.includes(one)), ...names.filter((one) => !FIRST.includes(one))];
  return sorted.filter((name) => new Set(captures.map(({ labels }) => labels[name]).filter(Boolean)).size > 1);
}

/** The label that can be tested: each has it, and a group has several captures; else each by itself, or all as one. @param {Capture[]} captures */
export function usualGrouping(captures) {
  const tested = labelsOf(captures).find((name) => {
    const values = captures.map(({ labels }) => labels[name]);
    return values.every(Boolean) && new Set(values).size < values.length;
  });
  return tested ?? (captures.length <= FEW ? "id" : "");
}

/** What may make the groups, the usual one among them. @param {Capture[]} captures */
export function groupings(captures) {
  return [...labelsOf(captures), "date", ...(captures.length <= FEW ? ["id"] : []), ""];
}
