"use strict";

// An image of the user beside the field: at the same scale and grey levels, with histograms and power spectra.

/** The image: description, samples, canvas. */
let real = null;

const realUm = () => Number(element("real-um").value) || 0.25;

async function useReal(file) {
  if (!file) return;
  try {
    const response = await fetch("real", { method: "POST", body: file, headers: { "Content-Type": "application/octet-stream" } });
    if (!response.ok) throw new Error((await response.json()).error);
    const reply = unframed(await response.arrayBuffer());
    real = { ...reply, canvas: painted(reply), name: file.name };
    say("");
    element("real-shown").hidden = element("real-remove").hidden = false;
    status(`${file.name}: ${reply.head.width} × ${reply.head.height} pixels.`);
    fitBoth();
    showReal();
  } catch (error) {
    say(`${file.name}: ${error.message}`);
  }
}

function removeReal() {
  real = null;
  element("real-shown").hidden = element("real-remove").hidden = true;
  element("real-file").value = "";
  fit();
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
  const [width, height] = [image.width + GAP_PX + real.head.width * scale, Math.max(image.height, real.head.height * scale)];
  const zoom = 0.96 * Math.min(canvas.clientWidth / width, canvas.clientHeight / height);
  Object.assign(view, { x: Math.min(width / 2, image.width), y: height / 2, zoom });
  // The centre of the view is inside the field, so both fit if the zoom is halved where needed.
  view.zoom = Math.min(zoom, canvas.clientWidth / 2 / Math.max(view.x, width - view.x));
  redraw();
}

/** Returns the levels of one channel, the green one of three, as fractions of the largest level. */
function fractions({ head, levels }) {
  const { channels, bits } = head;
  const white = 2 ** bits - 1;
  const first = channels === 3 ? 1 : 0;
  return Float32Array.from({ length: head.width * head.height }, (_, i) => levels[i * channels + first] / white);
}

/** Bins of histograms. */
const BINS = 64;

function histogramOf(values) {
  const counts = new Float64Array(BINS);
  for (const value of values) counts[Math.min(Math.floor(value * BINS), BINS - 1)] += 1;
  return counts.map((count) => count / values.length);
}

/** Fast Fourier transform of rows of complex numbers, in place; the length is a power of 2. */
function transform(re, im, size, start, stride) {
  for (let i = 1, j = 0; i < size; i += 1) {
    let bit = size >> 1;
    for (; j & bit; bit >>= 1) j ^= bit;
    j ^= bit;
    if (i >= j) continue;
    const [a, b] = [start + i * stride, start + j * stride];
    [re[a], re[b]] = [re[b], re[a]];
    [im[a], im[b]] = [im[b], im[a]];
  }
  for (let length = 2; length <= size; length *= 2) {
    const angle = (-2 * Math.PI) / length;
    for (let k = 0; k < length / 2; k += 1) {
      const [cos, sin] = [Math.cos(angle * k), Math.sin(angle * k)];
      for (let first = k; first < size; first += length) {
        const [a, b] = [start + first * stride, start + (first + length / 2) * stride];
        const [x, y] = [re[b] * cos - im[b] * sin, re[b] * sin + im[b] * cos];
        [re[b], im[b]] = [re[a] - x, im[a] - y];
        [re[a], im[a]] = [re[a] + x, im[a] + y];
      }
    }
  }
}

