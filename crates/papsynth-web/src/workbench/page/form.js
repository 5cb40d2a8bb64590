"use strict";

// The form of the recipe, made from its JSON schema.

/** Shown fields by their path: functions that update them. */
let editors = [];

/** Paths of open sections. */
const open = new Set();

/** Paths of fields with an error, and the messages. */
let faults = new Map();

const title = (name) => name.replace(/_(um|px|e|dn|deg|k|c|s|rad|mm2)$/, "").replaceAll("_", " ").replace(/^\w/, (c) => c.toUpperCase());

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

// Distributions

const formOf = (value) => (isTable(value) ? DISTRIBUTIONS.find((name) => name in value) : "constant");
const FORMS = { constant: "constant", uniform: "uniform", normal: "normal", log_normal: "log-normal", choice: "choice" };
const PARTS = { uniform: ["from", "to"], normal: ["mean", "sd"], log_normal: ["median", "sd of log"] };

/** Returns the centre of a number: the value that its slider moves. */
function centre(value) {
  if (!isTable(value)) return value;
  if (value.uniform) return (value.uniform[0] + value.uniform[1]) / 2;
  if (value.choice) return value.choice.reduce((sum, one) => sum + one, 0) / value.choice.length;
  return (value.normal ?? value.log_normal)[0];
}

const tidy = (number) => Number(number.toPrecision(6));

/** Returns a number with another centre. */
function moved(value, to, [low, high]) {
  if (!isTable(value)) return to;
  const by = to - centre(value);
  const shift = (one) => tidy(clamp(one + by, low, high));
  if (value.uniform) return { ...value, uniform: value.uniform.map(shift) };
  if (value.choice) return { ...value, choice: value.choice.map(shift) };
  if (value.normal) return { ...value, normal: [to, value.normal[1]] };
  return { ...value, log_normal: [Math.max(to, 1e-9), value.log_normal[1]] };
}

/** Returns a number of another form with the same centre. */
function formed(value, form, [low, high]) {
  const middle = centre(value);
  const spread = Math.abs(middle) * 0.2 || (Math.min(high, 1) - Math.max(low, 0)) * 0.1;
  const within = (one) => tidy(clamp(one, low, high));
  switch (form) {
    case "uniform": return { uniform: [within(middle - spread), within(middle + spread)] };
    case "normal": return { normal: [middle, tidy(spread / 2)], min: within(middle - 2 * spread), max: within(middle + 2 * spread) };
    case "log_normal": return { log_normal: [Math.max(middle, 1e-6), 0.2], max: within(Math.max(middle, 1e-6) * 2), min: within(0) };
    case "choice": return { choice: [...new Set([within(middle - spread), middle, within(middle + spread)])] };
    default: return middle;
  }
}

const SVG = "http://www.w3.org/2000/svg";
function drawn(tag, attributes) {
  const node = document.createElementNS(SVG, tag);
  for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
  return node;
}

/** Draws the density of a distribution, and the range that it covers. */
function curve(value) {
  const [width, height] = [96, 22];
  const svg = drawn("svg", { viewBox: `0 0 ${width} ${height}`, class: "curve", "aria-hidden": "true" });
  const [middle, spread] = value.normal ?? value.log_normal ?? [0, 0];
  let ends = value.uniform ?? [middle - 3.2 * spread, middle + 3.2 * spread];
  if (value.choice) ends = [Math.min(...value.choice), Math.max(...value.choice)];
  if (value.log_normal) ends = [0, middle * Math.exp(2.2 * spread)];
  const pad = (ends[1] - ends[0] || Math.abs(ends[0]) || 1) * 0.12;
  const [low, high] = [ends[0] - pad, ends[1] + pad];
  const x = (one) => ((one - low) / (high - low)) * width;
  if (value.choice) {
    for (const one of value.choice) svg.append(drawn("path", { d: `M${x(one)},${height}V4`, class: "stem" }));
    return svg;
  }
  const inside = (one) => one >= (value.min ?? -Infinity) && one <= (value.max ?? Infinity);
  const density = (one) => {
    if (!inside(one)) return 0;
    if (value.uniform) return one >= ends[0] && one <= ends[1] ? 1 : 0;
    if (value.normal) return Math.exp(-(((one - middle) / (spread || 1e-9)) ** 2) / 2);
    if (one <= 0) return 0;
    return Math.exp(-((Math.log(one / middle) / (spread || 1e-9)) ** 2) / 2) / one;
  };
  const places = Array.from({ length: width + 1 }, (_, i) => low + (i / width) * (high - low));
  const values = places.map(density);
  const most = Math.max(...values, 1e-12);
  const d = values.map((one, i) => `${i},${(height - (one / most) * (height - 3)).toFixed(1)}`).join("L");
  svg.append(drawn("path", { d: `M0,${height}L${d}L${width},${height}Z`, class: "area" }));
  return svg;
}

