"use strict";

// The page: its state, its controls and its keys.

// Text editor

/** The text that was read last, and whether the user edits it. */
let readText = null;
let isEdited = false;
let checking = 0;

const isTextShown = () => !element("text-panel").hidden;

/** Writes the recipe into the text editor. */
async function showText() {
  if (!isTextShown() || isEdited) return;
  const recipe = state.recipe;
  const { text } = await (await request("print", { recipe, commented: false })).json();
  if (recipe !== state.recipe || isEdited) return;
  element("text").value = readText = text;
  showErrors([]);
}

/** Numbers the lines and marks those with errors. */
function showErrors(errors) {
  const marked = new Set(errors.map(({ line }) => line));
  const total = element("text").value.split("\n").length;
  const lines = Array.from({ length: total }, (_, k) => made("span", `${k + 1}`, marked.has(k + 1) ? "wrong" : ""));
  element("lines").replaceChildren(...lines);
  element("text").setAttribute("aria-invalid", errors.length > 0);
  const items = errors.map(({ line, message, help }) => {
    const button = made("button", [line ? made("b", `Line ${line}: `) : "", message], "plain");
    button.type = "button";
    button.addEventListener("click", () => goToLine(line ?? 1));
    return made("li", [button, ...(help ? [made("p", help, "quiet")] : [])]);
  });
  element("text-errors").replaceChildren(...items);
}

function goToLine(line) {
  const text = element("text");
  const before = text.value.split("\n").slice(0, line - 1).join("\n").length + (line > 1 ? 1 : 0);
  const end = text.value.indexOf("\n", before);
  text.focus();
  text.setSelectionRange(before, end < 0 ? text.value.length : end);
  text.scrollTop = (line - 4) * Number.parseFloat(getComputedStyle(text).lineHeight);
}

async function checkText() {
  const text = element("text").value;
  if (text === readText) return;
  try {
    const { recipe, errors } = await (await request("check", { text })).json();
    if (text !== element("text").value) return;
    readText = text;
    showErrors(errors ?? []);
    if (errors) {
      status(`The text has ${errors.length === 1 ? "1 error" : `${errors.length} errors`}. The last image is shown.`);
    } else {
      setRecipe(recipe, "text");
    }
  } catch (error) {
    say(error.message);
  }
}

element("text").addEventListener("input", () => {
  isEdited = true;
  clearTimeout(checking);
  showErrors([]);
  checking = setTimeout(checkText, 250);
});
element("text").addEventListener("change", settle);
element("text").addEventListener("blur", () => {
  if (element("text-errors").childElementCount === 0) isEdited = false;
});
element("text").addEventListener("scroll", ({ target }) => { element("lines").scrollTop = target.scrollTop; });

/** Reads a file: a recipe, or sections that replace those of the recipe. */
async function openFile(input, isPart) {
  const [file] = input.files;
  input.value = "";
  if (!file) return;
  try {
    const text = await file.text();
    const { recipe, sections, errors } = await (await request("check", { text })).json();
    if (errors) {
      const [{ line, message }] = errors;
      say(`${file.name}${line ? `, line ${line}` : ""}: ${message}`);
      return;
    }
    settle();
    isEdited = false;
    const parts = Object.fromEntries(sections.map((name) => [name, recipe[name]]));
    setRecipe(isPart ? { ...state.recipe, ...parts } : recipe);
    status(`${file.name} is read.`);
  } catch (error) {
    say(error.message);
  }
}
element("open-recipe").addEventListener("change", ({ target }) => openFile(target, false));
element("lay-over").addEventListener("change", ({ target }) => openFile(target, true));

function showTab(name) {
  for (const tab of ["form", "text"]) {
    const isOn = tab === name;
    element(`${tab}-panel`).hidden = !isOn;
    element(`tab-${tab}`).setAttribute("aria-selected", isOn);
    element(`tab-${tab}`).tabIndex = isOn ? 0 : -1;
  }
  isEdited = false;
  if (name === "text") showText(); else showForm();
}
for (const tab of ["form", "text"]) {
  element(`tab-${tab}`).addEventListener("click", () => showTab(tab));
  element(`tab-${tab}`).addEventListener("keydown", (event) => {
    if (event.key !== "ArrowLeft" && event.key !== "ArrowRight") return;
    const other = tab === "form" ? "text" : "form";
    showTab(other);
    element(`tab-${other}`).focus();
    event.stopPropagation();
  });
}

// State

let outputs = 0;

function showState(name) {
  const count = differences(state.base, state.recipe).length;
  element("changed").textContent = count ? `${count} changed` : "";
  element("reset-all").hidden = count === 0;
  element("undo").disabled = past.length === 0;
  element("redo").disabled = future.length === 0;
  element("preset").value = state.preset;
  if (document.activeElement !== element("seed")) element("seed").value = state.seed;
  if (document.activeElement !== element("index")) element("index").value = state.index;
  element("previous").disabled = state.index === 0;
  element("colour").checked = state.recipe.light.kind === "colour";
  if (!isTextShown()) showForm();
  if (name !== "text") isEdited = false;
  showText().catch((error) => say(error.message));
  clearTimeout(outputs);
  outputs = setTimeout(showOutput, 100);
}

