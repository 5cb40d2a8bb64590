"use strict";

// The canvas of an image, with pan and zoom, for the viewer and the workbench. The centre of the canvas is
// (view.x, view.y) in image pixels; view.zoom is the number of page pixels per image pixel. A page defines draw(),
// look(x, y) for a clicked pixel, focusBy(steps), and pointAt(x, y) for the pixel under the pointer.

/** Maximum zoom; pointer movement allowed in a click. */
const [NEAREST, CLICK_PX] = [32, 4];

const canvas = element("canvas");
const context = canvas.getContext("2d");
const clamp = (value, low, high) => Math.min(Math.max(value, low), high);

/** The image on the canvas: width, height, pixel_um. */
let image = null;
const view = { number: 0, plane: 0, x: 0, y: 0, zoom: 1 };

/** The clicked pixel. */
let mark = null;

function say(text) {
  element("message").textContent = text;
  element("message").hidden = !text;
}

// Drawing

/** Converts image to screen coordinates, rounded so that tiles join without a seam. */
const onScreenX = (x) => Math.round(((x - view.x) * view.zoom + canvas.clientWidth / 2) * devicePixelRatio);
const onScreenY = (y) => Math.round(((y - view.y) * view.zoom + canvas.clientHeight / 2) * devicePixelRatio);

let drawing = false;

function redraw() {
  document.body.dataset.ready = false;
  if (drawing) return;
  drawing = true;
  requestAnimationFrame(() => {
    drawing = false;
    if (image) draw();
  });
}

/** Fits the canvas to its element and clears it. */
function clearCanvas() {
  const [width, height] = [canvas.clientWidth, canvas.clientHeight].map((side) => Math.round(side * devicePixelRatio));
  if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
  context.clearRect(0, 0, width, height);
}

function drawMark() {
  if (!mark) return;
  const [x, y] = [onScreenX(mark.x + 0.5), onScreenY(mark.y + 0.5)];
  const [inner, outer] = [5, 13].map((length) => length * devicePixelRatio);
  for (const [width, colour] of [[5, "#fff"], [2, "#111"]]) {
    context.beginPath();
    for (const [dx, dy] of [[1, 0], [-1, 0], [0, 1], [0, -1]]) {
      context.moveTo(x + inner * dx, y + inner * dy);
      context.lineTo(x + outer * dx, y + outer * dy);
    }
    Object.assign(context, { lineWidth: width * devicePixelRatio, strokeStyle: colour });
    context.stroke();
  }
}

/** A bar of 1, 2 or 5 times a power of ten, at most 160 pixels long. */
function drawScale() {
  const most = (160 * image.pixel_um) / view.zoom;
  const power = 10 ** Math.floor(Math.log10(most));
  const um = [5, 2, 1].map((times) => times * power).find((length) => length <= most) ?? power;
  const text = um >= 1000 ? `${um / 1000} mm` : `${Number(um.toPrecision(1))} µm`;
  element("scale-bar").style.width = `${(um / image.pixel_um) * view.zoom}px`;
  element("scale-text").textContent = text;
  element("scale").setAttribute("aria-label", `Scale bar of ${text}`);
}

// View position

function fit() {
  Object.assign(view, { x: image.width / 2, y: image.height / 2, zoom: farthest() });
  redraw();
}

/** The zoom that shows all of the image. */
const farthest = () =>
  Math.max(0.96 * Math.min(canvas.clientWidth / image.width, canvas.clientHeight / image.height), 1e-6);

function move(dx, dy) {
  view.x = clamp(view.x + dx / view.zoom, 0, image.width);
  view.y = clamp(view.y + dy / view.zoom, 0, image.height);
  redraw();
}

/** Zooms around a point of the canvas. */
function zoomBy(factor, x = canvas.clientWidth / 2, y = canvas.clientHeight / 2) {
  const [dx, dy] = [x - canvas.clientWidth / 2, y - canvas.clientHeight / 2];
  const zoom = clamp(view.zoom * factor, Math.min(farthest(), 1) / 2, NEAREST);
  view.x += dx / view.zoom - dx / zoom;
  view.y += dy / view.zoom - dy / zoom;
  view.zoom = zoom;
  move(0, 0);
}

const step = () => 0.15 * Math.min(canvas.clientWidth, canvas.clientHeight);

// Pointer

const placeOf = (event) => {
  const box = canvas.getBoundingClientRect();
  const [x, y] = [event.clientX - box.x, event.clientY - box.y];
  return { x, y, px: view.x + (x - box.width / 2) / view.zoom, py: view.y + (y - box.height / 2) / view.zoom };
};

/** Active pointers. */
const down = new Map();
let travelled = 0;

canvas.addEventListener("pointerdown", (event) => {
  if (event.button !== 0) return;
  canvas.setPointerCapture(event.pointerId);
  if (down.size === 0) travelled = 0;
  down.set(event.pointerId, placeOf(event));
});

canvas.addEventListener("pointermove", (event) => {
  if (!image) return;
  const to = placeOf(event);
  const from = down.get(event.pointerId);
  if (from) {
    travelled += Math.hypot(to.x - from.x, to.y - from.y);
    const other = [...down].find(([id]) => id !== event.pointerId)?.[1];
    if (other) {
      const apart = (point) => Math.max(Math.hypot(point.x - other.x, point.y - other.y), 1);
      zoomBy(apart(to) / apart(from), other.x, other.y);
    } else if (travelled > CLICK_PX) {
      canvas.classList.add("dragged");
      move(from.x - to.x, from.y - to.y);
    }
    down.set(event.pointerId, to);
  }
  const [x, y] = [placeOf(event).px, placeOf(event).py];
  pointAt(x, y);
});

const release = (event) => {
  const was = down.delete(event.pointerId);
  if (down.size === 0) canvas.classList.remove("dragged");
  if (!was || event.type !== "pointerup" || travelled > CLICK_PX || !image) return;
  const { px, py } = placeOf(event);
  look(Math.floor(px), Math.floor(py));
};
canvas.addEventListener("pointerup", release);
canvas.addEventListener("pointercancel", release);

canvas.addEventListener("wheel", (event) => {
  event.preventDefault();
  if (!image) return;
  // Some systems scroll horizontally with Shift.
  const turn = (event.deltaY || event.deltaX) * [1, 33, 400][event.deltaMode];
  const { x, y } = placeOf(event);
  if (event.shiftKey) focusBy(-Math.sign(turn));
  else zoomBy(2 ** (-turn / 250), x, y);
}, { passive: false });

new ResizeObserver(redraw).observe(canvas);
