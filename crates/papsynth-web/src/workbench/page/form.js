"use strict";

// The form of the recipe, made from its JSON schema.

/** Shown fields by their path: functions that update them. */
let editors = [];

/** Paths of open sections. */
const open = new Set();

/** Paths of fields with an error, and the messages. */
let faults = new Map();

/** Returns a name of a field without its unit, as a title. */
const title = (name) =>
  name.replace(/_(um|px|e|dn|deg|k|c|s|rad|mm2)$/, "").replaceAll("_", " ").replace(/^\w/, (c) => c.toUpperCase());

/** Returns a select of [value, text, meaning]. */
function selectOf(options, label, className) {
  const node = made("select", options.map(([value, text, meaning]) => {
    return Object.assign(made("option", text ?? value), { value, title: meaning ?? "" });
  }), className);
  if (label) node.setAttribute("aria-label", label);
  return node;
}

/** Returns a schema with its reference resolved; own words win. */
function resolved(schema) {
  if (!schema.$ref) return schema;
  return { ...info.schema.$defs[schema.$ref.split("/").pop()], ...schema, name: schema.$ref.split("/").pop() };
}

/** Returns the schema of the kind that a value has, of a schema with several kinds. */
function ofKind(schema, value) {
  const kinds = (schema.oneOf ?? []).filter((kind) => kind.properties?.kind);
  if (kinds.length === 0) return schema;
  return kinds.find((kind) => kind.properties.kind.const === value?.kind) ?? kinds[0];
}

/** Splits a description into its meaning and the unit in its last line, "From 0 to 1 µm.". */
function described(schema) {
  const text = schema.description ?? "";
  const [line, low, high, unit] = text.match(/(?:^|\n)From (\S+) to (\S+?)(?: ([^\n]*?))?\.$/) ?? [];
  const meaning = (line ? text.slice(0, text.length - line.length) : text).replaceAll("\n", " ").trim();
  return { meaning, unit: unit ?? "", range: line ? `From ${low} to ${high}${unit ? ` ${unit}` : ""}.` : "" };
}

/** Returns all fields of a section with their paths and schemas. */
function fieldsOf(schema, value, path) {
  const found = [];
  const own = ofKind(schema, value);
  const names = own.properties ? Object.keys(own.properties) : Object.keys(value ?? {});
  for (const name of names) {
    if (name === "kind" || value?.[name] === undefined) continue;
    const inner = resolved(own.properties?.[name] ?? own.additionalProperties ?? {});
    if (inner.type === "array") continue;
    if (isSection(value[name])) found.push(...fieldsOf(inner, value[name], [...path, name]));
    else found.push({ path: [...path, name], schema: inner });
  }
  return found;
}

// Editors

let count = 0;

function wordEditor(path, schema) {
  const words = schema.oneOf?.map((word) => [word.const, word.const, word.description]);
  const select = selectOf(words ?? schema.enum.map((word) => [word]), null, "wide");
  select.id = `field-${dotted(path)}`;
  select.addEventListener("change", () => edit(path, select.value));
  const update = () => { select.value = at(state.recipe, path); };
  update();
  return { node: select, update };
}

function textEditor(path, _, label) {
  const field = input("text", label, "", (own) => edit(path, own.value, dotted(path)));
  const update = () => { if (field !== document.activeElement) field.value = at(state.recipe, path) ?? ""; };
  update();
  return { node: field, update };
}

