// Runs a wasm32-wasip1 program that only writes to standard output and error: node wasi.mjs PROGRAM
// Some versions of Node's own WASI fail when the program exits.
import { readFileSync, writeSync } from "node:fs";

const BAD_FILE = 8;
let memory;
const view = () => new DataView(memory.buffer);
const set = (places) => {
  places.forEach((place) => view().setUint32(place, 0, true));
  return 0;
};

const wasi_snapshot_preview1 = {
  fd_write(file, parts, count, written) {
    if (file !== 1 && file !== 2) return BAD_FILE;
    let total = 0;
    for (let part = parts; part < parts + 8 * count; part += 8) {
      const bytes = new Uint8Array(memory.buffer, view().getUint32(part, true), view().getUint32(part + 4, true));
      for (let done = 0; done < bytes.length; ) done += writeSync(file, bytes.subarray(done));
      total += bytes.length;
    }
    view().setUint32(written, total, true);
    return 0;
  },
  environ_sizes_get: (...places) => set(places),
  environ_get: () => 0,
  args_sizes_get: (...places) => set(places),
  args_get: () => 0,
  // Random keys of hash tables in the triangulation, whose order must not affect the output.
  random_get(place, count) {
    globalThis.crypto.getRandomValues(new Uint8Array(memory.buffer, place, count));
    return 0;
  },
  proc_exit: (code) => process.exit(code),
};

const program = new WebAssembly.Module(readFileSync(process.argv[2]));
const { exports } = new WebAssembly.Instance(program, { wasi_snapshot_preview1 });
memory = exports.memory;
exports._start();
