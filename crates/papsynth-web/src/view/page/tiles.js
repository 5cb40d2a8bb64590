"use strict";

// Tiles of the level that suits the zoom are requested; until they arrive, coarser ones are drawn.

/** Parallel requests; cached tiles; retry interval. */
const [AT_ONCE, KEPT, RETRY_MS] = [6, 400, 2000];

let info = null;

/** The previous plane, drawn while the next one loads. */
let before = 0;

/** Visibility and opacity of each label group. */
const groups = new Map();

/** Tiles by address: an image, "asked", "absent" or "broken"; least recently used first. */
const tiles = new Map();
let underway = 0;

// Requests

async function load(address) {
  tiles.set(address, "asked");
  underway += 1;
  try {
    const response = await request(address);
    tiles.set(address, await createImageBitmap(await response.blob()));
  } catch (error) {
    tiles.set(address, error.status === 404 ? "absent" : "broken");
    if (error.status !== 404) say(error.status ? error.message : "The program does not respond. Retrying.");
    if (!error.status) {
      await new Promise((resolve) => setTimeout(resolve, RETRY_MS));
      tiles.delete(address);
      say("");
    }
  }
  underway -= 1;
  redraw();
}

/** Returns a loaded tile and marks it as used. */
function ready(address) {
  const tile = tiles.get(address);
  if (!(tile instanceof ImageBitmap)) return null;
  tiles.delete(address);
  tiles.set(address, tile);
  return tile;
}

/** Evicts the least recently used tiles; those of two views always stay. */
function forget(needed) {
  for (const [address, tile] of tiles) {
    if (tiles.size <= Math.max(KEPT, 2 * needed)) return;
    if (tile === "asked") continue;
    if (tile instanceof ImageBitmap) tile.close();
    tiles.delete(address);
  }
}

// Drawing

const addressOf = (layer, level, row, column) => `${layer}/${level}/${row}-${column}.png`;
const planeLayer = (plane) => `tile/${view.number}/${plane}`;

/** Returns the level whose pixels are at most as large as screen pixels, or the finest. */
const levelNow = () => clamp(Math.floor(1e-6 - Math.log2(view.zoom * devicePixelRatio)), 0, image.levels - 1);

/** Returns the visible tiles of a level, those nearest to the centre first. */
function inView(level) {
  const side = image.tile * 2 ** level;
  const [across, down] = [canvas.clientWidth / view.zoom / 2, canvas.clientHeight / view.zoom / 2];
  const along = (middle, half, end) =>
    [Math.floor(clamp(middle - half, 0, end - 1) / side), Math.floor(clamp(middle + half, 0, end - 1) / side)];
  const [left, right] = along(view.x, across, image.width);
  const [top, bottom] = along(view.y, down, image.height);
  const found = [];
  for (let row = top; row <= bottom; row += 1) {
    for (let column = left; column <= right; column += 1) found.push([row, column]);
  }
  const far = ([row, column]) => Math.hypot((row + 0.5) * side - view.y, (column + 0.5) * side - view.x);
  return found.sort((a, b) => far(a) - far(b));
}

/** Draws a tile, or the matching part of the finest coarser tile that is loaded. */
function drawTile(layers, level, row, column) {
  const side = image.tile;
  const [left, top] = [column * side, row * side];
  const [width, height] = [image.width, image.height].map((full) => Math.ceil(full / 2 ** level));
  const [right, bottom] = [Math.min(left + side, width), Math.min(top + side, height)];
  const [x0, y0] = [onScreenX(left * 2 ** level), onScreenY(top * 2 ** level)];
  const x1 = onScreenX(Math.min(right * 2 ** level, image.width));
  const y1 = onScreenY(Math.min(bottom * 2 ** level, image.height));
  for (let up = 0; level + up < image.levels; up += 1) {
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

function draw() {
  clearCanvas();
  // Background of the image, visible where tiles are missing.
  const [x, y] = [onScreenX(0), onScreenY(0)];
  context.fillStyle = "#24282d";
  context.fillRect(x, y, onScreenX(image.width) - x, onScreenY(image.height) - y);
  const layers = [[[planeLayer(view.plane), planeLayer(before)], 1]];
  for (const [name, { on, opacity }] of groups) if (on) layers.push([[`label/${view.number}/${name}`], opacity]);
  const [level, coarsest] = [levelNow(), image.levels - 1];
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
    // Preloads the neighbouring planes.
    for (const plane of [view.plane - 1, view.plane + 1]) {
      if (!(plane in image.planes_um)) continue;
      for (const [row, column] of fine) needed.push(addressOf(planeLayer(plane), level, row, column));
    }
  }
  for (const address of needed) if (underway < AT_ONCE && !tiles.has(address)) load(address);
  forget(needed.length);
  document.body.dataset.ready = isHere;
  drawScale();
  keepPlace();
}
