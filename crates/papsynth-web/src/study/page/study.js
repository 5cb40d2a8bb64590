"use strict";

// The page receives the number of the next trial and the names of its patches, never the answer.

const FIXATION_MS = 700;
const REST_EVERY = 30;
const RETRY_MS = 1000;

/** Answers by position: the left key and button, the right ones. */
const ANSWERS = { "yes-no": ["real", "synthetic"], "2afc": ["left", "right"] };

const sleep = (ms) => new Promise((resolve) => setTimeout(resolve, ms));

/** State of the study, from the server. */
let state = null;

/** Time at which the question appeared. */
let asked = 0;

/** The pending report that the patches of this trial were shown. */
let reported = Promise.resolve();

function show(screen) {
  for (const section of document.querySelectorAll("main > section")) {
    section.hidden = section.id !== screen;
  }
  document.body.dataset.screen = screen;
}

const screen = () => document.body.dataset.screen;

/** Thrown if the server is at another trial than this page. */
class Stale extends Error {}

/** Sends a request and repeats it until the server responds. */
async function ask(path, body) {
  for (let before = null; ; ) {
    let problem;
    try {
      const response = await request(path, body);
      if (before !== null) show(before);
      return response;
    } catch (error) {
      if (error.status === 409) {
        if (before !== null) show(before);
        throw new Stale();
      }
      problem = error.status ? `The study program reports: ${error.message}.` : "The study program does not respond.";
    }
    if (before === null) before = screen();
    element("lost-text").textContent = problem;
    show("lost");
    await sleep(RETRY_MS);
  }
}

async function load() {
  state = await (await ask("state")).json();
  document.body.className = state.task === "yes-no" ? "yes-no" : "pairs";
  progress();
}

function progress() {
  const { stage, number, of, finished } = state;
  const text = stage === "training" ? `practice ${number} of ${of}` : `${number} of ${of}`;
  element("progress").textContent = finished || isFresh() ? "" : text;
}

/** Whether no trial was shown yet. */
const isFresh = () => state.answered === 0 && !state.shown;

/** Continues with the next trial. */
function next() {
  if (state.finished) return result();
  if (state.shown) return question();
  const { stage, number, training, trials } = state;
  if (stage === "counted" && number === 1 && training > 0) {
    return rest("End of practice", `${trials} ${things(trials)} follow.`);
  }
  if (stage === "counted" && number > 1 && (number - 1) % REST_EVERY === 0) {
    return rest("Rest", `${number - 1} of ${trials} trials are done. Rest your eyes, and continue when you are ready.`);
  }
  return trial();
}

function things(count) {
  const [one, many] = state.task === "yes-no" ? ["patch", "patches"] : ["pair", "pairs"];
  return count === 1 ? one : many;
}

function rest(title, text) {
  element("pause-title").textContent = title;
  element("pause-text").textContent = text;
  show("pause");
}

function welcome() {
  const { exposure_ms, training, trials } = state;
  element("seconds").textContent = `${exposure_ms / 1000} ${exposure_ms === 1000 ? "second" : "seconds"}`;
  element("practice-first").textContent = training > 0
    ? `The first ${training === 1 ? "one is" : `${training} are`} for practice; then ${trials} ${things(trials)} count.`
    : `${trials} ${things(trials)} follow.`;
  show("welcome");
}

/** Returns the decoded patches of this trial. */
async function fetched() {
  const bitmaps = [];
  for (const name of state.patches) {
    const blob = new Blob([await (await ask(`patch/${name}`)).arrayBuffer()], { type: "image/png" });
    bitmaps.push(await createImageBitmap(blob, { colorSpaceConversion: "none", premultiplyAlpha: "none" }));
  }
  return bitmaps;
}

/** Creates canvases that show each pixel of a patch as a whole number of screen pixels. */
function canvases() {
  const side = state.patch_px;
  const length = side * Math.max(1, Math.round(devicePixelRatio)) / devicePixelRatio;
  const all = state.patches.map(() => {
    const canvas = document.createElement("canvas");
    canvas.width = canvas.height = side;
    canvas.style.width = canvas.style.height = `${length}px`;
    return canvas;
  });
  element("patches").replaceChildren(...all);
  return all;
}

/** Calls `step` with the time of each frame until it returns a value. Ends at once if the page is hidden. */
function frames(step) {
  return new Promise((resolve) => {
    let done = false;
    const end = (outcome) => {
      done = true;
      document.removeEventListener("visibilitychange", hidden);
      resolve(outcome);
    };
    // Browsers stop animation frames of a hidden page.
    const hidden = () => { if (document.hidden) end({ hidden: true }); };
    const tick = (now) => {
      if (done) return;
      const outcome = step(now);
      if (outcome === undefined) requestAnimationFrame(tick);
      else end(outcome);
    };
    document.addEventListener("visibilitychange", hidden);
    requestAnimationFrame(tick);
    hidden();
  });
}

/** Shows the cross. Returns the duration of a frame of this screen. */
function fixate() {
  let began, last, shortest = Infinity;
  show("fixation");
  return frames((now) => {
    began ??= now;
    if (last !== undefined && now > last) shortest = Math.min(shortest, now - last);
    last = now;
    if (now - began >= FIXATION_MS) return { frame_ms: Number.isFinite(shortest) ? shortest : 0 };
  });
}

/**
 * Shows the patches and removes them with the frame nearest to the end of the exposure. The exposure is the time between the two
 * frames, which reach the screen with the same delay.
 */
