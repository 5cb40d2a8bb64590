"use strict";

// The match of the recipe to the images of the user.

/** Interval at which the progress is requested, ms. */
const MATCH_MS = 500;

/** Least number of images: one does not show how fields differ. */
const LEAST_REALS = 2;

let matching = false;
let plans = 0;

const matchRequest = () => ({
  recipe: state.recipe,
  images: reals.map(({ name, head }) => ({ id: head.id, name })),
  pixel_um: realUm(),
  quick: element("match-quick").checked,
});

/** Says how long a match to the images takes. */
async function planMatch() {
  if (reals.length === 0) return;
  element("match").hidden = !info.matches;
  element("no-match").hidden = info.matches;
  if (!info.matches) return;
  const own = (plans += 1);
  element("match-start").disabled = matching || reals.length < LEAST_REALS;
  if (reals.length < LEAST_REALS) {
    element("match-plan").textContent = `Add ${LEAST_REALS} or more images of one size to find the recipe whose fields resemble them.`;
    return;
  }
  try {
    const asked = matchRequest();
    const { simulated, seconds } = await (await request("match/estimate", asked)).json();
    if (own !== plans) return;
    element("match-plan").textContent =
      `Finds the recipe whose fields resemble these ${reals.length} images: ${simulated} simulated fields, about ${duration(seconds)}.`;
  } catch (error) {
    if (own === plans) element("match-plan").textContent = error.message;
  }
}

async function startMatch() {
  element("match-found").replaceChildren();
  try {
    await request("match", matchRequest());
    await followMatch();
  } catch (error) {
    showMatching(false, error.message);
  }
}

/** Shows the progress of the match until it ends. */
async function followMatch() {
  for (;;) {
    const now = await (await request("match")).json();
    if (now.state === "running") {
      const { phase, done, total, seconds } = now;
      const left = done > 0 ? `, about ${duration((seconds / done) * (total - done))} left` : "";
      showMatching(true, `${phase}: ${done} of ${total}${left}`, done / total);
      await new Promise((resolve) => setTimeout(resolve, MATCH_MS));
      continue;
    }
    showMatching(false, now.state === "failed" ? now.error : now.state === "none" ? "Match cancelled." : "");
    if (now.state === "done") useMatch(now);
    return;
  }
}

function showMatching(on, text, part = 0) {
  const hasFocus = element("match").contains(document.activeElement);
  matching = on;
  element("match-progress").hidden = element("match-cancel").hidden = !on;
  element("match-progress").value = part;
  element("match-start").hidden = on;
  element("match-status").textContent = text;
  element("match-start").disabled = reals.length < LEAST_REALS;
  // The button with the focus may be hidden now.
  if (hasFocus && document.activeElement === document.body) element(on ? "match-cancel" : "match-start").focus();
}

/** Replaces the recipe by the matched one, and lists what changed. */
function useMatch({ fit, recipe }) {
  settle();
  setRecipe(recipe);
  const round = (value) => Number(value.toPrecision(3));
  const found = fit.parameters.filter(({ origin }) => origin !== "not-visible");
  const lost = fit.parameters.filter(({ origin }) => origin === "not-visible");
  const sections = Map.groupBy(found, ({ path }) => path.split(".")[0]);
  const lists = [...sections].map(([section, parameters]) => {
    const items = parameters.map(({ parameter, path, unit, value, interval, before }) => {
      const name = made("span", title(parameter.replaceAll("-", "_")));
      name.title = path;
      const change = made("span", `${round(before)} → ${round(value)} ${unit.replace("um", "µm")}`.trim(), "value");
      return made("li", [name, change, made("span", `${round(interval[0])} to ${round(interval[1])}`, "quiet")]);
    });
    return [made("h4", title(section)), made("ul", items)];
  });
  const [before, after] = [fit.distance.before, fit.distance.after].map((distance) => distance.toFixed(2));
  element("match-found").replaceChildren(
    made("p", `Distance to your images: ${before} before, ${after} after, in standard deviations between them. `
      + "Each line: value before → mean over your images, and its 95 % interval."),
    ...lists.flat(),
    ...(lost.length ? [made("p", `No visible influence, unchanged: ${lost.map(({ path }) => path).join("; ")}.`, "quiet")] : []),
  );
  status("The recipe is matched. Undo restores the one before.");
}

element("match-quick").addEventListener("change", planMatch);
element("match-start").addEventListener("click", startMatch);
element("match-cancel").addEventListener("click", () => {
  request("match/cancel", {}).catch((error) => say(error.message));
});
