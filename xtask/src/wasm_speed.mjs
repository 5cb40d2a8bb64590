// Compares CPU times of fields in one instance of the engine in WebAssembly with those of the workbench, alternately:
// node wasm_speed.mjs ENGINE PAPSYNTH FIELDS
import { spawn } from "node:child_process";
import { readFileSync } from "node:fs";
import { request } from "node:http";

const [engine, program, fields] = process.argv.slice(2);

const module = new WebAssembly.Module(readFileSync(engine));
const instance = new WebAssembly.Instance(module, { page: { now: () => performance.now() } }).exports;
instance.start(0);

/** Passes a request to the instance, as page/worker.js does. */
function ours(method, target, body) {
  const head = Buffer.from(JSON.stringify({ method, target, content_type: "application/json" }));
  const start = instance.request(4 + head.length + body.length);
  const message = Buffer.from(instance.memory.buffer, start, 4 + head.length + body.length);
  message.writeUInt32LE(head.length);
  head.copy(message, 4);
  Buffer.from(body).copy(message, 4 + head.length);
  const reply = instance.reply();
  const whole = Buffer.from(instance.memory.buffer, reply, instance.reply_length());
  return unframed(whole)[1];
}

/** Splits a message into its head and its body. */
function unframed(message) {
  const length = message.readUInt32LE();
  return [JSON.parse(message.subarray(4, 4 + length)), message.subarray(4 + length)];
}

// Times of a process in ticks of 10 ms; those of compiling the instance count.
const ticks = (pid) => readFileSync(`/proc/${pid}/stat`, "utf8").split(") ")[1].split(" ").slice(11, 13);
const nativeMs = (pid) => 10 * ticks(pid).reduce((sum, part) => sum + Number(part), 0);
const ownMs = () => {
  const { user, system } = process.cpuUsage();
  return (user + system) / 1000;
};

const server = spawn(program, ["workbench", "--threads", "1"], { stdio: ["ignore", "pipe", "inherit"] });
const address = await new Promise((resolve) => {
  server.stdout.on("data", (text) => resolve(String(text).match(/http:\/\/[^ ]+\//)[0]));
});

/** Returns the body of the reply of the program, on a connection of its own: it closes idle ones. */
const theirs = (path, method, body) => new Promise((resolve, reject) => {
  const headers = { "Content-Type": "application/json" };
  const asked = request(address + path, { method, headers, agent: false }, async (response) => {
    const parts = [];
    for await (const part of response) parts.push(part);
    resolve(Buffer.concat(parts));
  });
  asked.on("error", reject);
  asked.end(body);
});
const { recipe } = JSON.parse(await theirs("info", "GET"));

const [times, walls] = [[0, 0], [[], []]];
for (let index = 0; index <= Number(fields); index += 1) {
  const body = JSON.stringify({ recipe, seed: 0, index, view: "full", focus_um: null, noise_free: false });
  const before = nativeMs(server.pid);
  const [other, pixels] = unframed(await theirs("render", "POST", body));
  const between = [nativeMs(server.pid), ownMs()];
  const [found, own] = unframed(ours("POST", "/render", body));
  const after = ownMs();
  if (!own.equals(pixels)) throw new Error(`field ${index} has other pixels`);
  // The first field compiles and fills caches.
  if (index === 0) continue;
  times[0] += between[0] - before;
  times[1] += after - between[1];
  walls[0].push(other.ms);
  walls[1].push(found.ms);
}
server.kill("SIGINT");
const median = (values) => values.sort((a, b) => a - b)[values.length >> 1];
const [native, wasm] = times.map((ms) => ms / Number(fields));
console.log(`${fields} fields with the same pixels; CPU time of a field:`);
console.log(`native ${native.toFixed(0)} ms, WebAssembly ${wasm.toFixed(0)} ms, ratio ${(wasm / native).toFixed(2)}`);
console.log(`least time of a field: ${Math.min(...walls[0]).toFixed(0)} and ${Math.min(...walls[1]).toFixed(0)} ms`);
