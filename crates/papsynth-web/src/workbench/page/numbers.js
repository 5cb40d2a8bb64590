"use strict";

// Numbers and distributions of the form.

// Distributions

const formOf = (value) => (isTable(value) ? DISTRIBUTIONS.find((name) => name in value) : "constant");
const FORMS = [["constant"], ["uniform"], ["normal"], ["log_normal", "log-normal"], ["choice"]];
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
    case "normal": {
      const [min, max] = [within(middle - 2 * spread), within(middle + 2 * spread)];
      return { normal: [middle, tidy(spread / 2)], min, max };
    }
    case "log_normal": {
      const median = Math.max(middle, 1e-6);
      return { log_normal: [median, 0.2], min: within(0), max: within(2 * median) };
    }
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

// Editor

function input(type, label, value, onInput, more = {}) {
  const node = Object.assign(document.createElement("input"), { type, value, ...more });
  if (label) node.setAttribute("aria-label", label);
  node.addEventListener("input", () => onInput(node, true));
  node.addEventListener("change", () => { onInput(node, false); settle(); });
  return node;
}

/** Returns the number in a text field, or null. */
function numberOf(node) {
  const number = Number(node.value);
  return node.value.trim() === "" || !Number.isFinite(number) ? null : number;
}

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
    const signature = `${form} ${at(state.recipe, path)?.per_mm2 !== undefined}`;
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
    const shifted = (to, now) => moved(now, tidy(to), limits);
    const slider = add("range", `${label}, slider`, centre, shifted, { min: low, max: high, step });
    // The value is set again after the range of the slider.
    slider.value = centre(value);
    if (form === "constant") {
      const more = { step: whole, min: schema.minimum, max: schema.maximum, id: `field-${name}` };
      row.append(slider, add("number", null, (now) => now, (to) => to, more));
    } else {
      row.append(slider);
      node.plot = curve(value);
      row.append(node.plot);
    }
    if (mayVary) {
      const select = selectOf(FORMS, `${label}, distribution`);
      select.value = form;
      select.addEventListener("change", () => put(formed(present(), select.value, limits), false));
      forms.append(select);
    }
    node.append(row);
    if (form !== "constant") {
      const parts = made("div", [], "parts");
      const part = (text, k) => {
        const write = (to, now) => ({ ...now, [form]: now[form].with(k, to) });
        const field = add("number", `${label}, ${text}`, (now) => now[form][k], write, { step: "any" });
        parts.append(made("label", [`${text} `, field]));
      };
      parts.classList.toggle("wide", form === "choice");
      if (form === "choice") {
        const text = input("text", `${label}, values`, value.choice.join(", "), (own) => {
          const values = own.value.split(/[\s,;]+/).filter(Boolean).map(Number);
          if (values.length > 0 && values.every(Number.isFinite)) put({ ...present(), choice: values }, true);
        });
        node.fields.push([text, (now) => now.choice.join(", ")]);
        parts.append(made("label", ["values ", text]));
      } else {
        PARTS[form].forEach(part);
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
      const select = selectOf([["field", "per field"], ["mm2", "per mm²"]], `${label}, count or density`);
      const isPer = at(state.recipe, path)?.per_mm2 !== undefined;
      select.value = isPer ? "mm2" : "field";
      select.addEventListener("change", () => {
        const { width_px, height_px, pixel_um } = state.recipe.field;
        const area = centre(width_px) * centre(height_px) * centre(pixel_um) ** 2 * 1e-6;
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