// Editors

let count = 0;

function input(type, label, value, onInput, more = {}) {
  const node = Object.assign(document.createElement("input"), { type, value, ...more });
  if (label) node.setAttribute("aria-label", label);
  node.addEventListener("input", () => onInput(node, true));
  node.addEventListener("change", () => { onInput(node, false); settle(); });
  return node;
}

const numberOf = (node) => (node.value.trim() === "" || !Number.isFinite(Number(node.value)) ? null : Number(node.value));

/** Returns the range of a slider: that of the field, or a part around the present value if that is much wider. */
function sliderRange(schema, base, value) {
  const [low, high] = [schema.minimum ?? 0, schema.maximum ?? 1];
  const size = Math.max(Math.abs(centre(base) ?? 0), Math.abs(centre(value)), 0);
  const most = size === 0 ? Math.min(high, Math.max(10, low)) : 4 * size;
  return [low < 0 ? Math.max(low, -most) : low, Math.min(high, Math.max(most, low))];
}

/** Editor of a number, a distribution, or a density. */
function numberEditor(path, schema, label) {
  const node = made("div", [], "number");
  const forms = made("span", [], "forms");
  const name = dotted(path);
  const isDensity = schema.name === "Abundance";
  const mayVary = schema.name === "Number" || isDensity || schema.anyOf !== undefined;
  const limits = [schema.minimum ?? -Infinity, schema.maximum ?? Infinity];
  const present = () => {
    const value = at(state.recipe, path);
    return value?.per_mm2 !== undefined ? value.per_mm2 : value;
  };
  const base = () => {
    const value = at(state.base, path);
    return value?.per_mm2 !== undefined ? value.per_mm2 : value;
  };
  const put = (number, live) => {
    const isPer = at(state.recipe, path)?.per_mm2 !== undefined;
    edit(path, isPer ? { per_mm2: number } : number, live ? name : null);
  };
  const isWhole = schema.type === "integer";
  const update = () => {
    const value = present();
    const active = document.activeElement;
    const form = formOf(value);
    const signature = `${form} ${isTable(value) && value.choice ? value.choice.length : ""} ${at(state.recipe, path)?.per_mm2 !== undefined}`;
    if (node.dataset.signature !== signature) {
      node.dataset.signature = signature;
      build(value, form);
      return;
    }
    for (const [field, read] of node.fields) if (field !== active) field.value = read(value);
    if (node.plot) {
      const plot = curve(value);
      node.plot.replaceWith(plot);
      node.plot = plot;
    }
  };
  function build(value, form) {
    node.replaceChildren();
    forms.replaceChildren();
    node.fields = [];
    node.plot = null;
    const row = made("div", [], "row");
    const whole = isWhole ? 1 : "any";
    const add = (type, text, read, write, more) => {
      const field = input(type, text, read(value), (own, live) => {
        const number = numberOf(own);
        if (number !== null) put(write(number, present()), live || type === "range");
      }, more);
      node.fields.push([field, read]);
      return field;
    };
    const [low, high] = sliderRange(schema, base() ?? value, value);
    const step = isWhole ? 1 : 10 ** Math.floor(Math.log10((high - low || 1) / 200));
    const slider = add("range", `${label}, slider`, centre, (to, now) => moved(now, tidy(to), limits), { min: low, max: high, step });
    // The value is set again after the range of the slider.
    slider.value = centre(value);
    if (form === "constant") {
      const text = add("number", null, (now) => now, (to) => to, { step: whole, min: schema.minimum, max: schema.maximum, id: `field-${name}` });
      row.append(slider, text);
    } else {
      row.append(slider);
      node.plot = curve(value);
      row.append(node.plot);
    }
    if (mayVary) {
      const select = made("select", Object.entries(FORMS).map(([id, text]) => Object.assign(made("option", text), { value: id })));
      select.value = form;
      select.setAttribute("aria-label", `${label}, distribution`);
      select.addEventListener("change", () => put(formed(present(), select.value, limits), false));
      forms.append(select);
    }
    node.append(row);
    if (form !== "constant") {
      const parts = made("div", [], "parts");
      const part = (text, read, write) => parts.append(made("label", [`${text} `, add("number", `${label}, ${text}`, read, write, { step: "any" })]));
      parts.classList.toggle("wide", form === "choice");
      if (form === "choice") {
        const text = input("text", `${label}, values`, value.choice.join(", "), (own) => {
          const values = own.value.split(/[\s,;]+/).filter(Boolean).map(Number);
          if (values.length > 0 && values.every(Number.isFinite)) put({ ...present(), choice: values }, true);
        });
        node.fields.push([text, (now) => now.choice.join(", ")]);
        parts.append(made("label", ["values ", text]));
      } else {
        PARTS[form].forEach((text, k) => part(text, (now) => now[form][k], (to, now) => ({ ...now, [form]: now[form].with(k, to) })));
      }
      for (const end of ["min", "max"]) {
        const field = input("number", `${label}, ${end}`, value[end] ?? "", (own, live) => {
          const { [end]: _, ...rest } = present();
          const number = numberOf(own);
          put(number === null ? rest : { ...rest, [end]: number }, live);
        }, { step: "any", placeholder: "none" });
        node.fields.push([field, (now) => now[end] ?? ""]);
        parts.append(made("label", [`${end} `, field]));
      }
      node.append(parts);
    }
    if (isDensity) {
      const select = made("select", [Object.assign(made("option", "per field"), { value: "field" }), Object.assign(made("option", "per mm²"), { value: "mm2" })]);
      const isPer = at(state.recipe, path)?.per_mm2 !== undefined;
      select.value = isPer ? "mm2" : "field";
      select.setAttribute("aria-label", `${label}, count or density`);
      select.addEventListener("change", () => {
        const area = at(state.recipe, ["field", "width_px"]) * at(state.recipe, ["field", "height_px"]) * centre(at(state.recipe, ["field", "pixel_um"])) ** 2 * 1e-6;
        const factor = Number.isFinite(area) && area > 0 ? (select.value === "mm2" ? 1 / area : area) : 1;
        const middle = centre(present());
        edit(path, select.value === "mm2" ? { per_mm2: tidy(middle * factor) } : Math.round(middle * factor));
      });
      forms.prepend(select);
    }
  }
  update();
  return { node, update, forms };
}

