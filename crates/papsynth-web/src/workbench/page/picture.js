"use strict";

// The image of the recipe: requests, drawing, outlines, small fields.

/** The shown image: description, grey levels, and a canvas with its pixels. */
let shown = null;

/** Position of the stage, µm; null for that of the recipe. */
let focus = null;

const layers = new Map();

/** Splits a reply into its description and its samples. */
function unframed(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  const head = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  if (!head.width) return { head };
  // A copy, because 16-bit samples must be aligned.
  const raw = buffer.slice(4 + length);
  return { head, raw, levels: head.bits <= 8 ? new Uint8Array(raw) : new Uint16Array(raw) };
}

async function requestImage(kind, index) {
  const { recipe, seed } = state;
  const [focus_um, noise_free] = [kind === "small" ? null : focus, element("noise-free").checked];
  const body = { recipe, seed, index, view: kind, focus_um, noise_free };
  return unframed(await (await request("render", body)).arrayBuffer());
}

/** Grey pixels of levels of 8 bits. */
const GREYS = Uint32Array.from({ length: 256 }, (_, level) => 0xff000000 + level * 0x010101);

/** Returns a canvas with the pixels of an image, 0 to the largest level as black to white. `old` is reused if it fits. */
function painted({ head, levels }, old) {
  const { width, height, channels, bits } = head;
  const own = old?.width === width && old.height === height ? old : new OffscreenCanvas(width, height);
  const pixels = new ImageData(width, height);
  const words = new Uint32Array(pixels.data.buffer);
  const shift = Math.max(bits - 8, 0);
  if (channels === 1) {
    for (let i = 0; i < words.length; i += 1) words[i] = GREYS[levels[i] >> shift];
  } else {
    for (let i = 0, k = 0; i < words.length; i += 1, k += 3) {
      const [red, green, blue] = [levels[k] >> shift, levels[k + 1] >> shift, levels[k + 2] >> shift];
      words[i] = 0xff000000 | (blue << 16) | (green << 8) | red;
    }
  }
  own.getContext("2d").putImageData(pixels, 0, 0);
  return own;
}

// Rendering: a fast image of the latest change first, then the image, then the small fields.

let dirty = false;
let running = false;

/** Name of the last change, and the times of the images of each change by kind, from request to canvas, ms. */
let lastName = null;
const costs = new Map();

/** Kinds of images, each with twice the resolution of the one before it. */
const KINDS = ["coarse", "reduced", "full"];

/** Longest expected times of the first image, and of an image that follows the coarsest at once, ms; fraction of a time
 * that stays with each image; time of an image relative to that with half the resolution. */
const [FIRST_MS, ALONE_MS, STAYS, FINER] = [80, 1000, 0.9, 3.5];

function say(text) {
  element("message").textContent = text;
  element("message").hidden = !text;
}

/** Returns a duration in words. */
function duration(seconds) {
  if (seconds < 10) return `${seconds.toFixed(0)} s`;
  if (seconds < 55) return `${Math.ceil(seconds / 5) * 5} s`;
  const minutes = Math.round(seconds / 60);
  return minutes === 1 ? "1 minute" : `${minutes} minutes`;
}

const status = (text) => { element("status").textContent = text; };

/** Time of an image beyond which a smaller field is offered, ms; interval at which the time of a preview is shown. */
const [SLOW_MS, WAIT_MS] = [4000, 1000];

/** Returns the expected time of an image of the last change, ms; infinity if it is not known. */
function expected(kind) {
  const known = costs.get(lastName) ?? {};
  const found = KINDS.findLastIndex((one, k) => one in known && k <= KINDS.indexOf(kind));
  return found < 0 ? Infinity : known[KINDS[found]] * FINER ** (KINDS.indexOf(kind) - found);
}

