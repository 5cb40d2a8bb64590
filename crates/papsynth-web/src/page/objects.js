"use strict";

// Details of objects, for the viewer and the workbench.

function made(tag, text, className) {
  const node = document.createElement(tag);
  node.append(...[text].flat());
  if (className) node.className = className;
  return node;
}

/** Returns the details of an object. `perPlane(node, values, unit)` is called for values of each plane. */
function card(object, perPlane) {
  const node = made("article", []);
  const heading = made("h3", [object.class ?? object.group, made("span", `${object.part ?? ""} ${object.id}`.trim())]);
  node.style.borderLeftColor = object.colour;
  const list = made("dl", []);
  const row = (name, value) => {
    const cell = made("dd", value ?? "");
    if (value !== undefined && value !== "") list.append(made("dt", name), cell);
    return cell;
  };
  row("Bethesda", object.bethesda);
  row("traits", object.traits?.replaceAll(";", ", "));
  row("tint", object.tint);
  if (object.class !== undefined) {
    row("depth", `${minus(object.depth_um, 1)} µm`);
    const planes = (name, values, unit) => values.length && perPlane(row(name, "…"), values, unit);
    planes("defocus", object.defocus_um, " µm");
    planes("contrast / noise", object.detectability, "");
    row("area", `${object.area_um2.toFixed(object.area_um2 < 100 ? 1 : 0)} µm²`);
    row("absorbance", object.mean_absorbance.toFixed(2));
    row("cluster", object.cluster || "");
    const hints = [object.visible ? "" : "partly hidden", object.truncated ? "cut by the border" : ""].filter(Boolean);
    row("", hints.join(", "));
  }
  node.append(heading, list);
  return node;
}
