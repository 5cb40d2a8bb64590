"use strict";

// The engine in this page, instead of a server: workers that each have their own instance, and what passes requests of
// the page to them. They share no memory.

/** Time after which an outdated image is given up, ms: a new instance draws all objects again. */
const PATIENCE_MS = 1000;

/** Numbers of images that one instance may use. */
const IMAGES = 1_000_000;

/** The compiled engine. */
let compiled = null;

/** A worker with an instance of the engine. */
class Instance {
  #worker = null;
  #started = 0;
  #number = 0;
  #waiting = new Map();
  /** Images of the user, for a new instance. */
  #kept = [];

  /** Starts the worker, if necessary anew. The instance then has no image, and those of the user again. */
  #start() {
    const worker = new Worker("worker.js");
    worker.addEventListener("message", ({ data }) => this.#receive(data));
    worker.addEventListener("error", () => this.#fail());
    worker.postMessage({ module: compiled, imagesBefore: IMAGES * this.#started });
    this.#started += 1;
    this.#worker = worker;
    for (const { head, body } of this.#kept) worker.postMessage({ number: 0, head, body });
  }

  #end() {
    this.#worker?.terminate();
    this.#worker = null;
    const waiting = [...this.#waiting.values()];
    this.#waiting.clear();
    return waiting;
  }

  #fail() {
    const error = JSON.stringify({ error: "The engine failed at this request, and was started again." });
    for (const { resolve } of this.#end()) resolve(new Response(error, { status: 500 }));
  }

  #receive({ number, head, body, failure }) {
    if (failure) this.#fail();
    const waiting = this.#waiting.get(number);
    if (!waiting) return;
    this.#waiting.delete(number);
    waiting.resolve(new Response(body, { status: head.status, headers: { "Content-Type": head.content_type } }));
  }

  /** Returns the reply to a request. */
  ask(head, body) {
    if (!this.#worker) this.#start();
    if (head.target.startsWith("/real")) this.#kept.push({ head, body });
    const number = (this.#number += 1);
    const reply = new Promise((resolve) => {
      this.#waiting.set(number, { resolve, head, since: performance.now() });
    });
    this.#worker.postMessage({ number, head, body });
    return reply;
  }

  get isBusy() {
    return this.#waiting.size > 0;
  }

  /** Gives up an image that takes long, and what waits for it. */
  giveUp(patienceMs = PATIENCE_MS) {
    const isSlow = ({ head, since }) => head.target === "/render" && performance.now() - since >= patienceMs;
    if (![...this.#waiting.values()].some(isSlow)) return;
    for (const { resolve, head } of this.#end()) {
      const isImage = head.target === "/render";
      resolve(isImage ? cancelled() : new Response(JSON.stringify({ error: "replaced" }), { status: 404 }));
    }
  }
}

/** Returns the reply to an image that was given up, as the engine writes it. */
function cancelled() {
  const text = new TextEncoder().encode(JSON.stringify({ cancelled: true }));
  return new Response(new Blob([new Uint32Array([text.length]), text]));
}

/** The instances for images, for reduced images and text, and for small images. */
const instances = { full: new Instance(), reduced: new Instance(), small: [] };

function instanceFor(target, options) {
  const { full, reduced, small } = instances;
  if (target === "/render") {
    const { view } = JSON.parse(options.body);
    if (view === "small") return small.find((instance) => !instance.isBusy) ?? small[0];
    return view === "full" ? full : reduced;
  }
  return ["/info", "/check", "/print"].includes(target) ? reduced : full;
}

async function bytesOf(body) {
  if (body === undefined) return new Uint8Array();
  return new Uint8Array(await new Response(body).arrayBuffer());
}

/** Called when the engine is compiled. */
let setCompiled = () => {};
const compiling = new Promise((resolve) => { setCompiled = resolve; });

send = async (path, options) => {
  await compiling;
  const target = `/${path}`;
  const head = { method: options.method ?? "GET", target, content_type: options.headers?.["Content-Type"] ?? null };
  return instanceFor(target, options).ask(head, await bytesOf(options.body));
};

outdate = () => {
  for (const instance of Object.values(instances).flat()) instance.giveUp();
};

// The start: a picture and a button.
{
  const button = element("load");
  /** The parts of the page that need the engine. */
  const parts = [...document.querySelectorAll("#bar > :not(a, h1), #recipe, #tools, #strip, aside")];
  for (const part of parts) part.inert = true;

  button.addEventListener("click", async () => {
    button.disabled = true;
    element("loading").textContent = "Loading …";
    try {
      const response = await fetch("engine.wasm.zlib");
      if (!response.ok) throw new Error(`${response.status} ${response.statusText}`);
      const plain = response.body.pipeThrough(new DecompressionStream("deflate"));
      compiled = await WebAssembly.compile(await new Response(plain).arrayBuffer());
      parallel = Math.max(1, Math.min(navigator.hardwareConcurrency - 1, 4));
      instances.small = Array.from({ length: parallel }, () => new Instance());
      setCompiled();
      element("start").remove();
      for (const part of parts) part.inert = false;
    } catch (error) {
      button.disabled = false;
      element("loading").textContent = `The engine cannot be loaded: ${error.message}.`;
    }
  });
}