/** Says how long a slow image takes and has taken, and offers a smaller field. */
function offerSmaller(ms, seconds) {
  const about = ms < Infinity ? `about ${duration(ms / 1000)}` : "long";
  const text = `This field takes ${about}.`;
  const node = element("status");
  if (node.firstChild?.textContent !== text) {
    const button = Object.assign(made("button", "Halve width and height"), { type: "button" });
    button.addEventListener("click", () => {
      const half = (side) => moved(side, Math.max(Math.round(centre(side) / 2), 16), [16, 32768]);
      const { width_px, height_px } = state.recipe.field;
      edit(["field"], { ...state.recipe.field, width_px: half(width_px), height_px: half(height_px) });
    });
    // Only the first part is read aloud.
    const clock = Object.assign(made("span", ""), { ariaHidden: "true" });
    node.replaceChildren(made("span", text), clock, button);
  }
  node.children[1].textContent = ` ${seconds.toFixed(0)} s so far.`;
}

/** Gives up outdated images. */
let outdate = () => request("cancel", {}).catch(() => {});

/** The image in progress: whether it is the first one of a change, and its start. */
let present = { isFirst: true, start: 0 };

/** Time after which the first image of an outdated change is given up, too, ms: less would leave none while a slider
 * moves. */
const FIRST_PATIENCE_MS = 200;

/** Requests an image of the present state. `name` is that of the changed field. */
function render(name = null) {
  lastName = name;
  dirty = true;
  document.body.dataset.ready = false;
  document.body.dataset.full = false;
  if (!running) run();
  else if (!present.isFirst || performance.now() - present.start > FIRST_PATIENCE_MS) outdate();
}

async function run() {
  running = true;
  try {
    while (dirty) {
      dirty = false;
      // Nothing is known of another recipe.
      if (lastName === null) costs.delete(null);
      const first = KINDS.findLast((kind) => expected(kind) < FIRST_MS) ?? "coarse";
      for (const kind of KINDS.slice(KINDS.indexOf(first))) {
        if (kind === "reduced" && kind !== first && expected("full") < ALONE_MS) continue;
        present = { isFirst: kind === first, start: performance.now() };
        if (dirty || !(await renderKind(kind))) break;
      }
    }
  } catch (error) {
    say(error.status ? error.message : "The program does not respond. Start it again and reload the page.");
  }
  running = false;
  if (!dirty) showStrip();
}

/** Requests and shows an image. Returns whether it is shown. */
async function renderKind(kind) {
  const { start } = present;
  const [name, ms] = [lastName, expected("full")];
  const wait = () => offerSmaller(ms, (performance.now() - start) / 1000);
  const waiting = ms > SLOW_MS ? setInterval(wait, WAIT_MS) : 0;
  if (ms > SLOW_MS && ms < Infinity) wait();
  const reply = await requestImage(kind, state.index).finally(() => clearInterval(waiting));
  const { head } = reply;
  if (head.cancelled) return false;
  if (head.errors) {
    if (!dirty) fail(head.errors);
    return false;
  }
  say("");
  showFaults([]);
  show(reply);
  const known = costs.get(name) ?? {};
  costs.set(name, { ...known, [kind]: Math.max(performance.now() - start, STAYS * (known[kind] ?? 0)) });
  return true;
}

/** Shows errors of the recipe; the last image stays. */
function fail(errors) {
  showFaults(errors);
  const [{ message }] = errors;
  say(errors.length > 1 ? `${message} (and ${errors.length - 1} more)` : message);
  status("The recipe has errors. The last image is shown.");
  document.body.dataset.ready = true;
}

function show(reply) {
  const { head } = reply;
  shown = { ...reply, canvas: painted(reply, shown?.canvas) };
  const [width, height] = [head.width * head.factor, head.height * head.factor];
  const isOther = !image || Math.abs(image.width - width) >= 4 || Math.abs(image.height - height) >= 4;
  if (head.factor === 1 || isOther) image = { width, height, pixel_um: head.pixel_um / head.factor };
  if (isOther && !placed()) fit();
  showFocus();
  showFacts();
  redraw();
  if (head.factor > 1) return;
  for (const name of layers.keys()) requestLabels(name);
  document.body.dataset.full = true;
  showReal();
}

// Outlines

function addLayer(name) {
  const check = Object.assign(document.createElement("input"), { type: "checkbox", id: `layer-${name}` });
  check.addEventListener("change", () => setLayer(name, check.checked));
  layers.set(name, { on: false, check, id: 0, bitmap: null });
  element("groups").append(made("label", [check, ` ${title(name)}`], "check"));
}

