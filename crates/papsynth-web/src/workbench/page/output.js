"use strict";

// Output: files, command line, Python, link.

function download(name, blob) {
  const link = Object.assign(document.createElement("a"), { download: name, href: URL.createObjectURL(blob) });
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}

async function copy(text, what) {
  try {
    await navigator.clipboard.writeText(text);
    status(`${what} copied.`);
  } catch {
    status(`The browser does not allow copying. ${what}: ${text}`);
  }
}

const fileName = () => `${state.preset}-${state.seed}-${state.index}`;

async function save(work) {
  try {
    await work();
  } catch (error) {
    say(error.message);
  }
}

element("save-recipe").addEventListener("click", () => save(async () => {
  const { text } = await (await request("print", { recipe: state.recipe, commented: true })).json();
  download(`${state.preset}.toml`, new Blob([text], { type: "application/toml" }));
  status("Recipe saved.");
}));
element("save-image").addEventListener("click", () => save(async () => {
  download(`${fileName()}.png`, await (await request(`image.png/${shown.head.id}`)).blob());
  status("Image saved.");
}));
element("save-masks").addEventListener("click", () => save(async () => {
  for (const group of info.groups) {
    download(`${fileName()}-${group}.png`, await (await request(`mask/${shown.head.id}/${group}.png`)).blob());
  }
  status("Label masks saved: the value of a pixel is the id of its object.");
}));
element("copy-command").addEventListener("click", () => copy(commandLine(), "Command"));
element("copy-check").addEventListener("click", () => copy(checkLine(), "Command"));
element("copy-python").addEventListener("click", () => copy(pythonLines(), "Python"));
element("copy-link").addEventListener("click", () => {
  keepNow();
  copy(location.href, "Link");
});

function showOutput() {
  element("command").textContent = commandLine();
  element("check-command").textContent = checkLine();
  // The command line has no option for a plane of a stack.
  element("check").hidden = focus !== null && state.recipe.focus.planes !== 1;
  element("python").textContent = pythonLines();
}

// The fragment of the address holds preset, differences, seed, index and view.

let kept = "";
let keeping = 0;
let isPlaced = false;

/** Whether a link has set the view. */
const placed = () => isPlaced;

function keepNow() {
  clearTimeout(keeping);
  if (!state.recipe) return;
  const words = linkWords();
  if (focus !== null) words.set("f", focus);
  const on = [...layers].filter(([, layer]) => layer.on).map(([name]) => name);
  if (on.length) words.set("l", on.join(","));
  if (element("by").value !== "object") words.set("c", element("by").value);
  if (element("noise-free").checked) words.set("n", "1");
  words.set("v", [view.x.toFixed(1), view.y.toFixed(1), Number(view.zoom.toPrecision(5))].join(","));
  history.replaceState(null, "", `#${words}`);
  kept = location.hash;
}

function keepPlace() {
  clearTimeout(keeping);
  keeping = setTimeout(() => { if (location.hash === kept) keepNow(); }, 200);
}

/** Reads the fragment. Returns an error message or nothing. */
function usePlace() {
  kept = location.hash;
  const words = new URLSearchParams(location.hash.slice(1));
  if (!words.has("p")) return null;
  const problem = readLink(words);
  if (problem) return problem;
  const number = Number.parseFloat(words.get("f"));
  focus = Number.isFinite(number) ? clamp(number, -200, 200) : null;
  element("noise-free").checked = words.get("n") === "1";
  element("by").value = ["class", "detectability"].includes(words.get("c")) ? words.get("c") : "object";
  const on = words.get("l")?.split(",") ?? [];
  for (const [name, layer] of layers) {
    layer.on = on.includes(name);
    layer.check.checked = layer.on;
  }
  const [x, y, zoom] = (words.get("v") ?? "").split(",").map(Number.parseFloat);
  if ([x, y, zoom].every(Number.isFinite) && zoom > 0) {
    Object.assign(view, { x, y, zoom: clamp(zoom, 1e-3, NEAREST) });
    isPlaced = true;
  }
  return null;
}
