// Runs a WebAssembly program for WASI in Node.js, with the current folder as its own, and ends with the program's status. As a runner of cargo's,
// which runs tests in the folder of their crate: CARGO_TARGET_WASM32_WASIP1_RUNNER="node $PWD/tests/wasi.mjs".
import { readFile } from "node:fs/promises";

// `node:wasi` warns, where it is imported, that it is experimental.
process.removeAllListeners("warning");
const { WASI } = await import("node:wasi");

const args = process.argv.slice(2);
if (args.length === 0) {
    console.error("usage: node tests/wasi.mjs PROGRAM.wasm [ARGUMENT...]");
    process.exit(2);
}
const wasi = new WASI({ version: "preview1", args, env: process.env, preopens: { ".": "." } });
const { instance } = await WebAssembly.instantiate(await readFile(args[0]), wasi.getImportObject());
try {
    process.exitCode = wasi.start(instance);
} catch (error) {
    if (!(error instanceof WebAssembly.RuntimeError)) throw error;
    // A panic aborts the program, after it has said why.
    console.error(`${args[0]}: ${error.message}`);
    process.exitCode = 134;
}
