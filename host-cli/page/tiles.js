// Tiles and files as they come from the command. A tile has a head of eleven little-endian words, and pixels
// of three floats; a file has a word that no tile begins with, the length of its name, the name and its
// bytes.

const HEAD = 44;
const FILE_HEAD = 8;
// Count that is not known, and first word of a file.
const UNKNOWN = 0xffffffff;
const FILE = 0xffffffff;

// The tile of a message; null if its length is not what its head says.
export function decoded(buffer) {
    if (buffer.byteLength < HEAD) return null;
    const words = new DataView(buffer);
    const [version, step, x, y, columns, rows, samples, card, gathers, records, dram] =
        Array.from({ length: HEAD / 4 }, (_, index) => words.getUint32(4 * index, true));
    if (step === 0 || buffer.byteLength !== HEAD + 12 * columns * rows) return null;
    const lines = dram === UNKNOWN ? NaN : dram;
    return { version, step, x, y, columns, rows, samples, card, gathers, records, lines, pixels: floats(buffer) };
}

// Name and bytes of a file's message; null for another one.
export function fileOf(buffer) {
    if (buffer.byteLength < FILE_HEAD) return null;
    const words = new DataView(buffer);
    const [first, length] = [words.getUint32(0, true), words.getUint32(4, true)];
    if (first !== FILE || buffer.byteLength < FILE_HEAD + length) return null;
    const name = new TextDecoder().decode(new Uint8Array(buffer, FILE_HEAD, length));
    return { name, bytes: new Uint8Array(buffer, FILE_HEAD + length) };
}

const IS_LITTLE = new Uint8Array(new Uint32Array([1]).buffer)[0] === 1;

function floats(buffer) {
    if (IS_LITTLE) return new Float32Array(buffer, HEAD);
    const words = new DataView(buffer, HEAD);
    return Float32Array.from({ length: words.byteLength / 4 }, (_, index) => words.getFloat32(4 * index, true));
}
