// A capture replayed: one playhead, and four panes that follow it.
import { periodOf } from "../captures/words.js";
import { el } from "../core/dom.js";
import { css } from "../scene/colours.js";
import { coloursOf } from "../scene/theme.js";
import { createCurvesPane } from "./curves_pane.js";
import { cycleAt, startsByPhase } from "./cycles.js";
import { createFilm } from "./film.js";
import { drawFrame, drawnCanvas, drawnCharts, drawnMap, drawnWall, drawnWords } from "./frame.js";
import { createLayout } from "./layout.js";
import { createMapPane } from "./map_pane.js";
import { createMapSource } from "./map_source.js";
import { createPicturePane } from "./picture_pane.js";
import { createPlayhead } from "./playhead.js";
import { PICTURE_FIELDS, pictureLoader, POINT_FIELDS, pointLoader } from "./source.js";
import { createStretches } from "./stretches.js";
import { createTransport } from "./transport.js";
import { ANALYSED, createWallPane } from "./wall_pane.js";

/** @import { Context } from "../core/context.js" */
/** @import { Analysis, AnalysisRow, Capture, Views } from "types/documents" */
/** @import { Draw } from "./frame.js" */
/** @import { Measured } from "./source.js" */
/** @import { Vacuum } from "./vacuum.js" */

const AHEAD = 8;
const MAPS_AHEAD = 4;
const FILM_S = 5;
const FRAME = { width: 1280, height: 960 };
/** Time that is fetched ahead of the playhead, in s. */
const AHEAD_S = 1;
/** Stretches of pictures that are kept: of PAL twelve seconds of one bit; of grey ones, which take thirty times as much, two. */
const KEPT_PICTURES = { bits: 24, grey: 5 };
const KEPT_POINTS = 40;

/**
 * @typedef {object} Subject
 * @property {Capture} capture
 * @property {Measured | null} measured null where nothing is measured
 * @property {{row: AnalysisRow, document: Analysis} | null} analysis
 * @property {() => number} total fields that can be read
 * @property {() => Capture} now the capture as it was last heard of
 * @property {() => Views} views of the picture
 * @property {(n: number) => void} moved told of the playhead's field
 */

