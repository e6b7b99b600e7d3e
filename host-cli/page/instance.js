// An instance of the module in a worker: its memory, calls with bytes, and notice of its end.

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

// Holds a lock for as long as this worker lives, and tells its name. A browser that ends a worker, such as when memory is short, tells nobody, but
// gives the worker's locks free. Browsers have locks on `https:` and `localhost` alone.
export function holdLock(tell) {
    const name = `photoncard ${Math.random()}`;
    navigator.locks?.request(name, () => {
        tell(name);
        return new Promise(() => { });
    });
}

// Calls a function when the worker that holds a lock has ended.
export function awaitEnd(name, act) {
    navigator.locks.request(name, act);
}
