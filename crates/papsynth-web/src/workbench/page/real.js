"use strict";

// Images of the user beside the field: at the same scale and grey levels, with the measurements of the judge.

/** All images, and the one that is shown: description, samples, canvas, name. */
const reals = [];
let real = null;

const realUm = () => Number(element("real-um").value) || 0.25;

async function useReal(file) {
  if (!file) return;
  try {
    const headers = { "Content-Type": "application/octet-stream" };
    const response = await send("real", { method: "POST", body: file, headers });
    if (!response.ok) throw new Error((await response.json()).error);
    const reply = unframed(await response.arrayBuffer());
    reals.push({ ...reply, canvas: painted(reply), name: file.name });
    say("");
    status(`${file.name}: ${reply.head.width} × ${reply.head.height} pixels.`);
    chooseReal(reals.at(-1));
  } catch (error) {
    say(`${file.name}: ${error.message}`);
  }
}

async function useReals(files) {
  for (const file of files) await useReal(file);
}

/** Shows one of the images, or none. */
function chooseReal(next) {
  real = next ?? null;
  element("real-shown").hidden = element("real-remove").hidden = !real;
  element("real-choice").hidden = reals.length < 2;
  const options = reals.map(({ name, head }) => Object.assign(made("option", name), { value: head.id }));
  element("real-name").replaceChildren(...options);
  if (real) {
    element("real-name").value = real.head.id;
    fitBoth();
    showReal();
  } else {
    element("real-file").value = "";
    fit();
  }
  planMatch();
}

function removeReal() {
  const { id } = real.head;
  reals.splice(reals.indexOf(real), 1);
  chooseReal(reals.at(-1));
  request("real/remove", { id }).catch((error) => say(error.message));
}

/** Space between the two images, image pixels. */
const GAP_PX = 12;

/** Draws the image right of the field, in the same micrometres. */
function drawReal() {
  if (!real || !image) return;
  const scale = realUm() / image.pixel_um;
  const { width, height } = real.head;
  const left = image.width + GAP_PX;
  const [x0, y0] = [onScreenX(left), onScreenY(0)];
  const [x1, y1] = [onScreenX(left + width * scale), onScreenY(height * scale)];
  context.imageSmoothingEnabled = view.zoom * scale * devicePixelRatio < 1;
  context.drawImage(real.canvas, x0, y0, x1 - x0, y1 - y0);
}

function fitBoth() {
  if (!image || !real) return;
  const scale = realUm() / image.pixel_um;
  const width = image.width + GAP_PX + real.head.width * scale;
  const height = Math.max(image.height, real.head.height * scale);
  const zoom = 0.96 * Math.min(canvas.clientWidth / width, canvas.clientHeight / height);
  Object.assign(view, { x: Math.min(width / 2, image.width), y: height / 2, zoom });
  // The centre of the view is inside the field, so both fit if the zoom is halved where needed.
  view.zoom = Math.min(zoom, canvas.clientWidth / 2 / Math.max(view.x, width - view.x));
  redraw();
}

/** Bins of histograms. */
const BINS = 64;

/** Returns the fractions of pixels by grey level, of the green channel of three. */
function histogramOf({ head, levels }) {
  const { channels, bits, width, height } = head;
  const counts = new Float64Array(2 ** bits);
  for (let i = channels === 3 ? 1 : 0; i < levels.length; i += channels) counts[levels[i]] += 1;
  const bins = new Float64Array(BINS);
  counts.forEach((count, level) => {
    bins[Math.min(Math.floor((level / (counts.length - 1)) * BINS), BINS - 1)] += count / (width * height);
  });
  return bins;
}

/** Draws curves over each other: lists of points with both coordinates from 0 to 1, and class names. */
function plot(id, curves, labels) {
  const [width, height, foot] = [260, 90, 14];
  const svg = element(id);
  svg.replaceChildren(drawn("path", { d: `M0,${height - foot}H${width}`, class: "axis" }));
  for (const [points, name] of curves) {
    const d = points.map(([x, y]) => `${(x * width).toFixed(1)},${((1 - y) * (height - foot)).toFixed(1)}`).join("L");
    if (d) svg.append(drawn("path", { d: `M${d}`, class: name }));
  }
  for (const [x, text] of labels) {
    const anchor = x < 0.06 ? "start" : x > 0.94 ? "end" : "middle";
    const label = drawn("text", { x: clamp(x * width, 2, width - 2), y: height - 3, "text-anchor": anchor });
    label.textContent = text;
    svg.append(label);
  }
}

