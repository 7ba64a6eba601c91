// Charts: what zooming and moving show, what charts share, and what is taken home of them.
import assert from "node:assert/strict";
import { test } from "node:test";
import { createLink, linkOf } from "../../../../src/grabberd/server/web/static/js/plots/link.js";
import { between, movedTo, partOf, shareIn, zoomedAbout } from "../../../../src/grabberd/server/web/static/js/plots/range.js";

const WHOLE = [0, 10];

test("what is zoomed about stays where it is", () => {
  const part = zoomedAbout([2, 6], 0.25, 2);
  assert.deepEqual(part, [2.5, 4.5]);
  assert.equal(shareIn(part, 3), 0.25);
});

test("a part never leaves what there is, nor gets shorter than it may", () => {
  assert.deepEqual(partOf(WHOLE, [-3, 1], 1), [0, 4]);
  assert.deepEqual(partOf(WHOLE, [8, 12], 1), [6, 10]);
  assert.deepEqual(partOf(WHOLE, [5, 5.1], 1), [5, 6]);
});

test("all there is, is no part", () => {
  assert.equal(partOf(WHOLE, [-5, 15], 1), null);
  assert.equal(partOf([3, 3], [3, 3], 1), null);
});

test("what is drawn over from right to left is the same part", () => {
  assert.deepEqual(between(WHOLE, 0.7, 0.2), [2, 7]);
});

test("without a cursor in sight it is zoomed about the middle", () => {
  assert.deepEqual([shareIn(WHOLE, null), shareIn(WHOLE, 12), shareIn(WHOLE, 1)], [0.5, 0.5, 0.1]);
});

test("charts of one name share cursor, range and playhead, and forget them with the last", () => {
  const seen = [];
  const end = linkOf("a panel").watch((now) => seen.push(now.mark));
  linkOf("a panel").set({ mark: 1.5 });
  linkOf("another").set({ mark: 9 });
  assert.deepEqual([seen, linkOf("a panel").get().mark], [[1.5], 1.5]);
  end();
  assert.equal(linkOf("a panel").get().mark, null);
});

test("a chart that left is told nothing", () => {
  const link = createLink();
  const seen = [];
  const end = link.watch((now) => seen.push(now.cursor));
  link.set({ cursor: 1 });
  end();
  link.set({ cursor: 2 });
  assert.deepEqual(seen, [1]);
});

test("a part of a chart goes along with a playhead that leaves it, and no farther than there is", () => {
  const whole = [0, 10];
  assert.deepEqual(movedTo([2, 4], 3, whole), [2, 4]);
  assert.deepEqual(movedTo([2, 4], 5, whole), [5, 7]);
  assert.deepEqual(movedTo([2, 4], 9.5, whole), [8, 10]);
  assert.equal(movedTo(null, 5, whole), null);
});
