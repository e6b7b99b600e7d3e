// The system that the module asks of its host, WASI preview 1: a clock, random bytes, and files in memory that are only read.

const OK = 0, BAD = 8, INVALID = 28, NOT_FOUND = 44, NOT_SUPPORTED = 52, READ_ONLY = 69;
const DIRECTORY = 3, REGULAR = 4;
const ROOT = 3;
const ERRORS = 2;
const ALL_RIGHTS = 0xffffffffffffffffn;

// Path from the root, without a leading slash: archives and glTF files may have `.`, `..` and, from Windows, backslashes.
export function plain(path) {
    const parts = [];
    for (const part of path.split(/[/\\]/)) {
        if (part === "..") parts.pop();
        else if (part !== "" && part !== ".") parts.push(part);
    }
    return parts.join("/");
}

// A system whose files are `files`, a map from plain paths to bytes; `said(line)` is told what the module prints.
export class System {
    #memory = null;
    #open = new Map();
    #next = ROOT + 1;
    #line = "";

    constructor(files, said) {
        Object.assign(this, { files, said });
    }

    // Functions for the imports of a module; those that a page does not have fail.
    imports(module) {
        const names = WebAssembly.Module.imports(module).filter(({ module }) => module === "wasi_snapshot_preview1");
        return Object.fromEntries(names.map(({ name }) => [name, this[name]?.bind(this) ?? (() => NOT_SUPPORTED)]));
    }

    // Takes the memory of the instance.
    begin(memory) {
        this.#memory = memory;
    }

    get #view() {
        return new DataView(this.#memory.buffer);
    }

    bytes(at, length) {
        return new Uint8Array(this.#memory.buffer, at, length);
    }

    #text(at, length) {
        return new TextDecoder().decode(this.bytes(at, length));
    }

    // The file, or `null` for a folder; undefined if there is none. Paths are below the root.
    #find(path) {
        const name = plain(path);
        if (this.files.has(name)) return this.files.get(name);
        return name === "" || [...this.files.keys()].some(key => key.startsWith(`${name}/`)) ? null : undefined;
    }

    #state(file, at) {
        const view = this.#view;
        this.bytes(at, 64).fill(0);
        view.setUint8(at + 16, file ? REGULAR : DIRECTORY);
        view.setBigUint64(at + 24, 1n, true);
        view.setBigUint64(at + 32, BigInt(file?.length ?? 0), true);
        return OK;
    }

    #nothing(count, size) {
        this.#view.setUint32(count, 0, true);
        this.#view.setUint32(size, 0, true);
        return OK;
    }

    args_sizes_get(count, size) { return this.#nothing(count, size); }
    environ_sizes_get(count, size) { return this.#nothing(count, size); }
    args_get() { return OK; }
    environ_get() { return OK; }
    sched_yield() { return OK; }

    clock_time_get(clock, _precision, at) {
        // Clock 0 is the time of day; all others only go forward.
        const milliseconds = clock === 0 ? Date.now() : performance.now();
        this.#view.setBigUint64(at, BigInt(Math.round(milliseconds * 1e6)), true);
        return OK;
    }

    random_get(at, length) {
        // The browser gives at most 65,536 bytes at once.
        for (let done = 0; done < length; done += 65536) {
            crypto.getRandomValues(this.bytes(at + done, Math.min(length - done, 65536)));
        }
        return OK;
    }

    proc_exit(status) {
        throw new Error(`the program has ended with status ${status}`);
    }

    fd_prestat_get(descriptor, at) {
        if (descriptor !== ROOT) return BAD;
        this.#view.setUint8(at, 0);
        this.#view.setUint32(at + 4, 1, true);
        return OK;
    }

    fd_prestat_dir_name(descriptor, at) {
        if (descriptor !== ROOT) return BAD;
        this.bytes(at, 1)[0] = "/".charCodeAt(0);
        return OK;
    }

    fd_fdstat_get(descriptor, at) {
        const isRoot = descriptor === ROOT, file = this.#open.get(descriptor);
        if (!isRoot && !file && descriptor > ERRORS) return BAD;
        this.bytes(at, 24).fill(0);
        this.#view.setUint8(at, isRoot ? DIRECTORY : file ? REGULAR : 2);
        this.#view.setBigUint64(at + 8, ALL_RIGHTS, true);
        this.#view.setBigUint64(at + 16, ALL_RIGHTS, true);
        return OK;
    }

    path_filestat_get(_descriptor, _flags, path, length, at) {
        const file = this.#find(this.#text(path, length));
        return file === undefined ? NOT_FOUND : this.#state(file, at);
    }

    // Nothing is a link: who asks for a whole path, such as for files that a scene names, learns it by this error.
    path_readlink(_descriptor, path, length) {
        return this.#find(this.#text(path, length)) === undefined ? NOT_FOUND : INVALID;
    }

    fd_filestat_get(descriptor, at) {
        const file = this.#open.get(descriptor);
        return file ? this.#state(file.bytes, at) : descriptor === ROOT ? this.#state(null, at) : BAD;
    }

    path_open(_descriptor, _look, path, length, open, _rights, _inherited, _flags, at) {
        const file = this.#find(this.#text(path, length));
        // Creating, or emptying, a file.
        if (open & 0b1001) return READ_ONLY;
        if (file === undefined) return NOT_FOUND;
        const descriptor = this.#next++;
        this.#open.set(descriptor, { bytes: file, place: 0 });
        this.#view.setUint32(at, descriptor, true);
        return OK;
    }

    fd_close(descriptor) {
        return this.#open.delete(descriptor) ? OK : BAD;
    }

    fd_seek(descriptor, offset, from, at) {
        const file = this.#open.get(descriptor);
        if (!file?.bytes) return BAD;
        file.place = Number(offset) + [0, file.place, file.bytes.length][from];
        this.#view.setBigUint64(at, BigInt(file.place), true);
        return OK;
    }

    fd_read(descriptor, vectors, count, at) {
        const file = this.#open.get(descriptor);
        if (!file?.bytes) return BAD;
        let read = 0;
        for (const [address, length] of this.#vectors(vectors, count)) {
            const part = file.bytes.subarray(file.place, file.place + length);
            this.bytes(address, part.length).set(part);
            file.place += part.length;
            read += part.length;
        }
        this.#view.setUint32(at, read, true);
        return OK;
    }

    fd_write(descriptor, vectors, count, at) {
        if (descriptor > ERRORS) return READ_ONLY;
        let written = 0;
        for (const [address, length] of this.#vectors(vectors, count)) {
            this.#line += this.#text(address, length);
            written += length;
        }
        const lines = this.#line.split("\n");
        this.#line = lines.pop();
        for (const line of lines) this.said(line);
        this.#view.setUint32(at, written, true);
        return OK;
    }

    #vectors(vectors, count) {
        const view = this.#view;
        return Array.from({ length: count }, (_, index) =>
            [view.getUint32(vectors + 8 * index, true), view.getUint32(vectors + 8 * index + 4, true)]);
    }
}