changed = (name) => {
  showState(name);
  render(name);
  keepPlace();
};

function go(index) {
  const there = clamp(index, 0, 4294967295);
  if (there === state.index) return;
  state.index = there;
  mark = null;
  changed(null);
}

function setColour(on) {
  const light = state.recipe.light;
  if ((light.kind === "colour") === on) return;
  const base = state.base.light;
  const kinds = resolved(info.schema.properties.light).oneOf;
  const kind = kinds.find((one) => one.properties.kind.const === (on ? "colour" : "monochrome"));
  edit(["light"], base.kind === kind.properties.kind.const ? base : defaultsOf(kind));
}

element("preset").addEventListener("change", ({ target }) => {
  isPlaced = false;
  setPreset(info.presets.find(({ name }) => name === target.value));
});
element("seed").addEventListener("change", ({ target }) => {
  state.seed = clamp(Math.floor(Number(target.value)) || 0, 0, Number.MAX_SAFE_INTEGER);
  changed(null);
});
element("index").addEventListener("change", ({ target }) => go(Math.floor(Number(target.value)) || 0));
element("previous").addEventListener("click", () => go(state.index - 1));
element("next").addEventListener("click", () => go(state.index + 1));
element("undo").addEventListener("click", undo);
element("redo").addEventListener("click", redo);
element("reset-all").addEventListener("click", () => setRecipe(state.base));
element("search").addEventListener("input", showForm);
element("only-changed").addEventListener("change", showForm);
element("by").addEventListener("change", recolour);
element("focus").addEventListener("input", ({ target }) => setFocus(Number(target.value)));
element("focus-reset").addEventListener("click", () => setFocus(null));
element("noise-free").addEventListener("change", () => { render("noise-free"); keepPlace(); });
element("colour").addEventListener("change", ({ target }) => setColour(target.checked));

// Keys

const KEYS = {
  ArrowLeft: () => move(-step(), 0),
  ArrowRight: () => move(step(), 0),
  ArrowUp: () => move(0, -step()),
  ArrowDown: () => move(0, step()),
  "+": () => zoomBy(Math.SQRT2),
  "=": () => zoomBy(Math.SQRT2),
  "-": () => zoomBy(Math.SQRT1_2),
  0: () => (real ? fitBoth() : fit()),
  "[": () => focusBy(-1),
  PageDown: () => focusBy(-1),
  "]": () => focusBy(1),
  PageUp: () => focusBy(1),
  n: () => go(state.index + 1),
  p: () => go(state.index - 1),
  "/": () => { showTab("form"); element("search").focus(); },
};

document.addEventListener("keydown", (event) => {
  const { target } = event;
  const isText = target instanceof HTMLTextAreaElement
    || (target instanceof HTMLInputElement && ["text", "search", "number"].includes(target.type));
  const letter = event.key.toLowerCase();
  if ((event.ctrlKey || event.metaKey) && !event.altKey && (letter === "z" || letter === "y") && !isText) {
    event.preventDefault();
    if (event.shiftKey || letter === "y") redo(); else undo();
    return;
  }
  if (!image || event.ctrlKey || event.metaKey || event.altKey || isText) return;
  if (event.target instanceof HTMLSelectElement || event.target.type === "range") return;
  // Arrows scroll the panels unless the canvas has the focus.
  if (/^(Arrow|Page)/.test(event.key) && event.target !== canvas && event.target !== document.body) return;
  const group = [...layers.keys()][Number(event.key) - 1];
  const act = group ? () => setLayer(group, !layers.get(group).on) : Object.hasOwn(KEYS, event.key) && KEYS[event.key];
  if (!act) return;
  event.preventDefault();
  act();
});

function start(problem) {
  showState(null);
  render();
  if (problem) say(problem);
}

addEventListener("hashchange", () => {
  if (location.hash === kept || !info) return;
  past.length = future.length = 0;
  settle();
  start(usePlace());
});

async function begin() {
  try {
    info = await (await request("info")).json();
  } catch (error) {
    say(error.status ? error.message : "The program does not respond.");
    return;
  }
  element("version").textContent = `papsynth ${info.version}, stream version ${info.stream_version}`;
  const presets = selectOf(info.presets.map(({ name, summary }) => [name, name, summary]));
  element("preset").replaceChildren(...presets.children);
  info.groups.forEach(addLayer);
  makeStrip();
  const { recipe: base } = info.presets.find(({ name }) => name === info.preset);
  Object.assign(state, { preset: info.preset, base, recipe: info.recipe, seed: info.seed });
  for (const name of ["field", "camera"]) open.add(name);
  start(usePlace());
}

begin();