/** A field: name, unit, help, editor, and a button that resets it. */
function fieldNode({ path, schema }, isLong) {
  const name = path.at(-1);
  const label = isLong ? path.slice(1).map(title).join(" › ") || title(name) : title(name);
  const { meaning, unit: named, range } = described(schema);
  // The select of a count or density names its unit.
  const unit = schema.name === "Abundance" ? "" : named;
  const isWord = schema.enum || (schema.oneOf && schema.oneOf[0].const);
  const value = at(state.recipe, path);
  const isNumber = typeof value === "number" || (isTable(value) && !isSection(value));
  const make = isWord ? wordEditor : isNumber ? numberEditor : textEditor;
  const editor = make(path, schema, label);
  const node = made("div", [], "field");
  node.dataset.path = dotted(path);
  const text = made("label", [label, unit ? made("span", ` ${unit}`, "unit") : ""]);
  const reset = Object.assign(made("button", "reset", "reset plain"), { type: "button" });
  reset.setAttribute("aria-label", `Reset ${label}`);
  reset.addEventListener("click", () => {
    const base = at(state.base, path);
    if (base !== undefined) edit(path, base);
    // The button is hidden now.
    node.querySelector("input, select")?.focus();
  });
  const help = made("p", [meaning, range ? made("span", ` ${range}`, "range") : ""], "help");
  help.id = `help-${(count += 1)}`;
  const varies = made("p", "", "varies");
  const fault = made("p", "", "fault");
  fault.id = `fault-${count}`;
  node.append(made("div", [text, editor.forms ?? "", reset], "head"), editor.node, varies, help, fault);
  const update = () => {
    editor.update();
    const base = at(state.base, path);
    const isChanged = base !== undefined && (!equal(base, at(state.recipe, path)) || conditionsAt(path).length > 0);
    node.classList.toggle("changed", isChanged || base === undefined);
    reset.hidden = !isChanged;
    if (isChanged) reset.title = `Reset to ${toml(base)}`;
    const conditions = conditionsAt(path).length;
    varies.hidden = conditions === 0;
    varies.textContent = `Each of ${conditions} conditions has a value of its own; a change here replaces them.`;
    const message = faults.get(node.dataset.path);
    fault.textContent = message ?? "";
    fault.hidden = !message;
    node.classList.toggle("faulty", Boolean(message));
    for (const own of node.querySelectorAll("input, select")) {
      own.setAttribute("aria-describedby", message ? `${fault.id} ${help.id}` : help.id);
      own.setAttribute("aria-invalid", Boolean(message));
    }
    text.htmlFor = editor.node.id || `field-${node.dataset.path}`;
  };
  update();
  editors.push(update);
  return node;
}

/** Appends the fields of a section, and its tables as groups. */
function fill(node, schema, value, path) {
  const kinds = (schema.oneOf ?? []).filter((kind) => kind.properties?.kind);
  if (kinds.length > 1) node.append(kindField(kinds, value, path));
  const own = ofKind(schema, value);
  const names = own.properties ? Object.keys(own.properties) : Object.keys(value);
  const [plain, tables] = [[], []];
  for (const name of names) {
    if (name === "kind" || value[name] === undefined) continue;
    const inner = resolved(own.properties?.[name] ?? own.additionalProperties ?? {});
    if (inner.type === "array") continue;
    (isSection(value[name]) ? tables : plain).push([name, inner]);
  }
  for (const [name, inner] of plain) node.append(fieldNode({ path: [...path, name], schema: inner }, false));
  const isCells = path.length === 1 && path[0] === "cells";
  for (const [name, inner] of tables) node.append(sectionNode(inner, [...path, name], isCells));
  if (isCells) node.append(addClass(value));
}

/** Returns a section of a kind with its defaults. */
function defaultsOf(kind) {
  const fields = Object.entries(kind.properties);
  return Object.fromEntries(fields.map(([name, field]) => [name, name === "kind" ? field.const : field.default ?? ""]));
}

/** The select of a section with several kinds. */
function kindField(kinds, value, path) {
  const nameOf = (kind) => kind.properties.kind.const;
  const select = selectOf(kinds.map((kind) => [nameOf(kind), nameOf(kind), kind.description]), null, "wide");
  select.value = value.kind;
  select.id = `field-${dotted([...path, "kind"])}`;
  select.addEventListener("change", () => {
    const base = at(state.base, path);
    const kind = kinds.find((one) => nameOf(one) === select.value);
    edit(path, base?.kind === select.value ? base : defaultsOf(kind));
  });
  const label = Object.assign(made("label", "Kind"), { htmlFor: select.id });
  const help = made("p", kinds.find((kind) => nameOf(kind) === value.kind)?.description ?? "", "help");
  const node = made("div", [made("div", [label], "head"), select, help], "field");
  const update = () => node.classList.toggle("changed", at(state.base, path)?.kind !== value.kind);
  update();
  editors.push(update);
  return node;
}

function addClass(cells) {
  const others = info.classes.filter((name) => !(name in cells));
  const select = selectOf([["", "Add a class…"], ...others.map((name) => [name])], "Add a class of cells", "wide");
  select.addEventListener("change", () => {
    const model = Object.values(state.recipe.cells)[0] ?? Object.values(info.presets[0].recipe.cells)[0];
    if (!select.value || !model) return;
    open.add(dotted(["cells", select.value]));
    edit(["cells", select.value], at(state.base, ["cells", select.value]) ?? { ...model, count: { per_mm2: 60 } });
  });
  return select;
}