function expose(bitmaps, all, frame_ms) {
  let began, last, count = 0, longest = 0;
  return frames((now) => {
    if (began === undefined) {
      bitmaps.forEach((bitmap, slot) => all[slot].getContext("2d", { alpha: false }).drawImage(bitmap, 0, 0));
      show("patch");
      began = last = now;
      return undefined;
    }
    count += 1;
    longest = Math.max(longest, now - last);
    last = now;
    if (now - began < state.exposure_ms - frame_ms / 2) return undefined;
    element("patches").replaceChildren();
    return { exposure_ms: now - began, frames: count, longest_frame_ms: longest, pixel_ratio: devicePixelRatio };
  });
}

async function trial() {
  try {
    show("fixation");
    const bitmaps = await fetched();
    const all = canvases();
    const { hidden, frame_ms } = await fixate();
    const exposure = hidden ? { hidden } : await expose(bitmaps, all, frame_ms);
    bitmaps.forEach((bitmap) => bitmap.close());
    element("patches").replaceChildren();
    if (exposure.hidden) {
      rest("Interrupted", `The page was hidden. The ${things(1)} is shown again.`);
      return;
    }
    question();
    reported = ask("shown", { patch: state.patches[0], exposure }).then((response) => response.json());
    // Errors are handled when the answer is sent.
    reported.catch(() => {});
  } catch (error) {
    await recover(error);
  }
}

function question() {
  state.shown = true;
  progress();
  show("question");
  asked = performance.now();
}

/** Sends the answer at position 0 or 1. */
async function answer(position, now) {
  if (screen() !== "question") return;
  const response_ms = Math.max(0, now - asked);
  const body = { patch: state.patches[0], answer: ANSWERS[state.task][position], response_ms };
  show("fixation");
  try {
    await reported;
    state = await (await ask("answer", body)).json();
    progress();
    next();
  } catch (error) {
    await recover(error);
  }
}

/** Reloads the state from the server. */
async function recover(error) {
  if (!(error instanceof Stale)) {
    element("trouble").textContent = String(error);
    console.error(error);
  }
  reported = Promise.resolve();
  await load();
  if (state.finished || state.shown) next();
  else rest("Continue", "The study was interrupted. All answers are saved.");
}

const three = (value) => value.toFixed(3).replace(/^0\./, ".");

function cell(row, text, below) {
  const td = row.insertCell();
  td.textContent = text;
  if (below !== undefined) {
    const small = document.createElement("small");
    small.textContent = below;
    td.append(small);
  }
}

const interval = ({ low, high }) => `${three(low)}–${three(high)}`;

function fraction(row, { value, wilson_95 }) {
  if (value === null) cell(row, "–");
  else cell(row, three(value), interval(wilson_95));
}

async function result() {
  const summary = await (await ask("result")).json();
  const rows = element("row").tBodies[0];
  rows.replaceChildren();
  for (const { subject, counts, sensitivity, specificity, accuracy, detection } of [summary.row, summary.random]) {
    const row = rows.insertRow();
    cell(row, subject);
    for (const name of ["tp", "fp", "tn", "fn"]) cell(row, counts[name]);
    for (const value of [sensitivity, specificity, accuracy]) fraction(row, value);
    const { d_prime, d_prime_interval, criterion } = detection;
    cell(row, minus(d_prime, 2), `${minus(d_prime_interval.low, 1)} to ${minus(d_prime_interval.high, 1)}`);
    cell(row, minus(criterion, 2));
  }
  rows.rows[1].className = "random";
  const { hits, total } = summary.row.accuracy;
  element("verdict").textContent = `${hits} of ${total} answers were correct; guessing gives about ${Math.round(total / 2)}.`;
  const { half_width, trials } = summary.precision;
  element("claim").textContent =
    `An accuracy of ±${Math.round(100 * half_width)} percentage points needs ${trials} trials, from one subject or several pooled.`;
  const groups = element("breakdown").tBodies[0];
  groups.replaceChildren();
  let before;
  for (const { side, parameter, value, correct } of summary.breakdown) {
    const row = groups.insertRow();
    const name = `${side}: ${parameter}`;
    const texts = [name === before ? "" : name, value, `${correct.hits} of ${correct.total}`, interval(correct.wilson_95)];
    if (name !== before) row.className = "begins";
    before = name;
    for (const text of texts) cell(row, text);
  }
  element("more").hidden = summary.breakdown.length === 0;
  show("result");
}

function go() {
  if (screen() === "welcome" || screen() === "pause") trial();
}

element("begin").addEventListener("click", go);
element("resume").addEventListener("click", go);
element("first").addEventListener("click", (event) => answer(0, event.timeStamp));
element("second").addEventListener("click", (event) => answer(1, event.timeStamp));

document.addEventListener("keydown", (event) => {
  if (event.repeat || event.ctrlKey || event.altKey || event.metaKey) return;
  const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
  const waits = screen() === "welcome" || screen() === "pause";
  if (waits && (key === " " || key === "Enter")) {
    event.preventDefault();
    go();
  } else if (screen() === "question") {
    const keys = state.task === "yes-no" ? [["ArrowLeft", "r"], ["ArrowRight", "s"]] : [["ArrowLeft", "l"], ["ArrowRight", "r"]];
    const position = keys.findIndex((names) => names.includes(key));
    if (position >= 0) {
      event.preventDefault();
      answer(position, event.timeStamp);
    }
  }
});

(async () => {
  await load();
  if (isFresh()) welcome();
  else if (state.finished || state.shown) next();
  else rest("Welcome back", "All answers are saved.");
})();