function setLayer(name, on) {
  Object.assign(layers.get(name), { on });
  layers.get(name).check.checked = on;
  if (!on) showLegend(shown?.head.id, element("by").value).catch(() => {});
  requestLabels(name);
  redraw();
  keepPlace();
}

async function requestLabels(name) {
  const layer = layers.get(name);
  const id = shown?.head.id;
  if (!layer.on || !id || shown.head.factor > 1 || layer.id === id) return;
  layer.id = id;
  try {
    const by = element("by").value;
    const bitmap = await createImageBitmap(await (await request(`labels/${id}/${by}/${name}.png`)).blob());
    if (layer.id !== id) return;
    Object.assign(layer, { bitmap, of: id });
    redraw();
    showLegend(id, by);
  } catch (error) {
    // Another image has replaced this one.
    if (error.status !== 404) say(error.message);
  }
}

/** Colours all outlines again. */
function recolour() {
  element("legend").replaceChildren();
  for (const [name, layer] of layers) {
    Object.assign(layer, { id: 0, of: 0 });
    requestLabels(name);
  }
  redraw();
  keepPlace();
}

/** Shows the meaning of the colours. */
async function showLegend(id, by) {
  if (by === "object") return;
  const names = [...layers].filter(([, { on }]) => on).map(([name]) => name);
  const found = await Promise.all(names.map(async (name) => (await request(`legend/${id}/${by}/${name}`)).json()));
  if (by !== element("by").value) return;
  const entries = new Map(found.flat().map(({ colour, text }) => [text, colour]));
  element("legend").replaceChildren(...[...entries].map(([text, colour]) => {
    const sample = made("i", []);
    sample.style.background = colour;
    return made("li", [sample, text]);
  }));
}

// Drawing

function draw() {
  clearCanvas();
  if (!shown) return;
  const { head } = shown;
  const [x0, y0] = [onScreenX(0), onScreenY(0)];
  const [x1, y1] = [onScreenX(head.width * head.factor), onScreenY(head.height * head.factor)];
  context.imageSmoothingEnabled = head.factor > 1 || view.zoom * devicePixelRatio < 1;
  context.imageSmoothingQuality = "high";
  context.drawImage(shown.canvas, x0, y0, x1 - x0, y1 - y0);
  let isHere = head.factor === 1;
  for (const { on, bitmap, of } of layers.values()) {
    if (!on) continue;
    if (bitmap && of === head.id) context.drawImage(bitmap, x0, y0, x1 - x0, y1 - y0);
    else isHere = false;
  }
  drawReal(x1);
  drawMark();
  drawScale();
  document.body.dataset.ready = isHere && !dirty && !running;
  keepPlace();
}

/** Shows the objects at a pixel. */
async function look(x, y) {
  if (!shown || x < 0 || y < 0 || x >= image.width || y >= image.height) return;
  mark = { x, y };
  redraw();
  element("here-at").textContent = `${x}, ${y} px`;
  if (shown.head.factor > 1) return;
  try {
    const { objects } = await (await request(`at/${shown.head.id}/${x}/${y}`)).json();
    if (mark?.x !== x || mark?.y !== y) return;
    const plain = (node, values, unit) => { node.textContent = `${minus(values[0], 1)}${unit}`; };
    const none = made("p", "No object here.", "quiet");
    element("objects").replaceChildren(...(objects.length ? objects.map((object) => card(object, plain)) : [none]));
  } catch (error) {
    if (error.status !== 404) element("objects").replaceChildren(made("p", error.message, "quiet"));
  }
}

/** Shows position and grey level of the pixel under the pointer. */
function pointAt(x, y) {
  const um = (px) => minus(px * image.pixel_um, 1);
  let text = `${Math.floor(x)}, ${Math.floor(y)} px · ${um(x)}, ${um(y)} µm`;
  const { head, levels } = shown ?? {};
  const [column, row] = [Math.floor(x / head?.factor), Math.floor(y / head?.factor)];
  if (levels && column >= 0 && row >= 0 && column < head.width && row < head.height) {
    const first = (row * head.width + column) * head.channels;
    text += ` · grey level ${[...levels.subarray(first, first + head.channels)].join(", ")}`;
  }
  element("position").textContent = text;
}

// Focus

