// A view of a field, its targets ringed and named.
import { el } from "../core/dom.js";
import { colourOf } from "../live/overlay.js";

/** @import { Identification, IdentifiedView, ImagePosition, Views } from "types/documents" */

const RING_PX = 7;
const LINES = 576;
const NAME_CSS_PX = 10;

/**
 * @param {string} name of the view
 * @param {Views[string]} columns
 * @param {string} label what a screen reader says of it
 */
export function createTargetPicture(name, columns, label) {
  const width = columns.end_column - columns.first_column;
  const canvas = el("canvas", { class: "target-picture", role: "img", "aria-label": label });
  canvas.style.aspectRatio = `${width} / ${LINES}`;
  const element = el("div", { class: "target-canvas" }, canvas);
  const image = new Image();
  /** @type {{rows: Identification["picture"], view: IdentifiedView} | null} */
  let shown = null;
  let names = true;
  let asked = false;

  /** @param {string} address of the field's picture @param {Identification["picture"]} rows @param {IdentifiedView} view */
  function show(address, rows, view) {
    shown = { rows, view };
    image.addEventListener("load", draw);
    image.src = address;
  }

  function draw() {
    const to = canvas.getContext("2d");
    if (!to || !shown || !image.naturalWidth) return;
    const across = Math.max(1, Math.round(canvas.clientWidth * devicePixelRatio));
    Object.assign(canvas, { width: across, height: Math.round((across * LINES) / width) });
    const scale = across / width;
    const { y0, y_step } = shown.rows;
    to.setTransform(scale, 0, 0, scale, -columns.first_column * scale, 0);
    to.imageSmoothingEnabled = true;
    to.drawImage(image, 0, y0 - (y_step - 1) / 2, image.naturalWidth, image.naturalHeight * y_step);
    to.translate(0.5, 0.5); // the centre of the first pixel is 0, 0
    if (!asked) mark(to, shown.view, devicePixelRatio / scale);
  }

  /** @param {CanvasRenderingContext2D} to @param {IdentifiedView} view @param {number} unit how many frame pixels one pixel of the page is */
  function mark(to, view, unit) {
    rings(to, view.other, "#ff7a6e", unit);
    rings(to, view.found, colourOf(name), unit);
    if (!names) return;
    to.font = `600 ${NAME_CSS_PX * unit}px system-ui, sans-serif`;
    to.textAlign = "center";
    to.lineWidth = 3 * unit;
    to.strokeStyle = "#000";
    to.fillStyle = "#fff";
    for (const { target, x_px, y_px } of view.found) {
      to.strokeText(String(target), x_px, y_px - RING_PX - 2 * unit);
      to.fillText(String(target), x_px, y_px - RING_PX - 2 * unit);
    }
  }

  const resized = new ResizeObserver(draw);
  resized.observe(canvas);
  return {
    element, show,
    /** @param {boolean} on */
    name(on) {
      names = on;
      draw();
    },
    /** Offers the places where a target may be, each a button. @param {ImagePosition[]} places @param {string} label @param {(place: ImagePosition) => void} picked */
    ask(places, label, picked) {
      asked = true;
      element.append(...places.map((place) => {
        const button = el("button", { class: "target-place", type: "button", data: { do: "name-target" }, "aria-label": label, on: { click: () => picked(place) } });
        button.style.insetInlineStart = `${(100 * (place.x_px + 0.5 - columns.first_column)) / width}%`;
        button.style.insetBlockStart = `${(100 * (place.y_px + 0.5)) / LINES}%`;
        button.style.maxInlineSize = `${(100 * apart(places, width)) / width}%`;
        return button;
      }));
    },
    unmount: () => resized.disconnect(),
  };
}

/** The least distance between places, so that no button lies on another. @param {ImagePosition[]} places @param {number} most */
function apart(places, most) {
  return Math.min(most, ...places.flatMap((one, i) => places.slice(i + 1).map((other) => Math.hypot(one.x_px - other.x_px, one.y_px - other.y_px))));
}

/** @param {CanvasRenderingContext2D} to @param {ImagePosition[]} places @param {string} colour @param {number} unit */
function rings(to, places, colour, unit) {
  to.beginPath();
  for (const { x_px, y_px } of places) {
    to.moveTo(x_px + RING_PX, y_px);
    to.arc(x_px, y_px, RING_PX, 0, 2 * Math.PI);
  }
  to.strokeStyle = colour;
  to.lineWidth = 1.8 * unit;
  to.stroke();
}
