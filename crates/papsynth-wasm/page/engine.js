"use strict";

// The engine in this page, instead of a server: workers that each have their own instance, and what passes requests of
// the page to them. They share no memory.

/** Time after which an outdated image is given up, ms: a new instance draws all objects again. */
const PATIENCE_MS = 1000;

/** Numbers of images that one instance may use. */
const IMAGES = 1_000_000;

/** The compiled engine. */
let compiled = null;

/** Returns a reply with an error, as the engine writes it. */
const failed = (status, error) => new Response(JSON.stringify({ error }), { status });

/** A worker with an instance of the engine. */
class Instance {
  #worker = null;
  #started = 0;
  #number = 0;
  /** Requests without a reply by number. */
  #waiting = new Map();
  /** Requests about images of the user, which each new instance gets again. */
  #kept = [];

  #start() {
    const worker = new Worker("worker.js");
    worker.addEventListener("message", ({ data }) => this.#receive(data));
    worker.addEventListener("error", () => this.#fail());
    worker.postMessage({ module: compiled, imagesBefore: IMAGES * this.#started });
    this.#started += 1;
    this.#worker = worker;
    for (const kept of this.#kept) worker.postMessage(kept);
  }

  #end() {
    this.#worker.terminate();
    this.#worker = null;
  }

  #fail() {
    this.#end();
    this.#kept = this.#kept.filter(({ number }) => !this.#waiting.has(number));
    for (const { resolve } of this.#waiting.values()) {
      resolve(failed(500, "The engine failed at this request, and is started again."));
    }
    this.#waiting.clear();
  }

  #receive({ number, head, body, failure }) {
    if (failure) {
      this.#fail();
      return;
    }
    const waiting = this.#waiting.get(number);
    this.#waiting.delete(number);
    waiting?.resolve(new Response(body, { status: head.status, headers: { "Content-Type": head.content_type } }));
  }

  /** Returns the reply to a request. */
  ask(head, body) {
    if (!this.#worker) this.#start();
    const number = (this.#number += 1);
    const message = { number, head, body };
    if (head.target.startsWith("/real")) this.#kept.push(message);
    this.#worker.postMessage(message);
    return new Promise((resolve) => this.#waiting.set(number, { resolve, head, since: performance.now() }));
  }

  get isBusy() {
    return this.#waiting.size > 0;
  }

  /** Gives up an image that takes long, and what waits for it. The next instance has no image yet. */
  giveUp(patienceMs = PATIENCE_MS) {
    const isSlow = ({ head, since }) => head.target === "/render" && performance.now() - since >= patienceMs;
    if (![...this.#waiting.values()].some(isSlow)) return;
    this.#end();
    for (const [number, { resolve, head }] of this.#waiting) {
      if (head.target.startsWith("/real")) continue;
      this.#waiting.delete(number);
      resolve(head.target === "/render" ? cancelled() : failed(404, "another image replaces this one"));
    }
    if (this.isBusy) this.#start();
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
      const reason = location.protocol === "file:" ? "browsers load it from web servers only" : error.message;
      element("loading").textContent = `The engine cannot be loaded: ${reason}.`;
    }
  });
}