/** @param {Context} context @param {Subject} subject @param {number} first field */
export function createRoom(context, { capture, measured, analysis, total, now, views, moved }, first) {
  const { t, api, format } = context;
  const { id } = capture;
  const field_s = periodOf(capture);
  const ahead = (/** @type {number} */ fields) => Math.max(2, Math.ceil(AHEAD_S / field_s / fields));
  const keeps = Math.max(capture.bits > 1 ? KEPT_PICTURES.grey : KEPT_PICTURES.bits, ahead(PICTURE_FIELDS) + 3);
  let ended = false;
  const layout = createLayout(context, () => show(playhead.now().n));

  const pictures = createStretches({ length: PICTURE_FIELDS, ahead: ahead(PICTURE_FIELDS), kept: keeps, total, load: pictureLoader(api, id), changed: come });
  const points = measured && createStretches({ length: POINT_FIELDS, ahead: ahead(POINT_FIELDS), kept: KEPT_POINTS, total, load: pointLoader(api, id, () => measured.run), changed: come });
  const maps = analysis && createMapSource(api, id, analysis, () => show(playhead.now().n));
  const analysed = maps ? ANALYSED.filter((name) => maps.quantities.some((one) => one.name === name)) : [];

  const playhead = createPlayhead({ field_s, total, ready, moved: (n) => { show(n); moved(n); }, changed: () => transport.change() });
  const go = (/** @type {number} */ n) => {
    playhead.play(false);
    playhead.go(n);
  };
  const transport = createTransport(context, playhead, { field_s, total, cycle });
  const picture = createPicturePane(context, now, views);
  const wall = createWallPane(context, { id, field_s, measured, analysed, scaleOf: (name) => maps?.scaleOf(name) ?? null, chosen: (target) => target !== null && curves.choose(target) });
  const curves = createCurvesPane(context, { id, field_s, measured, total, go });
  const map = createMapPane(context, id, maps, () => show(playhead.now().n));
  const film = createFilm(context, { id, field_s, total, range, frame: frameAt, busy: (busy) => busy && playhead.play(false) });
  layout.put({ picture: picture.element, wall: wall.element, curves: curves.element, map: map.element });
  layout.element.append(transport.element);

  /** True if all there is of a field is here; asks for it otherwise. @param {number} n */
  function ready(n) {
    if (pictures.settled(n) && (!points || points.settled(n))) return true;
    want(n);
    return false;
  }

  /** @param {number} n */
  function want(n) {
    pictures.want(n);
    points?.want(n);
  }

  /** What has been fetched meanwhile may be of the field that is shown. */
  function come() {
    if (!ended) show(playhead.now().n);
  }

  /** @param {number} n */
  function show(n) {
    if (ended) return;
    want(n);
    const { loop } = playhead.now();
    const next = Array.from({ length: AHEAD }, (_, i) => n + i + 1).map((one) => (loop && one >= loop[1] ? one - loop[1] + loop[0] : one));
    const seen = layout.seen();
    if (seen.includes("map") || (seen.includes("wall") && analysed.length)) maps?.want(map.kind(), [n, ...next.slice(0, MAPS_AHEAD)]);
    const found = maps ? maps.at(map.kind(), n) : null;
    transport.stand(n);
    if (seen.includes("picture")) {
      picture.show({ n, picture: pictures.at(n), points: points?.at(n), settled: pictures.settled(n), problem: pictures.problemAt(n) });
      picture.prepare(next.map((one) => pictures.at(one)));
    }
    if (seen.includes("wall") && (!points || points.settled(n))) wall.show(n, points?.at(n), found ?? null);
    if (seen.includes("curves")) curves.stand(n);
    if (seen.includes("map")) map.show(n, found);
  }

  /** The pulsation at the playhead: by the analysis, or by the curve itself. */
  async function cycle() {
    const { n } = playhead.now();
    const known = maps?.phases && cycleAt(startsByPhase(maps.phases), n, field_s);
    return known || curves.cycle();
  }

  /** What a film is offered of: what is looped, or five seconds from the playhead on. @returns {[number, number]} */
  function range() {
    const { n, loop } = playhead.now();
    return loop ?? [n, Math.min(n + Math.round(FILM_S / field_s), total())];
  }

  /** Draws a field whole, for a film. @param {number} n */
  async function frameAt(n) {
    if (!(await pictures.ensure(n)) || (points && !(await points.ensure(n)))) return null;
    playhead.go(n);
    show(n);
    await Promise.all([picture.whole(), curves.whole(), layout.seen().includes("map") && mapOf(n)]);
    if (ended) return null;
    if (playhead.now().n !== n) playhead.go(n); // somebody has moved it meanwhile
    show(n);
    return drawn(n);
  }

  /** Waits until there is a map of a field, or until it is known that there is none. @param {number} n */
  async function mapOf(n) {
    while (!ended && maps && maps.at(map.kind(), n) === undefined) await new Promise((resolve) => setTimeout(resolve, 20));
  }

  const canvas = el("canvas", FRAME);
  /** @param {number} n */
  function drawn(n) {
    const pen = /** @type {CanvasRenderingContext2D} */ (canvas.getContext("2d", { alpha: false }));
    const colours = coloursOf(layout.element, { ground: "ground", ink: "ink", accent: "accent" });
    const look = { ground: css(colours.ground), ink: css(colours.ink), accent: css(colours.accent), number: format.number };
    const inSpace = wall.picture();
    const ofMap = map.picture();
    /** @type {Record<string, Draw>} */
    const draws = {
      picture: drawnCanvas(picture.canvas, picture.said()), curves: drawnCharts(curves.pictures()),
      wall: inSpace ? drawnWall(inSpace) : drawnWords(t("replay.noPoints")), map: ofMap ? drawnMap(ofMap) : drawnWords(t("replay.map.none")),
    };
    const panes = layout.seen().filter((name) => name !== "map" || ofMap);
    const caption = [format.moment(capture.created_utc), t("capture.field", { n, s: format.number(n * field_s, 2) })].join(" · ");
    drawFrame(pen, caption, panes.map((name) => ({ title: t(`replay.pane.${name}`), draw: draws[name] })), look);
    return canvas;
  }

  const sizes = new ResizeObserver(() => show(playhead.now().n));
  playhead.go(first);
  sizes.observe(layout.element);

  return {
    element: layout.element, film: film.element, full: layout.full, go,
    at: () => playhead.now().n,
    /** @param {NonNullable<Capture["marks"]>} marks */
    mark: (marks) => curves.mark(marks),
    /** @param {Vacuum | null} vacuum */
    giveVacuum: (vacuum) => curves.giveVacuum(vacuum),
    /** More fields can be read, or something else is known of those that are shown. */
    grown: () => show(playhead.now().n),
    end() {
      ended = true;
      sizes.disconnect();
      for (const part of [playhead, pictures, points, maps, transport, picture, wall, curves, film, layout]) part?.end();
    },
  };
}
