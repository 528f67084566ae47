// Runs a WebAssembly program with the system interface WASI in Node: node wasi.mjs PROGRAM.wasm [ARGUMENT...]
// It sees the current folder and the environment, and its exit code is that of this process.
import { readFile } from "node:fs/promises";
import { WASI } from "node:wasi";

const [program, ...args] = process.argv.slice(2);
const wasi = new WASI({
    version: "preview1",
    args: [program, ...args],
    env: process.env,
    preopens: { "/": "/", ".": "." },
    returnOnExit: true,
});
const module = await WebAssembly.compile(await readFile(program));
const instance = await WebAssembly.instantiate(module, wasi.getImportObject());
process.exitCode = wasi.start(instance);