/** A section that folds. Its fields are made when it is opened. */
function sectionNode(schema, path, isClass = false) {
  const node = made("details", [], path.length === 1 ? "section" : "inner");
  const name = dotted(path);
  const number = made("span", "", "count");
  const summary = made("summary", [made("span", title(path.at(-1))), number]);
  node.append(summary);
  node.dataset.path = name;
  const body = made("div", [], "body");
  node.append(body);
  const show = () => {
    if (body.childElementCount > 0) return;
    const { meaning } = described(schema);
    if (meaning) body.append(made("p", meaning, "help about"));
    fill(body, schema, at(state.recipe, path), path);
    if (path.length === 1 && path[0] === "camera") body.children[0]?.after(cameraField());
    if (isClass) {
      const remove = Object.assign(made("button", `Remove ${title(path.at(-1))}`), { type: "button" });
      remove.addEventListener("click", () => setRecipe(removed(state.recipe, path)));
      body.append(remove);
    }
  };
  node.addEventListener("toggle", () => {
    if (node.open) { open.add(name); show(); } else open.delete(name);
  });
  const update = () => {
    const [base, now] = [at(state.base, path), at(state.recipe, path)];
    const some = base === undefined ? 1 : differences(base, now).length;
    number.textContent = some ? `${some} changed` : "";
    node.classList.toggle("changed", some > 0);
  };
  update();
  editors.push(update);
  if (open.has(name)) { node.open = true; show(); }
  return node;
}

function cameraField() {
  const cameras = info.cameras.map(({ name, summary }) => [name, `${name}: ${summary}`]);
  const select = selectOf([["", "Built-in camera…"], ...cameras], "Use a built-in camera", "wide");
  select.addEventListener("change", () => {
    const camera = info.cameras.find(({ name }) => name === select.value);
    if (camera) edit(["camera"], camera.camera);
  });
  return made("div", [select], "field");
}

/** Returns what decides which fields there are. */
function structure(value) {
  if (!isSection(value)) return null;
  return Object.entries(value).map(([name, inner]) => [name, name === "kind" ? inner : structure(inner)]);
}
let built = "";

/** Returns a selector of a control of the form that also finds the one that replaces it. */
function selectorOf(control) {
  if (control.id) return `#${CSS.escape(control.id)}`;
  const path = `[data-path="${CSS.escape(control.closest("[data-path]")?.dataset.path ?? "")}"]`;
  return control.matches("summary") ? `${path} > summary` : `${path} [aria-label="${CSS.escape(control.ariaLabel ?? "")}"]`;
}

/** Shows the recipe in the form. The focus stays on its control, also if that is replaced. */
function showForm() {
  const focused = document.activeElement;
  const selector = element("form").contains(focused) ? selectorOf(focused) : null;
  updateForm();
  if (selector && !focused.isConnected) element("form").querySelector(selector)?.focus();
}

/** Builds the form, or updates its fields if no field was added or removed. */
function updateForm() {
  const words = element("search").value.toLowerCase().split(/\s+/).filter(Boolean);
  const onlyChanged = element("only-changed").checked;
  const names = onlyChanged ? differences(state.base, state.recipe).map(([path]) => dotted(path)) : null;
  const now = JSON.stringify([words, names, structure(state.recipe), state.preset]);
  if (now === built) {
    editors.forEach((update) => update());
    return;
  }
  built = now;
  editors = [];
  // Fields are not scanned.
  const isShown = (name) => isSection(state.recipe[name]) && name !== "scan";
  const sections = Object.entries(info.schema.properties).filter(([name]) => isShown(name));
  if (words.length === 0 && !onlyChanged) {
    element("form").replaceChildren(...sections.map(([name, schema]) => sectionNode(resolved(schema), [name])));
  } else {
    const found = [];
    for (const [name, schema] of sections) {
      const fields = fieldsOf(resolved(schema), state.recipe[name], [name]).filter((field) => {
        const own = dotted(field.path);
        const text = `${own} ${title(own)} ${field.schema.description ?? ""}`.toLowerCase();
        const isChanged = () => !equal(at(state.base, field.path), at(state.recipe, field.path));
        return words.every((word) => text.includes(word)) && (!onlyChanged || isChanged());
      });
      if (fields.length > 0) found.push(made("h3", title(name)), ...fields.map((field) => fieldNode(field, true)));
    }
    const none = onlyChanged && words.length === 0 ? "Nothing differs from the preset." : "No field matches.";
    element("form").replaceChildren(...(found.length ? found : [made("p", none, "quiet empty")]));
  }
}

/** Marks the fields with errors. */
function showFaults(errors) {
  faults = new Map(errors.map(({ path, message }) => [dotted(path), message]));
  editors.forEach((update) => update());
}
