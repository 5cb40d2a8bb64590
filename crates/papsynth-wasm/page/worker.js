"use strict";

// A worker with an instance of the engine. The first message is { module, imagesBefore }; each further one is a
// request, { number, head, body }, and gets a reply, { number, head, body } or { number, failure }.

let engine = null;

/** Writes a request into the memory of the instance, and returns the reply. */
function replyTo(head, body) {
  const text = new TextEncoder().encode(JSON.stringify(head));
  const start = engine.request(4 + text.length + body.length);
  // The memory may have moved.
  const request = new Uint8Array(engine.memory.buffer, start);
  new DataView(engine.memory.buffer).setUint32(start, text.length, true);
  request.set(text, 4);
  request.set(body, 4 + text.length);
  const reply = engine.reply();
  const length = new DataView(engine.memory.buffer).getUint32(reply, true);
  const bytes = (from, to) => new Uint8Array(engine.memory.buffer.slice(reply + from, reply + to));
  return [JSON.parse(new TextDecoder().decode(bytes(4, 4 + length))), bytes(4 + length, engine.reply_length())];
}

onmessage = ({ data }) => {
  if (data.module) {
    engine = new WebAssembly.Instance(data.module, { page: { now: () => performance.now() } }).exports;
    engine.start(data.imagesBefore);
    return;
  }
  const { number } = data;
  try {
    const [head, body] = replyTo(data.head, data.body);
    postMessage({ number, head, body }, [body.buffer]);
  } catch (error) {
    postMessage({ number, failure: String(error) });
  }
};
