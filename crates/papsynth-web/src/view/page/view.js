"use strict";

// Input handling and the side panel. tiles.js draws the canvas.

/** Panel entries that depend on the plane. */
let perPlane = [];

function showPlane(plane) {
  view.plane = clamp(plane, 0, Math.max(image.planes_um.length - 1, 0));
  element("plane").value = view.plane;
  const um = image.planes_um[view.plane] ?? 0;
  const text = `${minus(um, 2)} µm`;
  element("plane").setAttribute("aria-valuetext", text);
  element("plane-text").textContent = `${text} · ${view.plane + 1} of ${image.planes_um.length}`;
  for (const { node, values, unit } of perPlane) node.textContent = ofPlane(values, unit);
  redraw();
}

/** Number of the image that was requested last. */
let wanted = 0;

/** Shows an image at `place`, or all of it. */
async function showImage(number, place) {
  wanted = number;
  try {
    const next = await (await request(`image/${number}`)).json();
    if (wanted !== number) return;
    say("");
    // Keeps the position between images of the same size, to compare them.
    const stays = image && next.width === image.width && next.height === image.height;
    image = next;
    view.number = number;
    [mark, perPlane] = [null, []];
    element("objects").replaceChildren(made("p", "Click an object for details.", "quiet"));
    element("here-at").textContent = "";
    element("name").textContent = image.name;
    element("number").value = number + 1;
    element("previous").disabled = number === 0;
    element("next").disabled = number + 1 >= info.images;
    const um = [image.width, image.height].map((px) => px * image.pixel_um);
    const [unit, digits, name] = Math.max(...um) < 1000 ? [1, 0, "µm"] : [1000, 2, "mm"];
    const size = `${um.map((side) => (side / unit).toFixed(digits)).join(" × ")} ${name}`;
    const focus = image.planes_um.length === 0 ? " · extended depth of field" : "";
    element("about").textContent = `${image.width} × ${image.height} px · ${size}${focus}`;
    element("focus").hidden = image.planes_um.length < 2;
    element("plane").max = Math.max(image.planes_um.length - 1, 0);
    if (place) Object.assign(view, place, { zoom: clamp(place.zoom, farthest() / 2, NEAREST) });
    else if (!stays) fit();
    const middle = Math.floor(image.planes_um.length / 2);
    showPlane(place?.plane ?? (stays ? view.plane : middle));
    before = view.plane;
    move(0, 0);
  } catch (error) {
    say(error.message);
    element("number").value = number + 1;
  }
}

const go = (number) => {
  const there = clamp(number, 0, info.images - 1);
  if (there !== wanted) showImage(there);
};

let keeping = 0;

/** The URL fragment that this page set last. */
let kept = "";

/** Stores position and labels in the URL fragment, so that the view can be reloaded and shared. */
function keepPlace() {
  clearTimeout(keeping);
  keeping = setTimeout(() => {
    // The user entered another fragment, which is being loaded.
    if (location.hash !== kept) return;
    const shown = [...groups].filter(([, { on }]) => on);
    const labels = shown.map(([name, { opacity }]) => `${name}:${Math.round(opacity * 100)}`).join(",");
    const { number, plane, x, y, zoom } = view;
    const place = `#n=${number}&p=${plane}&x=${x.toFixed(1)}&y=${y.toFixed(1)}&z=${Number(zoom.toPrecision(5))}`;
    history.replaceState(null, "", `${place}&l=${labels}`);
    kept = location.hash;
  }, 150);
}

function keptPlace() {
  kept = location.hash;
  const words = new URLSearchParams(location.hash.slice(1));
  const [number, plane, x, y, zoom] = ["n", "p", "x", "y", "z"].map((key) => Number.parseFloat(words.get(key)));
  const labels = new Map(words.get("l")?.split(",").map((word) => word.split(":")));
  for (const name of groups.keys()) {
    setGroup(name, labels.has(name), clamp(Number(labels.get(name)) / 100 || 1, 0.05, 1));
  }
  if (![number, plane, x, y, zoom].every(Number.isFinite) || zoom <= 0) return { number: 0 };
  const place = { plane: Math.floor(plane), x, y, zoom };
  return { number: clamp(Math.floor(number), 0, info.images - 1), place };
}

// Object details

const ofPlane = (values, unit) => `${minus(values[view.plane] ?? values[0], 1)}${unit}`;

function addPerPlane(node, values, unit) {
  perPlane.push({ node, values, unit });
  node.textContent = ofPlane(values, unit);
}

async function look(x, y) {
  if (x < 0 || y < 0 || x >= image.width || y >= image.height) return;
  mark = { x, y };
  redraw();
  element("here-at").textContent = `${x}, ${y} px`;
  try {
    const { objects } = await (await request(`at/${view.number}/${x}/${y}`)).json();
    if (mark?.x !== x || mark?.y !== y) return;
    perPlane = [];
    const nodes = objects.length ? objects.map((object) => card(object, addPerPlane)) : [made("p", "No object here.", "quiet")];
    element("objects").replaceChildren(...nodes);
  } catch (error) {
    element("objects").replaceChildren(made("p", error.message, "quiet"));
  }
}

// Pointer and keyboard

const focusBy = (steps) => showPlane(view.plane + steps);

/** Shows the position of the pointer. */
function pointAt(x, y) {
  const um = (px) => minus(px * image.pixel_um, 1);
  element("position").textContent = `${Math.floor(x)}, ${Math.floor(y)} px · ${um(x)}, ${um(y)} µm`;
}

const [nearer, deeper, higher] = [() => zoomBy(Math.SQRT2), () => showPlane(view.plane - 1), () => showPlane(view.plane + 1)];
const [previous, next] = [() => go(wanted - 1), () => go(wanted + 1)];
const KEYS = {
  ArrowLeft: () => move(-step(), 0),
  ArrowRight: () => move(step(), 0),
  ArrowUp: () => move(0, -step()),
  ArrowDown: () => move(0, step()),
  ...{ "+": nearer, "=": nearer, "-": () => zoomBy(Math.SQRT1_2), 0: fit },
  ...{ "[": deeper, PageDown: deeper, "]": higher, PageUp: higher, n: next, p: previous },
};

document.addEventListener("keydown", (event) => {
  if (!image || event.ctrlKey || event.metaKey || event.altKey) return;
  // Sliders and number fields handle arrow keys themselves.
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
element("previous").addEventListener("click", previous);
element("next").addEventListener("click", next);
element("number").addEventListener("change", ({ target }) => go(Math.floor(Number(target.value) || 1) - 1));

// Missing tiles may have been written since.
addEventListener("focus", () => {
  for (const [address, tile] of tiles) if (tile === "absent" || tile === "broken") tiles.delete(address);
  redraw();
});
addEventListener("hashchange", () => {
  const { number, place } = keptPlace();
  showImage(number, place);
});

async function begin() {
  try {
    info = await (await request("info")).json();
  } catch (error) {
    say(error.status ? error.message : "The program does not respond.");
    return;
  }
  document.title = `${info.title} – papsynth view`;
  element("title").textContent = info.title;
  element("count").textContent = info.images;
  element("number").max = info.images;
  element("images").hidden = info.images < 2;
  info.groups.forEach(addGroup);
  if (info.images === 0) {
    say("No image yet.");
    return;
  }
  const { number, place } = keptPlace();
  await showImage(number, place);
}

begin();
