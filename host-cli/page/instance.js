// An instance of the module in a worker: its memory, and calls with bytes.

import { System } from "./wasi.js";

export class Instance {
    // `own` are the functions that the module imports from the page.
    static async of(module, files, own, said) {
        const system = new System(files, said);
        const instance = new Instance();
        const imports = Object.fromEntries(Object.entries(own).map(([name, act]) => [name, (...words) => act(instance, ...words)]));
        const needed = WebAssembly.Module.imports(module).filter(({ module }) => module === "photoncard");
        // The host needs functions that a card lacks, and a card those that the host lacks.
        const photoncard = Object.fromEntries(needed.map(({ name }) => [name, imports[name] ?? (() => { })]));
        const { exports } = await WebAssembly.instantiate(module, { photoncard, wasi_snapshot_preview1: system.imports(module) });
        system.begin(exports.memory);
        instance.exports = exports;
        exports._initialize();
        return instance;
    }

    // A copy of bytes of the module's memory.
    copied(at, length) {
        return this.exports.memory.buffer.slice(at, at + length);
    }

    // A text in the module's memory.
    text(at, length) {
        return new TextDecoder().decode(new Uint8Array(this.exports.memory.buffer, at, length));
    }

    // Gives the module the bytes of its next call.
    give(bytes) {
        const from = new Uint8Array(bytes);
        const at = this.exports.buffer(from.length);
        new Uint8Array(this.exports.memory.buffer, at, from.length).set(from);
    }

    giveText(text) {
        this.give(new TextEncoder().encode(text));
    }
}