let comparing = 0;

/** Pause before the images are compared, ms; bars of differences that are shown. */
const [COMPARE_MS, BARS] = [400, 14];

/** Compares the two images. */
function showReal() {
  if (!real || !shown || shown.head.factor > 1) return;
  const [a, b] = [shown, real].map(histogramOf);
  const most = Math.max(...a, ...b);
  const bars = (counts) => Array.from(counts, (count, i) => [(i + 0.5) / BINS, Math.sqrt(count / most)]);
  plot("histogram", [[bars(b), "theirs"], [bars(a), "ours"]], [[0, "0"], [0.5, "50 %"], [1, "100 %"]]);
  element("measured").hidden = !info.compares;
  clearTimeout(comparing);
  if (info.compares) comparing = setTimeout(compare, COMPARE_MS);
}

async function compare() {
  const [{ id }, own] = [shown.head, real];
  if (!own) return;
  try {
    const found = await (await request("compare", { id, real: own.head.id, pixel_um: realUm() })).json();
    if (shown?.head.id === id && real === own) showCompared(found);
  } catch (error) {
    // Another image has replaced this one.
    if (error.status !== 404) element("distances").replaceChildren(made("p", error.message, "quiet"));
  }
}

/** Draws two curves of the judge on common axes. */
function plotBoth(id, places, { ours, theirs }, labels) {
  const values = [...ours, ...theirs].filter(Number.isFinite);
  const [low, high] = [Math.min(...values), Math.max(...values)];
  const [left, right] = [Math.min(...places), Math.max(...places)];
  const x = (value) => (value - left) / (right - left || 1);
  const y = (value) => 0.04 + 0.92 * ((value - low) / (high - low || 1));
  const isKnown = (point) => Number.isFinite(point[1]);
  const points = (line) => line.map((value, i) => [x(places[i]), y(value)]).filter(isKnown);
  plot(id, [[points(theirs), "theirs"], [points(ours), "ours"]], labels.map(([value, text]) => [x(value), text]));
}

function showCompared({ scalars, spectrum, profile }) {
  const logs = spectrum.at.map((um) => -Math.log10(um));
  const nulls = (values) => values.map((value) => value ?? NaN);
  const both = (curves) => ({ ours: nulls(curves.ours), theirs: nulls(curves.theirs) });
  const periods = [30, 10, 3, 1].filter((um) => -Math.log10(um) > logs[0] && -Math.log10(um) < logs.at(-1));
  plotBoth("spectrum", logs, both(spectrum), periods.map((um) => [-Math.log10(um), `${um} µm`]));
  const rings = profile.ours.map((_, i) => i + 1);
  plotBoth("profile", rings, both(profile), [[1, "border"], [10, "centre"]]);
  const round = (value) => Number(value.toPrecision(3));
  const sorted = [...scalars].sort((a, b) => b.difference - a.difference).slice(0, BARS);
  const rows = sorted.map(({ description, ours, theirs, difference }) => {
    const bar = Object.assign(document.createElement("meter"), { min: 0, max: 1, value: difference });
    bar.setAttribute("aria-label", `${description}, relative difference`);
    const text = made("span", `${round(ours)} · ${round(theirs)}`, "value");
    return made("li", [made("span", description), text, bar]);
  });
  element("distances").replaceChildren(...rows);
}

element("real-file").addEventListener("change", ({ target }) => useReals([...target.files]));
element("real-remove").addEventListener("click", removeReal);
element("real-name").addEventListener("change", ({ target }) => {
  chooseReal(reals.find(({ head }) => head.id === Number(target.value)));
});
element("real-um").addEventListener("input", () => { showReal(); planMatch(); redraw(); });
addEventListener("dragover", (event) => { event.preventDefault(); element("drop").classList.add("over"); });
addEventListener("dragleave", () => element("drop").classList.remove("over"));
addEventListener("drop", (event) => {
  event.preventDefault();
  element("drop").classList.remove("over");
  useReals([...event.dataTransfer.files]);
});
