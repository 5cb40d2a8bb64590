"use strict";

// The picture lies on the canvas by its middle (view.x, view.y, in pixels of the picture) and its zoom (pixels of the page a pixel of the
// picture). Of every tile in view the finest level that suits the zoom is asked for; until it is here, its part of a coarser one stands for it.

/** Tiles that are asked for at a time, tiles that are kept. */
const AT_ONCE = 6;
const KEPT = 400;
const RETRY_MS = 2000;

/** Nearest zoom: pixels of the page a pixel of the picture. */
const NEAREST = 32;

/** How far the pointer may move in a click. */
const CLICK_PX = 4;

const element = (id) => document.getElementById(id);
const canvas = element("canvas");
const context = canvas.getContext("2d");
const clamp = (value, low, high) => Math.min(Math.max(value, low), high);

let info = null;
let picture = null;
const view = { number: 0, plane: 0, x: 0, y: 0, zoom: 1 };

/** The plane that was shown before: it stands in while the next one is on its way. */
let before = 0;

/** Whether the labels of a group are shown, and how opaque. */
const groups = new Map();

/** Where was clicked. */
let mark = null;

/** Tiles by their address: an image, "asked", "absent" or "broken". The last that were used are the last. */
const tiles = new Map();
let underway = 0;

// What is asked

async function ask(path) {
  const response = await fetch(path, { cache: "no-store" });
  if (response.ok) return response;
  const { error } = await response.json().catch(() => ({ error: response.statusText }));
  throw Object.assign(new Error(error), { status: response.status });
}

function say(text) {
  element("message").textContent = text;
  element("message").hidden = !text;
}

async function load(address) {
  tiles.set(address, "asked");
  underway += 1;
  try {
    const response = await ask(address);
    tiles.set(address, await createImageBitmap(await response.blob()));
  } catch (error) {
    if (error.status === 404) {
      tiles.set(address, "absent");
    } else if (error.status) {
      tiles.set(address, "broken");
      say(error.message);
    } else {
      say("The program does not answer. It is asked again.");
      await new Promise((resolve) => setTimeout(resolve, RETRY_MS));
      tiles.delete(address);
      say("");
    }
  }
  underway -= 1;
  redraw();
}

/** A tile if it is here; it counts as used. */
function ready(address) {
  const tile = tiles.get(address);
  if (!(tile instanceof ImageBitmap)) return null;
  tiles.delete(address);
  tiles.set(address, tile);
  return tile;
}

/** Lets the tiles go that were not used for longest; those of two views may always stay. */
function forget(needed) {
  for (const [address, tile] of tiles) {
    if (tiles.size <= Math.max(KEPT, 2 * needed)) return;
    if (tile === "asked") continue;
    if (tile instanceof ImageBitmap) tile.close();
    tiles.delete(address);
  }
}

// What is drawn

const addressOf = (layer, level, row, column) => `${layer}/${level}/${row}-${column}.png`;
const planeLayer = (plane) => `tile/${view.number}/${plane}`;

/** A column and a row of the picture in pixels of the screen; whole ones, so that tiles meet without a seam. */
const onScreenX = (x) => Math.round(((x - view.x) * view.zoom + canvas.clientWidth / 2) * devicePixelRatio);
const onScreenY = (y) => Math.round(((y - view.y) * view.zoom + canvas.clientHeight / 2) * devicePixelRatio);

/** The level whose pixels are at most as large as those of the screen, or the finest. */
function levelOf(zoom) {
  return clamp(Math.floor(Math.log2(1 / (zoom * devicePixelRatio)) + 1e-6), 0, picture.levels - 1);
}

/** The tiles of a level in view, those in the middle first. */
function inView(level) {
  const side = picture.tile * 2 ** level;
  const [across, down] = [canvas.clientWidth / view.zoom / 2, canvas.clientHeight / view.zoom / 2];
  const along = (middle, half, end) =>
    [Math.floor(clamp(middle - half, 0, end - 1) / side), Math.floor(clamp(middle + half, 0, end - 1) / side)];
  const [left, right] = along(view.x, across, picture.width);
  const [top, bottom] = along(view.y, down, picture.height);
  const found = [];
  for (let row = top; row <= bottom; row += 1) {
    for (let column = left; column <= right; column += 1) found.push([row, column]);
  }
  const far = ([row, column]) => Math.hypot((row + 0.5) * side - view.y, (column + 0.5) * side - view.x);
  return found.sort((a, b) => far(a) - far(b));
}

