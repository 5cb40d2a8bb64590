"use strict";

// The recipe, its differences from the preset, undo and redo, and its text in links, commands and Python.

/** The reply to `info`. */
let info = null;

const state = { preset: "lbc", base: null, recipe: null, seed: 0, index: 0 };

/** Presets and recipes before and after the present ones; the field that changes without a new entry in `past`. */
const past = [];
const future = [];
let moving = null;

const DISTRIBUTIONS = ["uniform", "normal", "log_normal", "choice"];
const isTable = (value) => typeof value === "object" && value !== null && !Array.isArray(value);

/** Whether a value has its own fields, unlike a distribution or a density. */
const isSection = (value) => isTable(value) && ![...DISTRIBUTIONS, "per_mm2"].some((name) => name in value);

function equal(a, b) {
  if (a === b) return true;
  if (typeof a !== "object" || typeof b !== "object" || !a || !b || Array.isArray(a) !== Array.isArray(b)) return false;
  const keys = Object.keys(a);
  return keys.length === Object.keys(b).length && keys.every((key) => key in b && equal(a[key], b[key]));
}

/** Returns the paths and values in which a recipe differs from another, as `--set` expects them. */
function differences(base, now, path = [], found = []) {
  const isKind = isSection(base) && isSection(now) && base.kind === now.kind;
  if (isKind && Object.keys(base).every((key) => key in now)) {
    for (const [key, value] of Object.entries(now)) {
      if (key in base) differences(base[key], value, [...path, key], found);
      else found.push([[...path, key], value]);
    }
  } else if (!equal(base, now)) {
    found.push([path, now]);
  }
  return found;
}

const at = (value, path) => path.reduce((inner, key) => inner?.[key], value);

/** Returns a recipe with another value at a path. */
function replaced(value, path, next) {
  if (path.length === 0) return next;
  const [key, ...rest] = path;
  return { ...value, [key]: replaced(value?.[key] ?? {}, rest, next) };
}

/** Returns a recipe without the value at a path. */
function removed(value, [key, ...rest]) {
  if (rest.length > 0) return { ...value, [key]: removed(value[key], rest) };
  const { [key]: _, ...others } = value;
  return others;
}

// History

/** Called after every change; set by workbench.js. */
let changed = () => {};

const snapshot = () => ({ preset: state.preset, base: state.base, recipe: state.recipe });

/** Replaces the recipe. Changes with the same `name`, until `settle`, are undone together. */
function setRecipe(recipe, name = null) {
  if (equal(recipe, state.recipe)) return;
  if (name === null || moving !== name) {
    past.push(snapshot());
    if (past.length > 500) past.shift();
    future.length = 0;
  }
  moving = name;
  state.recipe = recipe;
  changed(name);
}

/** Replaces the recipe by a preset. */
function setPreset({ name, recipe }) {
  settle();
  past.push(snapshot());
  future.length = 0;
  Object.assign(state, { preset: name, base: recipe, recipe });
  changed(null);
}

const settle = () => { moving = null; };

/** Returns a recipe without the values of its conditions at a path, as `--set` leaves it. */
function unconditional(recipe, path) {
  if (!recipe.conditions?.length) return recipe;
  const isOther = (key) => key.split(".").slice(0, path.length).some((name, k) => name !== path[k]);
  const cleared = (numbers) => Object.fromEntries(Object.entries(numbers).filter(([key]) => isOther(key)));
  const conditions = recipe.conditions.map((one) => ({ ...one, numbers: cleared(one.numbers) }));
  return { ...recipe, conditions };
}

/** Returns the values of a number under the conditions of the recipe. */
const conditionsAt = (path) =>
  (state.recipe.conditions ?? []).map(({ numbers }) => numbers[path.join(".")]).filter((value) => value !== undefined);

/** Sets a field, also under all conditions. */
const edit = (path, value, name = null) => setRecipe(unconditional(replaced(state.recipe, path, value), path), name);

function travel(from, to) {
  if (from.length === 0) return;
  settle();
  to.push(snapshot());
  Object.assign(state, from.pop());
  changed(null);
}
const undo = () => travel(past, future);
const redo = () => travel(future, past);

// Text

