// Files of a ZIP archive: stored or deflated, without encryption.

const END = 0x06054b50, ENTRY = 0x02014b50, LOCAL = 0x04034b50;
const END_BYTES = 22, ENTRY_BYTES = 46, LOCAL_BYTES = 30;
const MAX_COMMENT = 65535;
// What ZIP64, a format for larger archives, has in place of a number.
const ALL = 0xffffffff;

// The files of an archive, a map from paths to bytes. `most` bounds their bytes in all.
export async function unzipped(bytes, most) {
    const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
    const { count, start } = ending(view);
    const files = new Map();
    let at = start, total = 0;
    for (let index = 0; index < count; index++) {
        if (at + ENTRY_BYTES > bytes.length || view.getUint32(at, true) !== ENTRY) throw new Error("its list of files is damaged");
        const word = offset => view.getUint32(at + offset, true), half = offset => view.getUint16(at + offset, true);
        const [flags, method, packed, size, local] = [half(8), half(10), word(20), word(24), word(42)];
        const name = new TextDecoder().decode(bytes.subarray(at + ENTRY_BYTES, at + ENTRY_BYTES + half(28)));
        at += ENTRY_BYTES + half(28) + half(30) + half(32);
        if (/[/\\]$/.test(name)) continue;
        if (flags & 1) throw new Error(`${name} is encrypted`);
        if (packed === ALL || size === ALL || local === ALL) throw new Error(`${name} is too large`);
        total += size;
        if (total > most) throw new Error("it has more than fits");
        files.set(name, await content(bytes, view, { name, method, packed, size, local }));
    }
    return files;
}

function ending(view) {
    const first = Math.max(0, view.byteLength - END_BYTES - MAX_COMMENT);
    for (let at = view.byteLength - END_BYTES; at >= first; at--) {
        if (view.getUint32(at, true) !== END) continue;
        const start = view.getUint32(at + 16, true);
        if (start === ALL) throw new Error("it is a ZIP64 archive, which this page does not read");
        return { count: view.getUint16(at + 10, true), start };
    }
    throw new Error("it is no ZIP archive");
}

async function content(bytes, view, { name, method, packed, size, local }) {
    if (local + LOCAL_BYTES > bytes.length || view.getUint32(local, true) !== LOCAL) throw new Error(`${name} is damaged`);
    const start = local + LOCAL_BYTES + view.getUint16(local + 26, true) + view.getUint16(local + 28, true);
    const part = bytes.subarray(start, start + packed);
    if (part.length !== packed) throw new Error(`${name} is cut short`);
    if (method === 0) return part.slice();
    if (method !== 8) throw new Error(`${name} is compressed in another way than by Deflate`);
    const inflated = new Uint8Array(size);
    let place = 0;
    const reader = new Blob([part]).stream().pipeThrough(new DecompressionStream("deflate-raw")).getReader();
    const next = () => reader.read().catch(() => { throw new Error(`${name} is damaged`); });
    for (let read = await next(); !read.done; read = await next()) {
        if (place + read.value.length > size) throw new Error(`${name} is longer than its archive says`);
        inflated.set(read.value, place);
        place += read.value.length;
    }
    if (place !== size) throw new Error(`${name} is shorter than its archive says`);
    return inflated;
}