/** Draws the part of a picture's layer under a tile: the tile, or its part of the nearest coarser one that is here. */
function drawTile(layers, level, row, column) {
  const side = picture.tile;
  const [left, top] = [column * side, row * side];
  const [width, height] = [picture.width, picture.height].map((full) => Math.ceil(full / 2 ** level));
  const [right, bottom] = [Math.min(left + side, width), Math.min(top + side, height)];
  const [x0, y0] = [onScreenX(left * 2 ** level), onScreenY(top * 2 ** level)];
  const x1 = onScreenX(Math.min(right * 2 ** level, picture.width));
  const y1 = onScreenY(Math.min(bottom * 2 ** level, picture.height));
  for (let up = 0; level + up < picture.levels; up += 1) {
    const [over, beside] = [row >> up, column >> up];
    for (const layer of layers) {
      const tile = ready(addressOf(layer, level + up, over, beside));
      if (!tile) continue;
      const [u, v] = [left / 2 ** up - beside * side, top / 2 ** up - over * side];
      context.imageSmoothingEnabled = up > 0 || view.zoom * devicePixelRatio < 1;
      const [across, down] = [(right - left) / 2 ** up, (bottom - top) / 2 ** up];
      context.drawImage(tile, u, v, across, down, x0, y0, x1 - x0, y1 - y0);
      return;
    }
  }
}

let drawing = false;

function redraw() {
  document.body.dataset.ready = false;
  if (drawing) return;
  drawing = true;
  requestAnimationFrame(() => {
    drawing = false;
    if (picture) draw();
  });
}

function draw() {
  const [width, height] = [canvas.clientWidth, canvas.clientHeight].map((side) => Math.round(side * devicePixelRatio));
  if (canvas.width !== width || canvas.height !== height) Object.assign(canvas, { width, height });
  context.clearRect(0, 0, width, height);
  drawGround();
  const layers = [[[planeLayer(view.plane), planeLayer(before)], 1]];
  for (const [name, { on, opacity }] of groups) if (on) layers.push([[`label/${view.number}/${name}`], opacity]);
  const [level, coarsest] = [levelOf(view.zoom), picture.levels - 1];
  const [fine, coarse] = [inView(level), inView(coarsest)];
  const needed = [];
  for (const [[layer]] of layers) {
    for (const [row, column] of coarse) needed.push(addressOf(layer, coarsest, row, column));
    for (const [row, column] of fine) needed.push(addressOf(layer, level, row, column));
  }
  for (const [names, opacity] of layers) {
    context.globalAlpha = opacity;
    for (const [row, column] of fine) drawTile(names, level, row, column);
  }
  context.globalAlpha = 1;
  drawMark();
  const isHere = needed.every((address) => tiles.has(address) && tiles.get(address) !== "asked");
  if (isHere) {
    before = view.plane;
    // The planes beside this one will be asked for next.
    for (const plane of [view.plane - 1, view.plane + 1]) {
      if (!(plane in picture.planes_um)) continue;
      for (const [row, column] of fine) needed.push(addressOf(planeLayer(plane), level, row, column));
    }
  }
  for (const address of needed) if (underway < AT_ONCE && !tiles.has(address)) load(address);
  forget(needed.length);
  document.body.dataset.ready = isHere;
  drawScale();
  keepPlace();
}

/** Where the picture lies, also where nothing of it is made yet. */
function drawGround() {
  const [x, y] = [onScreenX(0), onScreenY(0)];
  context.fillStyle = "#24282d";
  context.fillRect(x, y, onScreenX(picture.width) - x, onScreenY(picture.height) - y);
}