function wordEditor(path, schema, label) {
  const words = schema.oneOf ? schema.oneOf.map((word) => [word.const, word.description ?? ""]) : schema.enum.map((word) => [word, ""]);
  const select = made("select", words.map(([word, meaning]) => Object.assign(made("option", word), { value: word, title: meaning })), "wide");
  select.id = `field-${dotted(path)}`;
  select.addEventListener("change", () => edit(path, select.value));
  const update = () => { select.value = at(state.recipe, path); };
  update();
  return { node: select, update };
}

function textEditor(path, label) {
  const field = input("text", label, "", (own) => edit(path, own.value, dotted(path)));
  const update = () => { if (field !== document.activeElement) field.value = at(state.recipe, path) ?? ""; };
  update();
  return { node: field, update };
}

/** A field: name, unit, help, editor, and a button that resets it. */
function fieldNode({ path, schema }, isLong) {
  const name = path.at(-1);
  const label = isLong ? path.slice(1).map(title).join(" › ") || title(name) : title(name);
  const { meaning, unit, range } = described(schema);
  const isWord = schema.enum || (schema.oneOf && schema.oneOf[0].const);
  const value = at(state.recipe, path);
  const isNumber = typeof value === "number" || (isTable(value) && !isSection(value));
  const editor = isWord ? wordEditor(path, schema, label) : isNumber ? numberEditor(path, schema, label) : textEditor(path, label);
  const node = made("div", [], "field");
  node.dataset.path = dotted(path);
  const text = made("label", [label, unit ? made("span", ` ${unit}`, "unit") : ""]);
  const reset = Object.assign(made("button", "reset", "reset plain"), { type: "button" });
  reset.setAttribute("aria-label", `Reset ${label}`);
  reset.addEventListener("click", () => {
    const base = at(state.base, path);
    if (base !== undefined) edit(path, base);
  });
  const help = made("p", [meaning, range ? made("span", ` ${range}`, "range") : ""], "help");
  help.id = `help-${(count += 1)}`;
  const fault = made("p", "", "fault");
  fault.id = `fault-${count}`;
  node.append(made("div", [text, editor.forms ?? "", reset], "head"), editor.node, help, fault);
  const update = () => {
    editor.update();
    const base = at(state.base, path);
    const isChanged = base !== undefined && !equal(base, at(state.recipe, path));
    node.classList.toggle("changed", isChanged || base === undefined);
    reset.hidden = !isChanged;
    if (isChanged) reset.title = `Reset to ${toml(base)}`;
    const message = faults.get(node.dataset.path);
    fault.textContent = message ?? "";
    fault.hidden = !message;
    node.classList.toggle("faulty", Boolean(message));
    for (const own of node.querySelectorAll("input, select")) {
      own.setAttribute("aria-describedby", message ? `${fault.id} ${help.id}` : help.id);
      own.toggleAttribute("aria-invalid", Boolean(message));
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
  for (const [name, inner] of tables) node.append(sectionNode(inner, [...path, name], path.length === 1 && path[0] === "cells"));
  if (path.length === 1 && path[0] === "cells") node.append(addClass(value));
}

/** The select of a section with several kinds. */
function kindField(kinds, value, path) {
  const select = made("select", kinds.map((kind) => Object.assign(made("option", kind.properties.kind.const), { value: kind.properties.kind.const, title: kind.description ?? "" })), "wide");
  select.value = value.kind;
  select.id = `field-${dotted([...path, "kind"])}`;
  select.addEventListener("change", () => {
    const base = at(state.base, path);
    const kind = kinds.find((one) => one.properties.kind.const === select.value);
    const defaults = { kind: select.value };
    for (const [name, field] of Object.entries(kind.properties)) if (name !== "kind") defaults[name] = field.default ?? "";
    edit(path, base?.kind === select.value ? base : defaults);
  });
  const label = Object.assign(made("label", "Kind"), { htmlFor: select.id });
  const help = made("p", kinds.find((kind) => kind.properties.kind.const === value.kind)?.description ?? "", "help");
  const node = made("div", [made("div", [label], "head"), select, help], "field");
  const update = () => node.classList.toggle("changed", at(state.base, path)?.kind !== value.kind);
  update();
  editors.push(update);
  return node;
}

function addClass(cells) {
  const others = info.classes.filter((name) => !(name in cells));
  const select = made("select", [Object.assign(made("option", "Add a class…"), { value: "" }), ...others.map((name) => Object.assign(made("option", name), { value: name }))], "wide");
  select.setAttribute("aria-label", "Add a class of cells");
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
  const summary = made("summary", [made("span", path.length === 1 || isClass ? title(path.at(-1)) : title(path.at(-1)), "name"), number]);
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
  const select = made("select", [Object.assign(made("option", "Built-in camera…"), { value: "" }), ...info.cameras.map((camera) => Object.assign(made("option", `${camera.name}: ${camera.summary}`), { value: camera.name }))], "wide");
  select.setAttribute("aria-label", "Use a built-in camera");
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

/** Builds the form, or updates its fields if no field was added or removed. */
function showForm() {
  const words = element("search").value.toLowerCase().split(/\s+/).filter(Boolean);
  const onlyChanged = element("only-changed").checked;
  const names = onlyChanged ? differences(state.base, state.recipe).map(([path]) => dotted(path)) : null;
  const now = JSON.stringify([words, names, structure(state.recipe), state.preset]);
  if (now === built) {
    editors.forEach((update) => update());
    return;
  }
  const focused = document.activeElement?.id;
  built = now;
  editors = [];
  const sections = Object.entries(info.schema.properties).filter(([name]) => isSection(state.recipe[name]) && name !== "scan");
  if (words.length === 0 && !onlyChanged) {
    element("form").replaceChildren(...sections.map(([name, schema]) => sectionNode(resolved(schema), [name])));
  } else {
    const found = [];
    for (const [name, schema] of sections) {
      const fields = fieldsOf(resolved(schema), state.recipe[name], [name]).filter((field) => {
        const text = `${dotted(field.path)} ${title(dotted(field.path))} ${field.schema.description ?? ""}`.toLowerCase();
        const isChanged = () => !equal(at(state.base, field.path), at(state.recipe, field.path));
        return words.every((word) => text.includes(word)) && (!onlyChanged || isChanged());
      });
      if (fields.length > 0) found.push(made("h3", title(name)), ...fields.map((field) => fieldNode(field, true)));
    }
    element("form").replaceChildren(...(found.length ? found : [made("p", onlyChanged && !words.length ? "Nothing differs from the preset." : "No field matches.", "quiet empty")]));
  }
  if (focused) element(focused)?.focus();
}

/** Marks the fields with errors. */
function showFaults(errors) {
  faults = new Map(errors.map(({ path, message }) => [dotted(path), message]));
  editors.forEach((update) => update());
}