const key = (name) => (/^[A-Za-z0-9_-]+$/.test(name) ? name : JSON.stringify(name));
const dotted = (path) => path.map(key).join(".");

/** Returns a value on one line of TOML. */
function toml(value) {
  if (Array.isArray(value)) return `[${value.map(toml).join(", ")}]`;
  if (isTable(value)) {
    const fields = Object.entries(value).map(([name, inner]) => `${key(name)} = ${toml(inner)}`);
    return fields.length ? `{ ${fields.join(", ")} }` : "{}";
  }
  return typeof value === "string" ? JSON.stringify(value) : String(value);
}

const quoted = (word) => (/^[A-Za-z0-9_.=\/-]+$/.test(word) ? word : `'${word.replaceAll("'", "'\\''")}'`);

/** Returns what differs from the preset in the shown field, with the focus of the view. */
function settings() {
  const isStack = state.recipe.focus.planes !== 1;
  const recipe = focus === null || isStack ? state.recipe : replaced(state.recipe, ["focus", "centre_um"], focus);
  // Conditions are last: they hold over the fields set before them.
  const isLast = ([path]) => path[0] === "conditions";
  return differences(state.base, recipe).sort((a, b) => isLast(a) - isLast(b));
}

/** Returns a command for the field, with further options. */
function command(verb, ...options) {
  const sets = settings().map(([path, value]) => `--set ${quoted(`${dotted(path)}=${toml(value)}`)}`);
  return [`papsynth ${verb}`, `--preset ${state.preset}`, ...sets, `--seed ${state.seed}`, ...options].join(" \\\n  ");
}

/** Returns the command that writes the field. */
const commandLine = () => command("generate", `--range ${state.index}..${state.index + 1}`, "--out field");

/** Returns the command that prints the SHA-256 of the grey levels. */
const checkLine = () => command("preview", `--index ${state.index}`);

/** Returns a value in Python. */
function python(value) {
  if (Array.isArray(value)) return `[${value.map(python).join(", ")}]`;
  if (isTable(value)) {
    const fields = Object.entries(value).map(([name, inner]) => `${JSON.stringify(name)}: ${python(inner)}`);
    return `{${fields.join(", ")}}`;
  }
  if (typeof value === "boolean") return value ? "True" : "False";
  return typeof value === "string" ? JSON.stringify(value) : String(value);
}

/** Returns the lines of Python that make the field. */
function pythonLines() {
  const sets = settings();
  const place = (path) => path.map((name) => `[${JSON.stringify(name)}]`).join("");
  const lines = sets.map(([path, value]) => `recipe${place(path)} = ${python(value)}`);
  return [
    "import papsynth",
    `recipe = papsynth.recipe(${JSON.stringify(state.preset)})`,
    ...lines,
    `frame = papsynth.render(recipe, seed=${state.seed}, index=${state.index})`,
    'frame.save("field.png")',
  ].join("\n");
}

/** Returns the differences, seed and index for the fragment of a link. */
function linkWords() {
  const words = new URLSearchParams({ p: state.preset, s: state.seed, i: state.index });
  const sets = differences(state.base, state.recipe);
  if (sets.length > 0) words.set("d", JSON.stringify(sets));
  return words;
}

/** Reads a fragment that `linkWords` wrote. Returns an error message or nothing. */
function readLink(words) {
  const preset = info.presets.find(({ name }) => name === words.get("p"));
  if (!preset) return `The link has an unknown preset: ${words.get("p")}.`;
  try {
    const sets = JSON.parse(words.get("d") ?? "[]");
    const isPath = (path) => Array.isArray(path) && path.length > 0 && path.every((name) => typeof name === "string");
    if (!Array.isArray(sets) || !sets.every((set) => Array.isArray(set) && isPath(set[0]))) throw new Error();
    const recipe = sets.reduce((made, [path, value]) => replaced(made, path, value), preset.recipe);
    const number = (name) => clamp(Math.floor(Number(words.get(name))) || 0, 0, Number.MAX_SAFE_INTEGER);
    Object.assign(state, { preset: preset.name, base: preset.recipe, recipe, seed: number("s"), index: number("i") });
    return null;
  } catch {
    return "The link is damaged: its differences cannot be read.";
  }
}