function drawMark() {
  if (!mark) return;
  const [x, y] = [onScreenX(mark.x + 0.5), onScreenY(mark.y + 0.5)];
  const [inner, outer] = [5, 13].map((length) => length * devicePixelRatio);
  for (const [width, colour] of [[4, "#000a"], [2, "#fff"]]) {
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
  const most = (160 * picture.pixel_um) / view.zoom;
  const power = 10 ** Math.floor(Math.log10(most));
  const um = [5, 2, 1].map((times) => times * power).find((length) => length <= most) ?? power;
  const text = um >= 1000 ? `${um / 1000} mm` : `${Number(um.toPrecision(1))} µm`;
  element("scale-bar").style.width = `${(um / picture.pixel_um) * view.zoom}px`;
  element("scale-text").textContent = text;
  element("scale").setAttribute("aria-label", `Scale bar of ${text}`);
}

// Where one looks

function fit() {
  Object.assign(view, { x: picture.width / 2, y: picture.height / 2, zoom: farthest() });
  redraw();
}

const farthest = () => 0.96 * Math.min(canvas.clientWidth / picture.width, canvas.clientHeight / picture.height);

function move(dx, dy) {
  view.x = clamp(view.x + dx / view.zoom, 0, picture.width);
  view.y = clamp(view.y + dy / view.zoom, 0, picture.height);
  redraw();
}

/** Zooms so that the place under a point of the canvas stays there. */
function zoomBy(factor, x = canvas.clientWidth / 2, y = canvas.clientHeight / 2) {
  const [dx, dy] = [x - canvas.clientWidth / 2, y - canvas.clientHeight / 2];
  const zoom = clamp(view.zoom * factor, Math.min(farthest(), 1) / 2, NEAREST);
  view.x += dx / view.zoom - dx / zoom;
  view.y += dy / view.zoom - dy / zoom;
  view.zoom = zoom;
  move(0, 0);
}

const minus = (number, digits) => number.toFixed(digits).replace("-", "−");

function showPlane(plane) {
  view.plane = clamp(plane, 0, Math.max(picture.planes_um.length - 1, 0));
  element("plane").value = view.plane;
  const um = picture.planes_um[view.plane] ?? 0;
  const text = `${minus(um, 2)} µm`;
  element("plane").setAttribute("aria-valuetext", text);
  element("plane-text").textContent = `${text} · ${view.plane + 1} of ${picture.planes_um.length}`;
  for (const row of document.querySelectorAll("[data-planes]")) row.textContent = ofPlane(JSON.parse(row.dataset.planes), row.dataset.unit);
  redraw();
}

/** The number of the picture that was asked for last. */
let wanted = 0;

/** Shows a picture, all of it unless it is told where to look. */
async function showPicture(number, place) {
  wanted = number;
  try {
    const next = await (await ask(`picture/${number}`)).json();
    if (wanted !== number) return;
    say("");
    // The same place of pictures of the same size, so that they can be compared.
    const stays = picture && next.width === picture.width && next.height === picture.height;
    picture = next;
    view.number = number;
    mark = null;
    element("objects").replaceChildren(made("p", "Click on something to see what it is.", "quiet"));
    element("here-at").textContent = "";
    element("name").textContent = picture.name;
    element("number").value = number + 1;
    element("previous").disabled = number === 0;
    element("next").disabled = number + 1 >= info.pictures;
    const um = [picture.width, picture.height].map((px) => px * picture.pixel_um);
    const [unit, digits, name] = Math.max(...um) < 1000 ? [1, 0, "µm"] : [1000, 2, "mm"];
    const size = `${um.map((side) => (side / unit).toFixed(digits)).join(" × ")} ${name}`;
    const focus = picture.planes_um.length === 0 ? " · everything in focus" : "";
    element("about").textContent = `${picture.width} × ${picture.height} px · ${size}${focus}`;
    element("focus").hidden = picture.planes_um.length < 2;
    element("plane").max = Math.max(picture.planes_um.length - 1, 0);
    if (place) Object.assign(view, place, { zoom: clamp(place.zoom, farthest() / 2, NEAREST) });
    else if (!stays) fit();
    const middle = Math.floor(picture.planes_um.length / 2);
    showPlane(place?.plane ?? (stays ? view.plane : middle));
    before = view.plane;
    move(0, 0);
  } catch (error) {
    say(error.message);
    element("number").value = number + 1;
  }
}

const go = (number) => {
  const there = clamp(number, 0, info.pictures - 1);
  if (there !== wanted) showPicture(there);
};

let keeping = 0;

/** The address as this page left it. */
let kept = "";

/** Keeps place and labels in the address, so that it can be loaded anew and handed on. */
function keepPlace() {
  clearTimeout(keeping);
  keeping = setTimeout(() => {
    // Somebody has typed another, which is being looked at.
    if (location.hash !== kept) return;
    const shown = [...groups].filter(([, { on }]) => on).map(([name, { opacity }]) => `${name}:${Math.round(opacity * 100)}`);
    const { number, plane, x, y, zoom } = view;
    const place = [`n=${number}`, `p=${plane}`, `x=${x.toFixed(1)}`, `y=${y.toFixed(1)}`, `z=${Number(zoom.toPrecision(5))}`];
    history.replaceState(null, "", `#${[...place, `l=${shown.join(",")}`].join("&")}`);
    kept = location.hash;
  }, 150);
}

function keptPlace() {
  kept = location.hash;
  const words = new URLSearchParams(location.hash.slice(1));
  const [number, plane, x, y, zoom] = ["n", "p", "x", "y", "z"].map((key) => Number.parseFloat(words.get(key)));
  for (const word of words.get("l")?.split(",") ?? []) {
    const [name, opacity] = word.split(":");
    if (groups.has(name)) setGroup(name, true, clamp(Number(opacity) / 100 || 1, 0.05, 1));
  }
  const isPlace = [number, plane, x, y, zoom].every(Number.isFinite) && zoom > 0;
  return isPlace ? { number: clamp(Math.floor(number), 0, info.pictures - 1), place: { plane: Math.floor(plane), x, y, zoom } } : { number: 0 };
}

// What lies there

function made(tag, text, className) {
  const node = document.createElement(tag);
  node.append(...[text].flat());
  if (className) node.className = className;
  return node;
}

const ofPlane = (values, unit) => `${minus(values[view.plane] ?? values[0], 1)}${unit}`;

function card(object) {
  const node = made("article", []);
  const heading = made("h3", [object.class ?? object.group, made("span", `${object.part ?? ""} ${object.id}`.trim())]);
  node.style.borderLeftColor = object.colour;
  const list = made("dl", []);
  const row = (name, value) => {
    const cell = made("dd", value ?? "");
    if (value !== undefined && value !== "") list.append(made("dt", name), cell);
    return cell;
  };
  row("Bethesda", object.bethesda);
  row("traits", object.traits?.replaceAll(";", ", "));
  row("tint", object.tint);
  if (object.class !== undefined) {
    row("depth", `${minus(object.depth_um, 1)} µm`);
    for (const [name, values, unit] of [["defocus", object.defocus_um, " µm"], ["contrast / noise", object.detectability, ""]]) {
      if (values.length) Object.assign(row(name, ofPlane(values, unit)).dataset, { planes: JSON.stringify(values), unit });
    }
    row("area", `${object.area_um2.toFixed(object.area_um2 < 100 ? 1 : 0)} µm²`);
    row("stain", object.stain.toFixed(2));
    row("cluster", object.cluster || "");
    const hints = [object.front ? "" : "behind another", object.truncated ? "cut by the border" : ""].filter(Boolean);
    row("", hints.join(", "));
  }
  node.append(heading, list);
  return node;
}

async function look(x, y) {
  if (x < 0 || y < 0 || x >= picture.width || y >= picture.height) return;
  mark = { x, y };
  redraw();
  element("here-at").textContent = `${x}, ${y} px`;
  try {
    const { objects } = await (await ask(`at/${view.number}/${x}/${y}`)).json();
    if (mark?.x !== x || mark?.y !== y) return;
    const nodes = objects.length ? objects.map(card) : [made("p", "Nothing but the slide.", "quiet")];
    element("objects").replaceChildren(...nodes);
  } catch (error) {
    element("objects").replaceChildren(made("p", error.message, "quiet"));
  }
}

// Hands and keys

const placeOf = (event) => {
  const box = canvas.getBoundingClientRect();
  const [x, y] = [event.clientX - box.x, event.clientY - box.y];
  return { x, y, px: view.x + (x - box.width / 2) / view.zoom, py: view.y + (y - box.height / 2) / view.zoom };
};

/** Fingers, or the mouse, that are down. */
const down = new Map();
let travelled = 0;

canvas.addEventListener("pointerdown", (event) => {
  if (event.button !== 0) return;
  canvas.setPointerCapture(event.pointerId);
  if (down.size === 0) travelled = 0;
  down.set(event.pointerId, placeOf(event));
});

canvas.addEventListener("pointermove", (event) => {
  if (!picture) return;
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
  const um = (px) => minus(px * picture.pixel_um, 1);
  element("position").textContent = `${Math.floor(x)}, ${Math.floor(y)} px · ${um(x)}, ${um(y)} µm`;
});

const release = (event) => {
  const was = down.delete(event.pointerId);
  if (down.size === 0) canvas.classList.remove("dragged");
  if (!was || event.type !== "pointerup" || travelled > CLICK_PX || !picture) return;
  const { px, py } = placeOf(event);
  look(Math.floor(px), Math.floor(py));
};
canvas.addEventListener("pointerup", release);
canvas.addEventListener("pointercancel", release);

canvas.addEventListener("wheel", (event) => {
  event.preventDefault();
  if (!picture) return;
  // With Shift some systems turn the wheel sideways.
  const turn = (event.deltaY || event.deltaX) * [1, 33, 400][event.deltaMode];
  const { x, y } = placeOf(event);
  if (event.shiftKey) showPlane(view.plane - Math.sign(turn));
  else zoomBy(2 ** (-turn / 250), x, y);
}, { passive: false });

const step = () => 0.15 * Math.min(canvas.clientWidth, canvas.clientHeight);
const KEYS = {
  ArrowLeft: () => move(-step(), 0),
  ArrowRight: () => move(step(), 0),
  ArrowUp: () => move(0, -step()),
  ArrowDown: () => move(0, step()),
  "+": () => zoomBy(Math.SQRT2),
  "=": () => zoomBy(Math.SQRT2),
  "-": () => zoomBy(Math.SQRT1_2),
  0: fit,
  "[": () => showPlane(view.plane - 1),
  "]": () => showPlane(view.plane + 1),
  PageDown: () => showPlane(view.plane - 1),
  PageUp: () => showPlane(view.plane + 1),
  n: () => go(wanted + 1),
  p: () => go(wanted - 1),
};

document.addEventListener("keydown", (event) => {
  if (!picture || event.ctrlKey || event.metaKey || event.altKey) return;
  // A slider and a number have arrows of their own.
  if (event.target instanceof HTMLInputElement && event.target.type !== "checkbox") return;
  const group = [...groups.keys()][Number(event.key) - 1];
  const act = group ? () => setGroup(group, !groups.get(group).on) : Object.hasOwn(KEYS, event.key) && KEYS[event.key];
  if (!act) return;
  event.preventDefault();
  act();
});

function setGroup(name, on, opacity = groups.get(name).opacity) {
  const group = groups.get(name);
  Object.assign(group, { on, opacity });
  group.check.checked = on;
  group.slider.value = Math.round(opacity * 100);
  redraw();
}

function addGroup(name) {
  const [check, slider] = [made("input", []), made("input", [])];
  Object.assign(check, { type: "checkbox", id: `group-${name}` });
  Object.assign(slider, { type: "range", min: 5, max: 100, value: 100 });
  slider.setAttribute("aria-label", `Opacity of ${name}`);
  groups.set(name, { on: false, opacity: 1, check, slider });
  check.addEventListener("change", () => setGroup(name, check.checked));
  slider.addEventListener("input", () => setGroup(name, true, slider.value / 100));
  const row = made("div", [made("label", [check, name]), slider]);
  element("groups").append(row);
}

element("plane").addEventListener("input", (event) => showPlane(Number(event.target.value)));
element("previous").addEventListener("click", () => go(wanted - 1));
element("next").addEventListener("click", () => go(wanted + 1));
element("number").addEventListener("change", (event) => go(Math.floor(Number(event.target.value) || 1) - 1));
new ResizeObserver(redraw).observe(canvas);

// What was not there may have been made since.
addEventListener("focus", () => {
  for (const [address, tile] of tiles) if (tile === "absent" || tile === "broken") tiles.delete(address);
  redraw();
});
addEventListener("hashchange", () => {
  const { number, place } = keptPlace();
  showPicture(number, place);
});

async function begin() {
  try {
    info = await (await ask("info")).json();
  } catch (error) {
    say(error.status ? error.message : "The program does not answer.");
    return;
  }
  document.title = `${info.title} – papsynth view`;
  element("title").textContent = info.title;
  element("count").textContent = info.pictures;
  element("number").max = info.pictures;
  element("pictures").hidden = info.pictures < 2;
  info.groups.forEach(addGroup);
  if (info.pictures === 0) {
    say("There is no picture yet.");
    return;
  }
  const { number, place } = keptPlace();
  await showPicture(number, place);
}

begin();