/** Returns the mean power of the centre of an image at each frequency, as [cycles per µm, power]. */
function spectrumOf(values, width, height, um) {
  const size = Math.min(512, 2 ** Math.floor(Math.log2(Math.min(width, height))));
  if (size < 32) return [];
  const [left, top] = [(width - size) >> 1, (height - size) >> 1];
  const [re, im] = [new Float32Array(size * size), new Float32Array(size * size)];
  let mean = 0;
  for (let y = 0; y < size; y += 1) for (let x = 0; x < size; x += 1) mean += values[(top + y) * width + left + x];
  mean /= size * size;
  const taper = Float32Array.from({ length: size }, (_, i) => 0.5 - 0.5 * Math.cos((2 * Math.PI * (i + 0.5)) / size));
  for (let y = 0; y < size; y += 1) {
    for (let x = 0; x < size; x += 1) re[y * size + x] = (values[(top + y) * width + left + x] - mean) * taper[x] * taper[y];
  }
  for (let y = 0; y < size; y += 1) transform(re, im, size, y * size, 1);
  for (let x = 0; x < size; x += 1) transform(re, im, size, x, size);
  const [sums, counts] = [new Float64Array(size / 2), new Float64Array(size / 2)];
  const fold = (i) => (i > size / 2 ? size - i : i);
  for (let y = 0; y < size; y += 1) {
    for (let x = 0; x < size; x += 1) {
      const ring = Math.round(Math.hypot(fold(x), fold(y)));
      if (ring < 1 || ring >= size / 2) continue;
      sums[ring] += re[y * size + x] ** 2 + im[y * size + x] ** 2;
      counts[ring] += 1;
    }
  }
  // Power per frequency and area does not depend on pixel size and crop.
  return Array.from(sums, (sum, ring) => [ring / (size * um), (sum / counts[ring]) * (um / size) ** 2]).slice(1);
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
    const label = drawn("text", { x: clamp(x * width, 8, width - 12), y: height - 3, "text-anchor": "middle" });
    label.textContent = text;
    svg.append(label);
  }
}

const statistics = (values) => {
  let [sum, squares] = [0, 0];
  for (const value of values) { sum += value; squares += value * value; }
  const mean = sum / values.length;
  return { mean, sd: Math.sqrt(Math.max(squares / values.length - mean * mean, 0)) };
};

/** Compares the two images. */
function showReal() {
  if (!real || !shown || shown.head.factor > 1) return;
  const [ours, theirs] = [fractions(shown), fractions(real)];
  const [a, b] = [histogramOf(ours), histogramOf(theirs)];
  const most = Math.max(...a, ...b);
  const bars = (counts) => Array.from(counts, (count, i) => [(i + 0.5) / BINS, Math.sqrt(count / most)]);
  plot("histogram", [[bars(b), "theirs"], [bars(a), "ours"]], [[0, "0"], [0.5, "50 %"], [0.97, "100 %"]]);
  const spectra = [
    [spectrumOf(theirs, real.head.width, real.head.height, realUm()), "theirs"],
    [spectrumOf(ours, shown.head.width, shown.head.height, shown.head.pixel_um), "ours"],
  ];
  const points = spectra.flatMap(([curve_]) => curve_).filter(([, power]) => power > 0);
  const logs = (k) => points.map((point) => Math.log10(point[k]));
  const [x0, x1, y0, y1] = [Math.min(...logs(0)), Math.max(...logs(0)), Math.min(...logs(1)), Math.max(...logs(1))];
  const onPlot = (points_) => points_.filter(([, power]) => power > 0).map(([f, power]) => [(Math.log10(f) - x0) / (x1 - x0), 0.04 + 0.94 * ((Math.log10(power) - y0) / (y1 - y0))]);
  const periods = [100, 30, 10, 3, 1, 0.5].filter((um) => -Math.log10(um) > x0 && -Math.log10(um) < x1);
  plot("spectrum", spectra.map(([points_, name]) => [onPlot(points_), name]), periods.map((um) => [(-Math.log10(um) - x0) / (x1 - x0), `${um} µm`]));
  const [own, other] = [statistics(ours), statistics(theirs)];
  let difference = 0;
  let sum = 0;
  a.forEach((count, i) => { sum += count - b[i]; difference += Math.abs(sum) / BINS; });
  const percent = (value) => `${(100 * value).toFixed(1)} %`;
  const rows = [
    ["mean grey level", `${percent(own.mean)} · ${percent(other.mean)}`],
    ["standard deviation", `${percent(own.sd)} · ${percent(other.sd)}`],
    ["distance of histograms", percent(difference)],
  ];
  element("real-facts").replaceChildren(...rows.flatMap(([name, value]) => [made("dt", name), made("dd", value)]));
}

element("real-file").addEventListener("change", ({ target }) => useReal(target.files[0]));
element("real-remove").addEventListener("click", removeReal);
element("real-um").addEventListener("input", () => { showReal(); redraw(); });
addEventListener("dragover", (event) => { event.preventDefault(); element("drop").classList.add("over"); });
addEventListener("dragleave", () => element("drop").classList.remove("over"));
addEventListener("drop", (event) => {
  event.preventDefault();
  element("drop").classList.remove("over");
  useReal(event.dataTransfer.files[0]);
});