function setFocus(um, name = "focus") {
  focus = um === null ? null : clamp(Math.round(um * 100) / 100, -200, 200);
  showFocus();
  render(name);
  showOutput();
  keepPlace();
}

const focusBy = (steps) => !shown?.head.fused && setFocus((focus ?? shown?.head.stage_um ?? 0) + 0.5 * steps);

function showFocus() {
  const { stage_um, planes_um, fused } = shown?.head ?? { stage_um: 0, planes_um: [0] };
  const um = focus ?? stage_um;
  const slider = element("focus");
  const reach = Math.max(20, Math.abs(um), ...planes_um.map(Math.abs));
  Object.assign(slider, { min: -reach, max: reach, disabled: Boolean(fused) });
  slider.value = um;
  const text = fused ? "fused planes" : `${minus(um, 1)} µm`;
  element("focus-text").textContent = text;
  slider.setAttribute("aria-valuetext", text);
  element("focus-reset").disabled = focus === null;
}

// Small fields

/** What the small fields show. */
let stripOf = null;
let stripRun = 0;

/** Number of small fields that are made at the same time: the server makes one. */
let parallel = 1;

/** Number of small fields, and the pause before they are made, ms. */
const [STRIP, STRIP_MS] = [8, 350];

async function showStrip() {
  const own = (stripRun += 1);
  const first = Math.floor(state.index / STRIP) * STRIP;
  const isPresent = () => own === stripRun && !dirty && !running;
  const buttons = [...element("strip").children];
  buttons.forEach((button, k) => {
    button.setAttribute("aria-pressed", first + k === state.index);
    button.setAttribute("aria-label", `Field ${first + k}`);
    button.title = `Field ${first + k}`;
    button.lastChild.textContent = first + k;
  });
  const of = JSON.stringify([state.recipe, state.seed, first, element("noise-free").checked]);
  if (of === stripOf) return;
  await new Promise((resolve) => setTimeout(resolve, STRIP_MS));
  let next = 0;
  const makeSome = async () => {
    for (let k = next++; k < STRIP; k = next++) {
      const reply = isPresent() ? await requestImage("small", first + k).catch(() => null) : null;
      if (!isPresent() || !reply?.levels) return false;
      const canvas = buttons[k].firstChild;
      const { width, height } = reply.head;
      Object.assign(canvas, { width, height });
      canvas.getContext("2d").drawImage(painted(reply), 0, 0);
    }
    return true;
  };
  const parts = await Promise.all(Array.from({ length: parallel }, makeSome));
  if (!parts.every(Boolean)) return;
  stripOf = of;
  document.body.dataset.strip = of.length;
}

function makeStrip() {
  for (let k = 0; k < STRIP; k += 1) {
    const button = made("button", [document.createElement("canvas"), made("span", String(k))]);
    button.type = "button";
    button.addEventListener("click", () => go(Math.floor(state.index / STRIP) * STRIP + k));
    element("strip").append(button);
  }
}

// Facts

function showFacts() {
  const { head } = shown;
  const um = [head.width, head.height].map((px) => px * head.pixel_um);
  element("size").textContent = `${um.map((side) => side.toFixed(0)).join(" × ")} µm`;
  if (head.factor > 1) return;
  const { phantoms, planes, background } = head.made;
  const again = phantoms ? `${phantoms} objects` : planes ? "light" : background ? "background" : "camera";
  const rows = [
    ["pixels", `${head.width} × ${head.height}`], ["objects", head.objects], ["cells in the field", head.cells],
    ...(head.unplaced ? [["cells without room", head.unplaced]] : []),
    ["pixel", `${Number(head.pixel_um.toPrecision(4))} µm`], ["bits", head.bits],
    ["saturated", `${((100 * head.saturated_px) / (head.width * head.height)).toFixed(2)} %`],
    ["computed again", again], ["time", `${head.ms.toFixed(0)} ms`],
  ];
  const cells = rows.flatMap(([name, value]) => [made("dt", name), made("dd", String(value))]);
  element("facts").replaceChildren(...cells);
  element("hash").textContent = document.body.dataset.hash = head.sha256;
  status(`Field ${state.index} of seed ${state.seed}: ${head.objects} objects, ${head.ms.toFixed(0)} ms.`);
}
